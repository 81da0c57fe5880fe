"""A ray's hit becomes a normal: the dense mesh's shading normal, in the light mesh's tangent space.

Based on: Mikkelsen, "Simulation of Wrinkled Surfaces Revisited", 2008: a renderer computes
x T + y B + z N from tangent and normal as they are interpolated, without renormalizing, with
B = w cross(N, T). So the three are inverted as they stand, exactly, and only then normalized.
"""

from __future__ import annotations

import numpy as np

from texbake.baking.hits import Hits
from texbake.baking.inputs import BakeInputs
from texbake.baking.maps.kind import Float32Array, MapKind
from texbake.baking.options import BakeOptions
from texbake.kernels import kernel
from texbake.parallel import run_bands

_BAND = 1 << 15


def normal_values(hits: Hits, inputs: BakeInputs) -> Float32Array:
    """Unit normal of the dense mesh at each hit, in the space that the options ask for.

    Where the light mesh's frame is singular (a zero normal) the value is flat, (0, 0, 1).
    """
    values = np.empty((len(hits), 3), dtype=np.float32)
    normals, corners = inputs.high_normals

    def work(start: int, stop: int) -> None:
        band = slice(start, stop)
        _high_normals_kernel(
            hits.high_faces[band], hits.high_barycentrics[band], normals, corners, values[band]
        )

    run_bands(work, len(hits), band=_BAND, threads=inputs.options.threads)
    if inputs.options.space == "tangent":
        to_tangent_space(hits, inputs, values, normalize=True)
    return values


def to_tangent_space(
    hits: Hits, inputs: BakeInputs, values: Float32Array, *, normalize: bool
) -> None:
    """Express model-space vectors (n, 3) in the tangent space of their samples, in place."""
    normals, corners = inputs.low_normals
    tangents = inputs.low_tangents

    def work(start: int, stop: int) -> None:
        band = slice(start, stop)
        faces, barycentrics = hits.low_faces[band], hits.low_barycentrics[band]
        _tangent_space_kernel(
            faces, barycentrics, normals, corners, tangents, normalize, values[band]
        )

    run_bands(work, len(hits), band=_BAND, threads=inputs.options.threads)


def _neutral(options: BakeOptions) -> tuple[float, ...]:
    return (0.0, 0.0, 1.0) if options.space == "tangent" else (0.0, 0.0, 0.0)


NORMAL = MapKind("normal", 3, "normal", normal_values, _neutral, combine="unit mean")


@kernel
def _high_normals_kernel(faces, barycentrics, normals, corners, values):  # type: ignore[no-untyped-def]
    for i in range(len(faces)):
        b, c = float(barycentrics[i, 0]), float(barycentrics[i, 1])
        p, q, r = corners[faces[i]]
        x = (1.0 - b - c) * normals[p, 0] + b * normals[q, 0] + c * normals[r, 0]
        y = (1.0 - b - c) * normals[p, 1] + b * normals[q, 1] + c * normals[r, 1]
        z = (1.0 - b - c) * normals[p, 2] + b * normals[q, 2] + c * normals[r, 2]
        length = np.sqrt(x * x + y * y + z * z)
        if length == 0.0:
            length = 1.0
        values[i, 0] = x / length
        values[i, 1] = y / length
        values[i, 2] = z / length


@kernel
def _tangent_space_kernel(faces, barycentrics, normals, corners, tangents, normalize, values):  # type: ignore[no-untyped-def]
    for i in range(len(faces)):
        face = faces[i]
        b, c = float(barycentrics[i, 0]), float(barycentrics[i, 1])
        a = 1.0 - b - c
        p, q, r = corners[face]
        nx = a * normals[p, 0] + b * normals[q, 0] + c * normals[r, 0]
        ny = a * normals[p, 1] + b * normals[q, 1] + c * normals[r, 1]
        nz = a * normals[p, 2] + b * normals[q, 2] + c * normals[r, 2]
        tx = a * tangents[face, 0, 0] + b * tangents[face, 1, 0] + c * tangents[face, 2, 0]
        ty = a * tangents[face, 0, 1] + b * tangents[face, 1, 1] + c * tangents[face, 2, 1]
        tz = a * tangents[face, 0, 2] + b * tangents[face, 1, 2] + c * tangents[face, 2, 2]
        sign = float(tangents[face, 0, 3])
        bx, by, bz = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx
        bx, by, bz = sign * bx, sign * by, sign * bz
        # rows of the inverse, times the determinant: B x N, N x T, T x B
        determinant = (by * nz - bz * ny) * tx + (bz * nx - bx * nz) * ty + (bx * ny - by * nx) * tz
        if determinant == 0.0:
            values[i, 0], values[i, 1], values[i, 2] = 0.0, 0.0, 1.0 if normalize else 0.0
            continue
        vx, vy, vz = float(values[i, 0]), float(values[i, 1]), float(values[i, 2])
        x = (by * nz - bz * ny) * vx + (bz * nx - bx * nz) * vy + (bx * ny - by * nx) * vz
        y = (ny * tz - nz * ty) * vx + (nz * tx - nx * tz) * vy + (nx * ty - ny * tx) * vz
        z = (ty * bz - tz * by) * vx + (tz * bx - tx * bz) * vy + (tx * by - ty * bx) * vz
        length = np.sqrt(x * x + y * y + z * z) if normalize else abs(determinant)
        if length == 0.0:
            length = 1.0
        length = length if determinant > 0.0 else -length
        values[i, 0] = x / length
        values[i, 1] = y / length
        values[i, 2] = z / length
