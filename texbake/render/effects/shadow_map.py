"""Shadow maps: what a light sees first, and which share of a point's surroundings that leaves lit.

A map keeps, for each texel, the depth and the triangle that the light sees at its center. A point
gets the share, by area, of a square of texels about it in which nothing lies between the light and
the point's surface (percentage-closer filtering).

Whether something does is decided without a constant that would have to be tuned. A point's depth
holds at the point alone; over the filter's footprint the surface gets nearer and farther with its
slope. So

1. the plane of the point's triangle is continued to the center of the texel, and only what lies
   before that plane, by more than rounding, can shade;
2. the plane of the triangle seen there is continued back to the point, and it must lie before that
   too. Of two surfaces that meet between the point and the texel one passes neither test: at a
   ridge the first leaves it out, in a groove the second.

In clip space depth z/w is linear in x/w and y/w on any plane, so both are one multiplication by the
slope, which comes from the plane and not from differences of neighbors. The only bias is what
rounding leaves: a corner is moved by at most half a step of the rasterizer's grid on either axis,
which the slope turns into depth, and depth is kept in float32.

Based on: Williams, "Casting curved shadows on curved surfaces", SIGGRAPH 1978; Reeves, Salesin,
Cook, "Rendering antialiased shadows with depth maps", SIGGRAPH 1987, for the filter, here over an
exact square in place of random samples; Isidoro, "Shadow mapping: GPU-based tips and techniques",
GDC 2006, for the receiver's plane; Dou, Yan, Kerzner, Dai, Wyman, "Adaptive depth bias for shadow
maps", I3D 2014, for the center of the texel as where planes are compared. The second test is ours.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.kernels import kernel
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.render.effects.lights import PlacedLight, placed_light, shining
from texbake.render.effects.shadow_fit import (
    Box,
    Pair,
    box_of,
    corners_of,
    parallel_view,
    perspective_views,
    seen_bounds,
    shading_pairs,
)
from texbake.render.fragments import Fragments, Incident, row_of
from texbake.render.picture import Picture
from texbake.render.plan.effect import Call, Effect, Refusal, Target
from texbake.render.plan.question import Question
from texbake.render.raster.clip import SUBPIXELS
from texbake.render.raster.rasterize import rasterize
from texbake.render.raster.world import SHOW_BACK, SKIP
from texbake.render.scene.lights import Light

# Farthest that snapping moves a corner along an axis, in texels.
_SNAPPED = 0.5 / SUBPIXELS
# Twice the rounding of a float32: of the corners' depths and of their mean.
_ROUNDED = 2.0**-23


@dataclass(frozen=True, eq=False)
class ShadowMap:
    """What a light sees, in one view or through six faces of a cube.

    Attributes
    ----------
    views, inverses : (V, 4, 4) float64
        Clip space from world space, and back.
    depths : (V, H, W) float32
        z / w, greater is nearer to the light; 0 where it sees nothing.
    face_ids : (V, H, W) int32
        Triangle of the world; -1 where it sees nothing.
    radius : float
        Of the filter, in texels.
    """

    views: FloatArray
    inverses: FloatArray
    depths: npt.NDArray[np.float32]
    face_ids: IntArray
    radius: float

    @property
    def n_bytes(self) -> int:
        """Memory that it takes."""
        return self.depths.nbytes + self.face_ids.nbytes


def _pairs(question: Question, index: int, picture: Picture | None = None) -> list[Pair] | str:
    """Pairs of what may cast and what may receive shadows of a light, or why there are none.

    With a picture it is known which objects are seen, and how far displaced ones reach.
    """
    objects = question.scene.objects
    casters = [i for i, item in enumerate(objects) if item.casts_shadows]
    receivers = [i for i in question.lit if objects[i].receives_shadows]
    if picture is not None:
        receivers = [i for i in receivers if i in picture.seen]
    if index not in shining(question):
        return "it is dark"
    if not receivers:
        return "nothing that receives shadows is in the picture"
    if not casters:
        return "no object casts shadows"

    def box(i: int) -> Box | None:
        if picture is not None:
            return box_of(picture, i)
        return None if question.material(i).displacement is not None else corners_of(objects[i])

    boxes = {i: box(i) for i in {*casters, *receivers}}
    light = placed_light(question.light(index), question.camera)
    pairs = shading_pairs(light, {i: boxes[i] for i in casters}, {i: boxes[i] for i in receivers})
    return pairs or "its shadows fall on nothing that is in the picture"


def _called_for(question: Question) -> Iterator[Call | Refusal]:
    for index, light in enumerate(question.scene.lighting.lights):
        if light.shadow is not None:
            name, found = f'light "{light.name}"', _pairs(question, index)
            if isinstance(found, str):
                yield Refusal(name, found)
            else:
                yield Call(index, name, "it casts shadows")


def _unneeded(picture: Picture, target: Target) -> str | None:
    assert target is not None
    found = _pairs(picture.question, target, picture)
    return found if isinstance(found, str) else None


def _prepare(picture: Picture, target: Target) -> ShadowMap | None:
    """Rasterize the casters as a light sees them; None where none is before what is seen."""
    assert target is not None
    light: Light = picture.lights[target]
    placed: PlacedLight = picture.value("lights", target)
    assert light.shadow is not None
    pairs = _pairs(picture.question, target, picture)
    assert not isinstance(pairs, str)
    casters = sorted({caster for caster, _ in pairs})
    boxes = {i: box_of(picture, i) for i in casters}
    shape = (light.shadow.size, light.shadow.size)
    if light.kind == "directional":
        seen = seen_bounds(picture, placed, sorted({receiver for _, receiver in pairs}))
        view = parallel_view(light, placed, [(boxes[i], seen[j]) for i, j in pairs])
        if view is None:
            return None
        views, shape = view[0][None], view[1]
    else:
        views = perspective_views(light, placed, list(boxes.values()))
    modes = np.full(len(picture.scene.objects), SKIP, np.uint8)
    modes[casters] = SHOW_BACK
    found = [
        rasterize(picture.world, matrix, shape[1], shape[0], modes=modes, threads=picture.threads)
        for matrix in views
    ]
    return ShadowMap(
        views=views,
        inverses=np.ascontiguousarray(np.linalg.inv(views)),
        depths=np.stack([item.depths for item in found]),
        face_ids=np.stack([item.face_ids for item in found]),
        radius=light.shadow.filter_radius,
    )


@kernel
def _view_of(point, light):  # type: ignore[no-untyped-def]
    """Face of a cube that a point lies in: of its largest component."""
    face, largest = 0, -1.0
    for k in range(3):
        offset = point[k] - light[k]
        if abs(offset) > largest:
            largest = abs(offset)
            face = 2 * k if offset > 0.0 else 2 * k + 1
    return face


@kernel
def _plane_of(face, positions, faces, anchor, inverse, plane):  # type: ignore[no-untyped-def]
    """Plane of a triangle in clip space, through a point that it is told from.

    Written as (a, b, c, d): a x + b y + c z + d w = 0. Without area all are 0.
    """
    p, q, r = positions[faces[face, 0]], positions[faces[face, 1]], positions[faces[face, 2]]
    offset = 0.0
    for k in range(4):
        plane[k] = 0.0
    for k in range(3):
        y, z = (k + 1) % 3, (k + 2) % 3
        normal = (q[y] - p[y]) * (r[z] - p[z]) - (q[z] - p[z]) * (r[y] - p[y])
        offset -= normal * anchor[k]
        for j in range(4):
            plane[j] += inverse[k, j] * normal
    for j in range(4):
        plane[j] += inverse[3, j] * offset


@kernel
def _lit_share(place, slopes, world, maps, view, radius, scratch):  # type: ignore[no-untyped-def]
    """Share of the filter's square about a point that is in the light.

    `place` is column and row of the point in texels, its depth, and its x/w and y/w; `slopes` is
    how the depth of its plane grows for a texel to the right, and down.
    """
    positions, faces = world
    depths, face_ids, inverses, is_cone = maps
    column, row, depth, x, y = place
    height, width = depths.shape[1], depths.shape[2]
    if not (-radius <= column <= width + radius and -radius <= row <= height + radius):
        return 1.0
    room = (abs(slopes[0]) + abs(slopes[1])) * _SNAPPED
    lit, dark = 0.0, 0.0
    last_face, last_shades = -1, False
    for j in range(math.floor(row - radius), math.floor(row + radius) + 1):
        tall = min(row + radius, j + 1.0) - max(row - radius, float(j)) if radius > 0.0 else 1.0
        for i in range(math.floor(column - radius), math.floor(column + radius) + 1):
            area = tall
            if radius > 0.0:
                area *= min(column + radius, i + 1.0) - max(column - radius, float(i))
            here = depth + (i + 0.5 - column) * slopes[0] + (j + 0.5 - row) * slopes[1]
            inside = 0 <= i < width and 0 <= j < height
            if is_cone and (here <= 0.0 or not inside):
                continue  # the point's plane ends, at infinity, before this texel, or the map does
            # Nothing casts a shadow past the map of a directional light.
            seen = depths[view, j, i] if inside else np.float32(0.0)
            if seen <= 0.0 or seen <= here + room + _ROUNDED * seen:
                lit += area
                continue
            face = face_ids[view, j, i]
            if face != last_face:
                last_face = face
                corner = positions[faces[face, 0]]
                _plane_of(face, positions, faces, corner, inverses[view], scratch)
                there = -(scratch[0] * x + scratch[1] * y + scratch[3])
                # Seen edge-on its plane tells nothing, and the first test has decided.
                last_shades = scratch[2] == 0.0 or (
                    there / scratch[2] > depth + _ROUNDED * max(abs(depth), seen)
                )
            if last_shades:
                dark += area
            else:
                lit += area
    return lit / (lit + dark) if dark > 0.0 else 1.0


@kernel
def _dim_kernel(  # type: ignore[no-untyped-def]
    points, normals, own_faces, world, views, maps, light, radius, directions, radiance, out
):
    plane, scratch, clip = np.empty(4), np.empty(4), np.empty(4)
    height, width = maps[0].shape[1], maps[0].shape[2]
    for i in range(len(points)):
        d, r = row_of(directions, i), row_of(radiance, i)
        facing, strength = 0.0, 0.0
        for k in range(3):
            facing += normals[i, k] * directions[d, k]
            strength = max(strength, radiance[r, k])
        share = 1.0
        # What turns its back on the light reflects none of it, in shadow or not.
        if facing > 0.0 and strength > 0.0:
            view = _view_of(points[i], light) if len(views) > 1 else 0
            for j in range(4):
                clip[j] = views[view, j, 3]
                for k in range(3):
                    clip[j] += views[view, j, k] * points[i, k]
            _plane_of(own_faces[i], world[0], world[1], points[i], maps[2][view], plane)
            if clip[3] > 0.0 and plane[2] != 0.0:
                x, y, depth = clip[0] / clip[3], clip[1] / clip[3], clip[2] / clip[3]
                slopes = (-plane[0] / plane[2] * 2.0 / width, plane[1] / plane[2] * 2.0 / height)
                place = ((0.5 + 0.5 * x) * width, (0.5 - 0.5 * y) * height, depth, x, y)
                if math.isfinite(place[0] + place[1] + depth + slopes[0] + slopes[1]):
                    share = _lit_share(place, slopes, world, maps, view, radius, scratch)
        for k in range(3):
            out[i, k] = radiance[r, k] * share


def _dim(fragments: Fragments, picture: Picture, index: int, incident: Incident) -> None:
    shadow: ShadowMap | None = picture.value("shadow maps", index)
    if shadow is None or not picture.plan.has("shadows", fragments.target):
        return
    light: PlacedLight = picture.value("lights", index)
    world = picture.world
    radiance = np.empty((len(fragments), 3), np.float32)
    _dim_kernel(
        fragments.positions, fragments.normals,
        fragments.drawn_faces + np.int32(world.starts[fragments.target]),
        (world.positions, world.faces), shadow.views,
        (shadow.depths, shadow.face_ids, shadow.inverses, light.kind != "directional"),
        light.position, shadow.radius, incident.directions, incident.radiance, radiance,
    )  # fmt: skip
    incident.radiance = radiance


def _shadows_called_for(question: Question) -> Iterator[Call]:
    for index, light in enumerate(question.scene.lighting.lights):
        found = _pairs(question, index) if light.shadow is not None else "it casts none"
        if not isinstance(found, str):
            for receiver in sorted({receiver for _, receiver in found}):
                why = f'shadows of light "{light.name}" may fall on it'
                yield Call(receiver, question.name(receiver), why)


SHADOW_MAPS = Effect(
    name="shadow maps",
    does="finds what lights see first",
    of="light",
    called_for=_called_for,
    left_out="no light casts shadows",
    needs=lambda question, target: ("lights",),
    unneeded=_unneeded,
    prepare=_prepare,
    dim=_dim,
)

# How maps are looked up is what `dim` does; what it needs is of the objects that receive.
SHADOWS = Effect(
    name="shadows",
    does="tells what lies in shadow",
    called_for=_shadows_called_for,
    left_out="no shadow falls on anything in the picture",
    needs=lambda question, target: ("positions",),
)
