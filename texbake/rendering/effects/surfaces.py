"""The surfaces of a picture: every mesh in world space, with displacement applied.

Displacement moves the surface itself, and with it the silhouette. The surface is subdivided
adaptively (`texbake.rendering.displaced`): edges are halved until they are at most `edge_px` pixels
long or no longer than a texel of the map, or until there are `max_triangles` triangles.

The map is looked up with its texture's filter. A filter with mip levels selects them for half of
`edge_px`, the size of the smallest triangles; a procedure fades out finer detail.

Based on: Cook, "Shade trees", SIGGRAPH 1984; Cook, Carpenter, Catmull, "The Reyes image rendering
architecture", SIGGRAPH 1987, for dicing by size on the screen.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from texbake.core import portable_math as pm
from texbake.mesh.compose import corner_order
from texbake.mesh.mesh import Float32Array, FloatArray, IntArray, Mesh
from texbake.mesh.normals import shading_normals, smooth_normals, vertex_normals
from texbake.mesh.tangents import shading_tangents
from texbake.parallel import run_bands
from texbake.records import dataclass
from texbake.rendering.displaced import (
    BaseSurface,
    Displaced,
    EdgeView,
    Places,
    displaced,
    texel_lengths,
)
from texbake.rendering.effect import Effect, RenderState
from texbake.rendering.effects.images import LoadedImage, filtered_image, image_values, placed_image
from texbake.rendering.effects.points import map_mesh, mapping_effect, steps_along_surface
from texbake.rendering.effects.slots import procedure_values
from texbake.rendering.fragments import DrawnObject, Fragments
from texbake.rendering.maps import heights_from, normal_space
from texbake.rendering.request import RenderRequest
from texbake.rendering.scene.material import Displacement
from texbake.rendering.scene.scene import place_mesh
from texbake.rendering.scene.textures import FILTERS_WITH_FOOTPRINT, ImageTexture, ProcedureTexture


def place_object(state: RenderState, target: int) -> DrawnObject:
    """Place an object in world space."""
    item = state.scene.objects[target]
    mesh = place_mesh(item)
    inverse = None if item.transform is None else pm.inv(item.transform)
    return DrawnObject(
        mesh=mesh,
        material=item.material,
        positions=mesh.positions,
        faces=mesh.faces,
        object_from_world=None if inverse is None else np.asarray(inverse, np.float64),
    )


PLACING = Effect(
    name="placing",
    does="transforms meshes to world space",
    among="objects",
    why="it is in the scene",
    left_out="the scene has no object",
    load=place_object,
    moves_surface=True,
)

# Normals (N, 3), their indices (F, 3) and tangents (F, 3, 4) in the object's space.
Frames = tuple[FloatArray, IntArray, Float32Array]
# Lookups per band.
_BAND = 1 << 15


@dataclass(frozen=True, kw_only=True, eq=False)
class ObjectRelief:
    """An object with its displacement map, independent of the camera."""

    drawn: DrawnObject  # before displacement
    surface: BaseSurface
    holder: Displacement
    image: LoadedImage | None  # None for a procedure
    texels: FloatArray | None  # (F, 3, 2): corners of the faces in texels of the image
    # (F, 4): growth of the barycentric weights along the surface, if the lookup is filtered
    steps: FloatArray | None
    frames: Frames | None  # tangent frames, for vector displacement in tangent space
    farthest: float  # upper bound on the displacement in world space

    @property
    def n_bytes(self) -> int:
        """Memory of the map and of the arrays per face, in bytes."""
        arrays = [self.surface.normals, self.texels, self.steps]
        own = sum(array.nbytes for array in arrays if array is not None)
        return own + (0 if self.image is None else self.image.n_bytes)


def _load_relief(state: RenderState, target: int) -> ObjectRelief | DrawnObject:
    """Prepare the displacement; returns the displaced object if it is the same for all views."""
    relief = _relief(state, target)
    return _subdivide(state, target, relief) if relief.holder.edge_px is None else relief


def _relief(state: RenderState, target: int) -> ObjectRelief:
    item = state.scene.objects[target]
    drawn, mesh = state.of(place_object, target), item.mesh
    holder = item.material.displacement
    assert holder is not None
    known = state.get(map_mesh, target) if holder.texture.is_over_uvs else None
    if known is not None:
        drawn, mesh = replace(drawn, mesh=known.placed), known.mesh
    linear = np.eye(3) if item.transform is None else item.transform[:3, :3]
    image = texels = frames = None
    if isinstance(holder.texture, ImageTexture):
        image = _load_image(state, drawn, holder, holder.texture)
        corners = image.direct(drawn.mesh.corner_uvs(image.uv_set))
        texels = np.ascontiguousarray(corners * (image.chain.width, image.chain.height))
        filtered = image.filter in FILTERS_WITH_FOOTPRINT
        if holder.vector and (holder.space or normal_space(holder.texture.image)) == "tangent":
            # Indexed by the face corners of the placed mesh.
            chosen, order = mesh.on_uv_set(image.uv_set), corner_order(linear)
            normals, normal_faces = shading_normals(chosen)
            frames = normals, normal_faces[:, order], shading_tangents(chosen)[:, order]
    else:
        filtered = state.request.wants_footprint(holder.texture)
    surface = BaseSurface(
        points=drawn.positions,
        faces=drawn.faces,
        normals=smooth_normals(item.mesh, threads=state.threads),
        linear=linear,
    )
    return ObjectRelief(
        drawn=drawn,
        surface=surface,
        holder=holder,
        image=image,
        texels=texels,
        steps=steps_along_surface(drawn.positions[drawn.faces]) if filtered else None,
        frames=frames,
        farthest=_farthest(holder, image, frames is not None) * float(pm.svd(linear)[0][0]),
    )


def _farthest(holder: Displacement, image: LoadedImage | None, has_frames: bool) -> float:
    """Upper bound on the displacement in object space."""
    if image is not None:
        values = image.chain.level(0).astype(np.float64) * image.factor
        longest = math.sqrt(float(pm.vecdot(values, values).max()))
        # T, B and N are no longer than 1 each, and T may lean toward N.
        return longest * (math.sqrt(3.0) if has_frames else 1.0)
    assert isinstance(holder.texture, ProcedureTexture)
    largest = max(1.0, float(np.abs(holder.texture.colors or 0.0).max()))
    ends = largest * np.append(0.0, holder.texture.factor)
    return float(np.abs(_heights(holder, ends)).max())


def _load_image(
    state: RenderState, drawn: DrawnObject, holder: Displacement, texture: ImageTexture
) -> LoadedImage:
    uvs = drawn.mesh.uv_set(texture.uv_set).uvs
    heights = heights_from(
        texture.image, mid=holder.mid, scale=holder.height, channel=texture.channel,
        n_channels=3 if holder.vector else 1,
    )  # fmt: skip
    kind, name = state.request.filter_of(texture), "displacement.texture"
    image = placed_image(texture, heights, kind="data", filter_name=kind, uvs=uvs, name=name)
    return filtered_image(image, threads=state.threads)


def _heights(holder: Displacement, values: FloatArray) -> FloatArray:
    """Convert the values of a procedure, from 0 to 1, to heights."""
    return (values - (holder.mid or 0.0)) * (1.0 if holder.height is None else holder.height)


def displace_object(state: RenderState, target: int) -> DrawnObject:
    """Subdivide and displace an object for the camera; reuse one that is the same for all."""
    known = state.of(_load_relief, target)
    if isinstance(known, DrawnObject):
        return known
    return _subdivide(state, target, known)


def _subdivide(state: RenderState, target: int, relief: ObjectRelief) -> DrawnObject:
    """Subdivide a surface where its edges are too long, and displace its vertices."""
    edge_px, view = relief.holder.edge_px, None
    if edge_px is not None:
        view = EdgeView(state.camera, state.options, edge_px, relief.farthest)

    def moves(places: Places, points: FloatArray) -> FloatArray:
        values = np.empty((len(places.vertices), 3 if relief.holder.vector else 1))

        def work(start: int, stop: int) -> None:
            rows = slice(start, stop)
            widths = np.zeros(stop - start)  # so that the map is read at full resolution
            if view is not None:
                widths = view.widths(points[places.vertices[rows]])
            values[rows] = _values_at(relief, target, places, rows, widths)

        run_bands(work, len(values), band=_BAND, threads=state.threads)
        return values

    def excess(now: Displaced) -> FloatArray:
        if view is None:
            return texel_lengths(now.pieces, relief.texels, np.zeros(len(now.points), np.uint8))
        return view.excess(now, relief.texels, threads=state.threads)

    most = state.options.max_triangles
    result = displaced(relief.surface, moves, excess, max_triangles=most, threads=state.threads)
    drawn, pieces = relief.drawn, result.pieces
    normals = None
    if state.plan.has("vertex normals", target) and drawn.material.normal_map is None:
        shape = Mesh(positions=result.positions, faces=pieces.faces)
        normals = vertex_normals(shape, threads=state.threads)
    return replace(
        drawn,
        positions=result.positions,
        faces=pieces.faces,
        base_faces=pieces.base_faces,
        base_weights=pieces.base_weights,
        normals=normals,
        normal_faces=None if normals is None else pieces.faces,
    )


def _values_at(
    relief: ObjectRelief, target: int, places: Places, rows: slice, widths: FloatArray
) -> FloatArray:
    """(n, 1) heights or (n, 3) vectors in object space, at positions on the faces."""
    faces, weights = places.base_faces[rows], places.weights[rows].astype(np.float64)
    texture = relief.holder.texture
    changes = np.empty((0, 4), np.float32)
    if relief.steps is not None:
        changes = (relief.steps[faces] * widths[:, None]).astype(np.float32)
    fragments = Fragments.on(target, relief.drawn, faces, weights, changes)
    if texture.is_over_uvs:
        uv_set = relief.drawn.mesh.uv_set(texture.uv_set)
        corners = uv_set.uvs[uv_set.faces[faces]]
        edges = corners[:, 1:] - corners[:, :1]
        uvs = corners[:, 0] + weights[:, :1] * edges[:, 0] + weights[:, 1:] * edges[:, 1]
        uv_changes = changes
        if relief.steps is not None:
            steps = changes.reshape(-1, 2, 2).astype(np.float64)
            uv_changes = (pm.matmul(steps, edges)).reshape(-1, 4).astype(np.float32)
        fragments.coordinates[texture.uv_set] = uvs, uv_changes
    if relief.image is not None:
        values = image_values(relief.image, uvs, None if relief.steps is None else uv_changes)
        if relief.frames is not None:
            return _from_tangent_space(relief.frames, faces, weights, values)
        return values.astype(np.float64)
    assert isinstance(texture, ProcedureTexture)
    return _heights(relief.holder, procedure_values(fragments, texture, 1).astype(np.float64))


def _from_tangent_space(
    frames: Frames, faces: IntArray, weights: FloatArray, values: Float32Array
) -> FloatArray:
    """(n, 3): x T + y B + z N, with T and N interpolated and B = w cross(N, T)."""
    normals, corners, tangents = frames
    shares = np.column_stack([1.0 - weights.sum(axis=1), weights])
    normal = pm.vecmat(shares, normals[corners[faces]])
    tangent = pm.vecmat(shares, tangents[faces][..., :3])
    bitangent = np.cross(normal, tangent) * tangents[faces, 0, 3:]
    x, y, z = values.astype(np.float64).T[..., None]
    return np.asarray(x * tangent + y * bitangent + z * normal)


def _displacement_needs(request: RenderRequest, target: int) -> tuple[str, ...]:
    holder = request.material(target).displacement
    return mapping_effect(request, target) if holder and holder.texture.is_over_uvs else ()


DISPLACEMENT = Effect(
    name="displacement",
    does="subdivides surfaces and displaces them",
    after="mapping",
    material_field="displacement",
    strength="height",
    among="objects",
    why="its material has a displacement map",
    left_out="no material has a displacement map",
    needs=(_displacement_needs,),
    load=_load_relief,
    prepare=displace_object,
    moves_surface=True,
)
