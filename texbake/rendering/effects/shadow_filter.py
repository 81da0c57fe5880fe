"""Looking up a shadow map: the share of a point's surroundings that a light reaches.

A point gets the share, by area, of a square of texels about it in which nothing lies between the
light and the point's surface (percentage-closer filtering). Whether something does is decided
without a constant that would have to be tuned. A point's depth holds at the point alone; over the
filter's footprint the surface gets nearer and farther with its slope. So

1. the plane of the point's triangle is continued to the center of the texel, and only what lies
   before that plane, by more than rounding, can shade;
2. the plane of the triangle seen there is continued back to the point, and it must lie before that
   too. Of two surfaces that meet between the point and the texel one passes neither test: at a
   ridge the first leaves it out, in a groove the second. Nothing meets the point's surface, though,
   where no texel about it sees that;
3. where the triangle is one of the point's own object, the surface may go up and down between the
   two, on triangles smaller than a texel, as steeply as the steeper of them does on either axis;
   only what is nearer than that cannot be the same piece of surface.

In clip space depth z/w is linear in x/w and y/w on any plane, so all that is a multiplication by
the slope, which comes from the plane and not from differences of neighbors. The only other bias is
what rounding leaves: a corner is moved by at most half a step of the rasterizer's grid on either
axis, which the slope turns into depth, and depth is kept in float32.

Based on: Reeves, Salesin, Cook, "Rendering antialiased shadows with depth maps", SIGGRAPH 1987, for
the filter, here over an exact square in place of random samples; Isidoro, "Shadow mapping:
GPU-based tips and techniques", GDC 2006, for the receiver's plane; Dou, Yan, Kerzner, Dai, Wyman,
"Adaptive depth bias for shadow maps", I3D 2014, for the center of the texel as the place where
planes are compared. The second and third test are our own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.kernels import kernel
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.rendering.effects.lights import PlacedLight
from texbake.rendering.fragments import Floats, Incident, row_of
from texbake.rendering.raster.clip import SUBPIXELS
from texbake.rendering.raster.world import World

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
def _lit_share(place, slopes, own, world, maps, view, radius, scratch):  # type: ignore[no-untyped-def]
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
    lit, meeting, dark = 0.0, 0.0, 0.0
    last_face, there, right, down = -1, np.inf, 0.0, 0.0
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
                # Seen edge-on its plane tells nothing, and the first test has decided.
                there, right, down = np.inf, 0.0, 0.0
                if scratch[2] != 0.0:
                    there = -(scratch[0] * x + scratch[1] * y + scratch[3]) / scratch[2]
                    right = abs(scratch[0] / scratch[2]) * 2.0 / width
                    down = abs(scratch[1] / scratch[2]) * 2.0 / height
            least = depth + _ROUNDED * max(abs(depth), seen)
            shades = there > least
            is_own = own[0] <= face < own[1]
            if shades and is_own:
                rise = abs(i + 0.5 - column) * max(right, abs(slopes[0]))
                rise += abs(j + 0.5 - row) * max(down, abs(slopes[1]))
                shades = seen > least + rise
            if shades:
                dark += area
            elif is_own:
                lit += area
            else:
                meeting += area
    # Nothing meets the point's surface where none of that is seen.
    if lit == 0.0:
        return 0.0 if dark + meeting > 0.0 else 1.0
    return (lit + meeting) / (lit + meeting + dark)


@kernel
def _dim_kernel(  # type: ignore[no-untyped-def]
    points, normals, own_faces, own, world, views, maps, light, radius, directions, radiance, out
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
                    share = _lit_share(place, slopes, own, world, maps, view, radius, scratch)
        for k in range(3):
            out[i, k] = radiance[r, k] * share


def lit_radiance(
    shadow: ShadowMap,
    light: PlacedLight,
    world: World,
    points: FloatArray,
    normals: Floats,
    faces: IntArray,
    incident: Incident,
    *,
    own: tuple[int, int],
) -> Floats:
    """(n, 3) float32: the light of one lamp that reaches points past what casts shadows.

    Parameters
    ----------
    shadow, light, world
        The map of a light, and what it was made of.
    points, normals : (n, 3)
        Of the surface, which light falls on where its normal faces the light.
    faces : (n,) int32
        Triangle of the world that each point lies on.
    incident
        What would arrive without shadows.
    own
        First face of the object that all these points belong to, and the first after it.
    """
    out = np.empty((len(points), 3), np.float32)
    _dim_kernel(
        points, normals, faces, own, (world.positions, world.faces), shadow.views,
        (shadow.depths, shadow.face_ids, shadow.inverses, light.kind != "directional"),
        light.position, shadow.radius, incident.directions, incident.radiance, out,
    )  # fmt: skip
    return out
