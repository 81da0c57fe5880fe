"""The ray scenes of a bake, and how far its rays must go where the user does not say.

The extent of the rays is measured from both meshes. From the high-poly mesh: each of its vertices
lies at some distance outside or inside the low-poly surface. From the low-poly mesh: along the
very rays of the bake, the high-poly surface lies at some distance out or in. The extent is the
greatest of both, plus a margin for what lies between the samples. A longer one would let rays start
beyond neighboring parts of the model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from texbake.baking.ray_distances import (
    LEAST_EXTENT,
    MARGIN,
    CornerRayDistances,
    RayProbe,
    measure_ray_distances,
)
from texbake.baking.rays import RayField, UnobstructedRays
from texbake.baking.texels import Samples
from texbake.core import portable_math as pm
from texbake.errors import MeshError
from texbake.mesh.compose import used_rows
from texbake.mesh.distance import sample_surface
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import FloatArray, Mesh
from texbake.mesh.streamed.mesh import StreamedMesh
from texbake.mesh.triangle_tree import TriangleTree
from texbake.progress import Stages
from texbake.raycast.rays import NO_HIT, Rays
from texbake.raycast.scene import RayScene

_HIGH_POINTS = 200_000
_LOW_POINTS = 50_000
# At most for all parts of a bake together, and at least for each part.
_PARTS_POINTS, _PART_POINTS = 8 * _LOW_POINTS, 2_000
# Points of the low-poly mesh for each of its faces, where distances are measured vertex by vertex.
_POINTS_PER_FACE = 4
# Size of both meshes in model units: float32 holds a ten millionth of it with all its digits, and
# as many times it as rays are long without overflow.
_SIZES = (1e-30, 1e37)


@dataclass(frozen=True)
class RayExtent:
    """How far in front of the low-poly surface rays start and how far behind it they end.

    Both in model units.
    """

    front: float
    back: float


@dataclass(frozen=True, eq=False)
class BakeScenes:
    """What the rays of a bake are cast into, all in one frame.

    A trace builds and closes its own scenes unless it is given some that others use as well.
    """

    high: RayScene  # the high-poly mesh
    low: Mesh  # the low-poly mesh; bakes of only some of its faces can use these scenes as well
    # What secondary rays hit, if that is not just the high-poly mesh. Closed by its owner.
    occluders: RayScene | None = None
    n_points: int = _LOW_POINTS  # points of the low-poly mesh at which distances are measured
    _extents: dict[tuple[str, ...], RayExtent] = field(default_factory=dict, repr=False)
    _probes: dict[str, RayProbe] = field(default_factory=dict, init=False, repr=False)
    _reaches: dict[str, CornerRayDistances] = field(default_factory=dict, init=False, repr=False)
    _tree: TriangleTree | None = field(default=None, init=False, repr=False)
    _low_scene: RayScene | None = field(default=None, init=False, repr=False)

    @classmethod
    def build(
        cls,
        high: Mesh | StreamedMesh,
        low: Mesh,
        stages: Stages,
        *,
        occluders: RayScene | None = None,
        n_parts: int = 1,
        chunk_faces: int | None = None,
        compact: bool = False,
        threads: int | None = None,
    ) -> BakeScenes:
        """Build the scene of the high-poly mesh, in the frame of `occluders` or of both meshes."""
        frame = LocalFrame.around(high, low) if occluders is None else occluders.frame
        _check_size(frame, low)
        with stages.stage("build ray tree", total=high.n_faces, unit="triangles"):
            scene = RayScene.build(
                high, frame, chunk_faces=chunk_faces, compact=compact, threads=threads
            )
        n_points = max(min(_LOW_POINTS, _PARTS_POINTS // n_parts), _PART_POINTS)
        return cls(scene, low, occluders, n_points)

    @property
    def frame(self) -> LocalFrame:
        """Frame of all scenes."""
        return self.high.frame

    def extent(self, low: Mesh, kinds: Sequence[str], threads: int | None) -> RayExtent:
        """Greatest extent of rays of some kinds; measured once for all that use these scenes."""
        key = tuple(kinds)
        if key not in self._extents:
            measured = []
            for kind in kinds:
                extent, probe = _measured(self.high, low, kind, self.n_points, threads)
                measured.append(extent)
                if low is self.low:
                    self._probes[kind] = probe
            self._extents[key] = RayExtent(
                max(extent.front for extent in measured), max(extent.back for extent in measured)
            )
        return self._extents[key]

    def reach(self, kind: str, threads: int | None) -> CornerRayDistances:
        """How far rays of a kind reach at each vertex of the low-poly mesh; measured once."""
        if kind not in self._reaches:
            extent = self.extent(self.low, (kind,), threads)
            probe = self._probes.get(kind)
            n_points = min(_POINTS_PER_FACE * self.low.n_faces, _HIGH_POINTS)
            if probe is None or n_points > len(probe.faces):
                limit = float(self.frame.length_to_local(max(extent.front, extent.back)))
                n_points = max(n_points, self.n_points)
                probe = probe_both_ways(self.high, self.low, kind, n_points, limit, threads)
            self._reaches[kind] = measure_ray_distances(
                self.high.source, self.low, self.frame, probe, threads=threads
            )
        return self._reaches[kind]

    def fitted(self, field: RayField, low: Mesh, kind: str, threads: int | None) -> RayField:
        """Return rays that reach as far as each vertex needs, and never farther than a field's."""
        reach = self.reach(kind, threads).at(low)
        return field.with_reaches(np.minimum(reach, (field.front, field.back)))

    def clear(self, field: RayField, threads: int | None) -> UnobstructedRays:
        """Return the rays of a field, not through other parts of the low-poly mesh."""
        if self._low_scene is None:
            scene = RayScene.build(self.low, self.frame, threads=threads)
            object.__setattr__(self, "_low_scene", scene)
        assert self._low_scene is not None
        return UnobstructedRays(field, self._low_scene)

    def closest_tree(self, threads: int | None) -> TriangleTree:
        """Return a tree for the closest points of the high-poly mesh; it is built only once."""
        if self._tree is None:
            mesh = self.high.mesh
            positions = self.frame.to_local(mesh.positions)
            tree = TriangleTree.build(positions, mesh.faces, threads=threads)
            object.__setattr__(self, "_tree", tree)
            return tree
        return self._tree

    def with_high(self, turned: Mesh, stages: Stages) -> BakeScenes:
        """Return scenes with the same high-poly mesh flipped, to be closed like these.

        Distances do not depend on which way faces look, and are not measured again.
        """
        with stages.stage("build ray tree", total=turned.n_faces, unit="triangles"):
            high = self.high
            scene = RayScene.build(turned, self.frame, compact=high.compact, threads=high.threads)
        return BakeScenes(scene, self.low, self.occluders, self.n_points, self._extents)

    def close(self) -> None:
        """Free the scene of the high-poly mesh."""
        self.high.close()


def _check_size(frame: LocalFrame, low: Mesh) -> None:
    """Raise if lengths of the meshes do not fit into the float32 numbers of hits and maps."""
    size = 1.0 / frame.scale
    if not _SIZES[0] <= size <= _SIZES[1]:
        raise MeshError(
            f"{low.name}: it and the high-poly mesh are about {size:.1e} model units across, which "
            "the float32 numbers of maps cannot hold; scale both meshes first"
        )


def measure_extent(
    scene: RayScene, low: Mesh, kind: str, *, threads: int | None = None
) -> RayExtent:
    """Measure how far in front of the low-poly surface rays start, and how far behind they end."""
    return _measured(scene, low, kind, _LOW_POINTS, threads)[0]


def _measured(
    scene: RayScene, low: Mesh, kind: str, n_points: int, threads: int | None
) -> tuple[RayExtent, RayProbe]:
    """As `measure_extent`; also return what the rays of the low-poly mesh met."""
    out_high, in_high = _from_high(scene, low, _spread_points(scene.source), threads)
    limit = 2.0 * max(out_high, in_high) + LEAST_EXTENT
    probe = probe_both_ways(scene, low, kind, n_points, limit, threads)
    if ((probe.out.faces == NO_HIT) & (probe.into.faces == NO_HIT)).any():
        # The corners of a bevel may lie on the low-poly surface, and all that is between them deep
        # below it.
        out_mid, in_mid = _from_high(scene, low, _middles(scene.source), threads)
        if max(out_mid, in_mid) > max(out_high, in_high):
            out_high, in_high = max(out_high, out_mid), max(in_high, in_mid)
            limit = 2.0 * max(out_high, in_high) + LEAST_EXTENT
            probe = probe_both_ways(scene, low, kind, n_points, limit, threads)
    out_low, in_low = _from_low(probe)
    front, back = max(out_high, out_low), max(in_high, in_low)
    extent = RayExtent(
        float(scene.frame.length_to_model(front * MARGIN + LEAST_EXTENT)),
        float(scene.frame.length_to_model(back * MARGIN + LEAST_EXTENT)),
    )
    return extent, probe


def _from_high(
    scene: RayScene, low: Mesh, points: FloatArray, threads: int | None
) -> tuple[float, float]:
    """Greatest local distance of high-poly points outside and inside the low-poly surface."""
    frame = scene.frame
    positions = frame.to_local(low.positions)
    tree = TriangleTree.build(positions, low.faces, threads=threads)
    points = frame.to_local(points)
    distances, faces, weights = tree.closest_points(points, threads=threads)
    corners = positions[low.faces[faces]]
    closest = pm.vecmat(weights, corners)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    outside = pm.vecdot(points - closest, normals) >= 0.0
    return _greatest(distances[outside]), _greatest(distances[~outside])


def _spread_points(high: Mesh | StreamedMesh) -> FloatArray:
    """All vertices, or in a large mesh one for each of evenly spread faces: (n, 3) float64."""
    step = max(1, high.n_faces // _HIGH_POINTS)
    if isinstance(high, StreamedMesh):
        return high.spread_points(step)
    vertices = used_rows(high.faces, high.n_vertices)[0] if step == 1 else high.faces[::step, 0]
    return high.positions[vertices]


def _middles(high: Mesh | StreamedMesh) -> FloatArray:
    """(n, 3) float64: middles of faces and their edges, in a large mesh of evenly spread faces."""
    step = max(1, high.n_faces // (_HIGH_POINTS // 4))
    if isinstance(high, StreamedMesh):
        corners = high.spread_corners(step)
    else:
        corners = high.positions[high.faces[::step]]
    first, second, third = np.moveaxis(corners.reshape(-1, 3, 3), 1, 0)
    edges = [(first + second) / 2.0, (second + third) / 2.0, (third + first) / 2.0]
    return np.concatenate([*edges, (first + second + third) / 3.0])


def _from_low(probe: RayProbe) -> tuple[float, float]:
    """Greatest distance out and in along rays to the nearer high-poly surface."""
    hits = probe.out, probe.into
    out, into = (np.where(found.faces == NO_HIT, np.inf, found.distances) for found in hits)
    return (
        _greatest(out[(out < into) & np.isfinite(out)]),
        _greatest(into[(into <= out) & np.isfinite(into)]),
    )


def probe_both_ways(
    scene: RayScene, low: Mesh, kind: str, n_points: int, limit: float, threads: int | None
) -> RayProbe:
    """Cast rays out and in from points of the low-poly mesh, to front and back faces alike.

    `limit`: length of the rays, in the frame of the scene.
    """
    _, faces, weights = sample_surface(low, n_points, seed=0, threads=threads)
    samples = Samples(np.zeros(len(faces), dtype=np.int32), faces, weights[:, 1:].copy())
    field = RayField(low, scene.frame, kind=kind, front=0.0, back=1.0, threads=threads)
    inward = field.rays(samples)
    lengths = np.where(inward.lengths > 0.0, limit, 0.0)
    # Both directions at once, since a scene in chunks rebuilds its trees for each call.
    rays = Rays.joined(
        [
            Rays(inward.origins, directions, lengths, inward.fronts)
            for directions in (-inward.directions, inward.directions)
        ]
    )
    # On its way out a ray hits the high-poly surface from behind.
    found = scene.cast(rays, cull_back_faces=False)
    n = len(inward)
    return RayProbe(faces, found.where(slice(n)), found.where(slice(n, None)))


def _greatest(distances: FloatArray) -> float:
    return float(distances.max(initial=0.0))
