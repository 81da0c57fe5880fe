"""Light on what the samples see: a normal map through the tangents, and a fixed studio rig.

Tangent and normal are interpolated over the triangle without renormalizing, the bitangent is
w cross(N, T), and the shading normal is x T + y B + z N of the map's (x, y, z), normalized once, at
the end: exactly what the bake inverts.

The rig hangs on the camera: a key light, a weaker fill from the other side, a rim light from
behind, and a hemisphere of ambient light. Surfaces reflect after Lambert, with a soft highlight.
All light is linear.

Based on: Mikkelsen, "Simulation of wrinkled surfaces revisited", 2008, for the tangent frame;
Blinn, "Models of light reflection for computer synthesized pictures", SIGGRAPH 1977, for the
highlight.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.kernels import kernel
from texbake.mesh.mesh import FloatArray
from texbake.parallel import run_bands
from texbake.render.camera import Camera
from texbake.render.surface import FloatImage, Surface, read_only, wrap_of
from texbake.render.visibility import Visibility
from texbake.texture.lookup import CLAMP, REPEAT, bilinear

# Lights: direction to the light as (right, up, back) of the camera, and radiance times pi.
_LIGHTS = (
    ((-0.65, 0.70, 0.40), (1.00, 0.97, 0.92)),
    ((0.80, 0.10, 0.45), (0.22, 0.25, 0.30)),
    ((0.35, 0.55, -0.80), (0.45, 0.47, 0.50)),
)
_SKY = (0.16, 0.17, 0.19)
_GROUND = (0.06, 0.055, 0.05)
# The highlight: its share of the light head on, and how narrow it is.
_GLOSS = 0.16
_SHININESS = 24.0

# Kinds of normal map for the kernel.
_NO_MAP, _TANGENT_MAP, _OBJECT_MAP = 0, 1, 2

# Rows of samples a band.
_BAND = 16


@dataclass(frozen=True, eq=False)
class Shading:
    """What the samples look like.

    Attributes
    ----------
    color : (h, w, 3) float32
        Linear light; 0 where there is no triangle.
    normals : (h, w, 3) float32
        Unit shading normals in world space, on the side that is seen; 0 where there is no triangle.
    """

    color: FloatImage
    normals: FloatImage


@kernel
def _mean(values, corners, face, weight1, weight2, out):  # type: ignore[no-untyped-def]
    """Values of a face's corners, weighted."""
    for k in range(out.shape[0]):
        out[k] = (
            (1.0 - weight1 - weight2) * values[corners[face, 0], k]
            + weight1 * values[corners[face, 1], k]
            + weight2 * values[corners[face, 2], k]
        )


@kernel
def _bend(normal, tangents, weight1, weight2, texel):  # type: ignore[no-untyped-def]
    """Replace `normal` by x T + y B + z N; `tangents` are the (3, 4) of the face."""
    weight0 = 1.0 - weight1 - weight2
    tx = weight0 * tangents[0, 0] + weight1 * tangents[1, 0] + weight2 * tangents[2, 0]
    ty = weight0 * tangents[0, 1] + weight1 * tangents[1, 1] + weight2 * tangents[2, 1]
    tz = weight0 * tangents[0, 2] + weight1 * tangents[1, 2] + weight2 * tangents[2, 2]
    nx, ny, nz = normal[0], normal[1], normal[2]
    y = texel[1] * tangents[0, 3]
    normal[0] = texel[0] * tx + y * (ny * tz - nz * ty) + texel[2] * nx
    normal[1] = texel[0] * ty + y * (nz * tx - nx * tz) + texel[2] * ny
    normal[2] = texel[0] * tz + y * (nx * ty - ny * tx) + texel[2] * nz


@kernel
def _light(normal, to_eye, lights, base, out):  # type: ignore[no-untyped-def]
    """Light that leaves a surface of color `base` toward the eye.

    Row 0 of `lights` is up in the picture and the sky's light, row 1 the ground's; each other row
    is the direction to a light and its color.
    """
    facing_up = 0.5
    for k in range(3):
        facing_up += 0.5 * normal[k] * lights[0, k]
    for k in range(3):
        out[k] = base[k] * (facing_up * lights[0, 3 + k] + (1.0 - facing_up) * lights[1, 3 + k])
    for i in range(2, lights.shape[0]):
        incidence, halfway, squared = 0.0, 0.0, 0.0
        for k in range(3):
            half = lights[i, k] + to_eye[k]
            incidence += normal[k] * lights[i, k]
            halfway += normal[k] * half
            squared += half * half
        if incidence <= 0.0:
            continue
        highlight = 0.0
        if halfway > 0.0:
            # Fades in with the light itself, so that it has no edge at the shadow's border.
            highlight = _GLOSS * incidence * (halfway / math.sqrt(squared)) ** _SHININESS
        for k in range(3):
            out[k] += lights[i, 3 + k] * (base[k] * incidence + highlight)


@kernel
def _shade_kernel(  # type: ignore[no-untyped-def]
    face_ids,
    weights,
    back_facing,
    normals,
    normal_faces,
    uvs,
    uv_faces,
    wrap,
    map_kind,
    normal_map,
    tangents,
    has_albedo,
    albedo,
    base_color,
    rays,
    lights,
    color_out,
    normal_out,
    start,
    stop,
):
    normal, to_eye, uv = np.empty(3), np.empty(3), np.empty(2)
    texel = np.empty(normal_map.shape[2], np.float32)
    base = base_color.copy()
    for row in range(start, stop):
        for column in range(face_ids.shape[1]):
            face = face_ids[row, column]
            if face < 0:
                continue
            weight1 = np.float64(weights[row, column, 0])
            weight2 = np.float64(weights[row, column, 1])
            if map_kind != _NO_MAP or has_albedo:
                _mean(uvs, uv_faces, face, weight1, weight2, uv)
            if map_kind != _OBJECT_MAP:
                _mean(normals, normal_faces, face, weight1, weight2, normal)
            if map_kind != _NO_MAP:
                bilinear(normal_map, uv[0], uv[1], wrap, texel)
            if map_kind == _TANGENT_MAP:
                _bend(normal, tangents[face], weight1, weight2, texel)
            elif map_kind == _OBJECT_MAP:
                for k in range(3):
                    normal[k] = texel[k]
            if has_albedo:
                bilinear(albedo, uv[0], uv[1], wrap, base)
            ray_squared, normal_squared = 0.0, 0.0
            for k in range(3):
                to_eye[k] = -(rays[0, k] + (column + 0.5) * rays[1, k] + (row + 0.5) * rays[2, k])
                ray_squared += to_eye[k] * to_eye[k]
                normal_squared += normal[k] * normal[k]
            side = -1.0 if back_facing[row, column] else 1.0
            for k in range(3):
                to_eye[k] /= math.sqrt(ray_squared)
                if 0.0 < normal_squared < np.inf:
                    normal[k] *= side / math.sqrt(normal_squared)
                else:
                    # No normal at all, as on a face without area: as though it faced the camera.
                    normal[k] = to_eye[k]
                normal_out[row, column, k] = normal[k]
            _light(normal, to_eye, lights, base, color_out[row, column])


def shade(
    visibility: Visibility, surface: Surface, camera: Camera, *, threads: int | None = None
) -> Shading:
    """Shade each sample that sees a triangle.

    Parameters
    ----------
    visibility
        What the samples see.
    surface
        Of the triangles seen.
    camera
        The one that `visibility` was made with; the lights hang on it.
    threads
        None for every processor.

    Returns
    -------
    Shading
        Maps repeat or go on with their border as `texbake.render.surface.wrap_of` says.
    """
    height, width = visibility.face_ids.shape
    map_kind = _NO_MAP
    if surface.normal_map is not None:
        map_kind = _OBJECT_MAP if surface.tangents is None else _TANGENT_MAP
    lights = _rig(camera)
    rays = camera.view_rays(width, height)
    color = np.zeros((height, width, 3), np.float32)
    normals = np.zeros((height, width, 3), np.float32)
    arrays = (
        _or_empty(surface.normals, np.float64, 3),
        _or_empty(surface.normal_faces, np.int32, 3),
        _or_empty(surface.uvs, np.float64, 2),
        _or_empty(surface.uv_faces, np.int32, 3),
        REPEAT if wrap_of(surface.uvs) == "repeat" else CLAMP,
        map_kind,
        _or_empty(surface.normal_map, np.float32, 1, 3),
        _or_empty(surface.tangents, np.float32, 3, 4),
        surface.albedo is not None,
        _or_empty(surface.albedo, np.float32, 1, 3),
        np.array(surface.base_color, np.float32),
    )

    def work(start: int, stop: int) -> None:
        _shade_kernel(
            visibility.face_ids, visibility.barycentrics, visibility.back_facing,
            *arrays, rays, lights, color, normals, start, stop,
        )  # fmt: skip

    run_bands(work, height, band=_BAND, threads=threads)
    return Shading(color, normals)


def _or_empty(array: npt.NDArray[Any] | None, dtype: type, *row: int) -> npt.NDArray[Any]:
    return read_only(np.zeros((0, *row), dtype) if array is None else array, dtype)


def _rig(camera: Camera) -> FloatArray:
    """(2 + lights, 6) float64: what `_light` takes, in world space."""
    rows = [[*camera.axes[1], *_SKY], [*camera.axes[1], *_GROUND]]
    for direction, color in _LIGHTS:
        toward = np.array(direction) @ camera.axes
        rows.append([*(toward / np.linalg.norm(toward)), *color])
    return np.array(rows)
