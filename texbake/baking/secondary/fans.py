"""Where a hit becomes a fan of rays: a point of the dense surface, an axis, and a plane below it.

Directions are spread over the hemisphere of the shading normal, the axis. Those that would go below
the plane of the face that was hit are mirrored at it. So no ray dives into the face it starts on,
and a convex surface is open all around however few faces it has.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from texbake.baking.hits import Hits
from texbake.kernels import kernel
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import IntArray, Mesh
from texbake.parallel import run_bands
from texbake.raycast.fans import Fans, mixed

_BAND = 1 << 15
_UNIT_ROUNDOFF = 2.0**-24  # of float32, relative


def fans_of(
    hits: Hits,
    high: Mesh,
    normals: tuple[npt.NDArray[np.float32], IntArray],
    frame: LocalFrame,
    *,
    threads: int | None = None,
) -> Fans:
    """Fans of hits, none of which is a miss.

    Parameters
    ----------
    normals
        Shading normals of the dense mesh and the index of each corner's.
    """
    n = len(hits)
    fans = Fans(
        np.empty((n, 3)),
        np.empty((n, 3), dtype=np.float32),
        np.empty((n, 3), dtype=np.float32),
        np.empty(n, dtype=np.uint32),
    )

    def fill(start: int, stop: int) -> None:
        band = slice(start, stop)
        # The sample itself, and not its place in any order, decides what directions it gets.
        weights = hits.low_barycentrics[band].view(np.uint32)
        faces = hits.low_faces[band].view(np.uint32)
        fans.set_ids[band] = mixed(mixed(mixed(faces) ^ weights[:, 0]) ^ weights[:, 1])
        _fans_kernel(
            (hits.high_faces[band], hits.high_barycentrics[band]),
            (high.positions, high.faces, frame.center, frame.scale),
            normals,
            (fans.points[band], fans.axes[band], fans.planes[band]),
        )

    run_bands(fill, n, band=_BAND, threads=threads)
    return fans


def start_offset(high: Mesh, frame: LocalFrame) -> float:
    """How far above the surface a ray starts, so that rounding cannot let it meet its own face.

    In local units, at most 8e-7. Rounding a vertex, and the ray's start, to float32 moves each by
    half a unit in the last place of 0.5 along each axis, and so by the square root of 3 times that
    along a normal. Embree then computes how far a face lies from the start from its corners seen
    from there, in some 7 operations that each round relative to the face's size.

    Based on: Pharr, Jakob, Humphreys, "Physically Based Rendering", 4th edition, 2023, section 6.8,
    for the bound of a chain of rounded operations.
    """
    corners = [frame.to_local(high.positions[high.faces[:, k]]) for k in range(3)]
    longest = max(float(np.square(corners[k] - corners[k - 1]).sum(axis=1).max()) for k in range(3))
    chain = 7.0 * _UNIT_ROUNDOFF / (1.0 - 7.0 * _UNIT_ROUNDOFF)
    return float(np.sqrt(3.0) * 2.0 * 0.25 * _UNIT_ROUNDOFF + chain * np.sqrt(longest))


@kernel
def _fans_kernel(hits, triangles, normals, fans):  # type: ignore[no-untyped-def]
    faces, barycentrics = hits
    positions, corners, center, scale = triangles
    vectors, vector_corners = normals
    points, axes, planes = fans
    axis, plane = np.empty(3), np.empty(3)
    for i in range(len(faces)):
        b, c = float(barycentrics[i, 0]), float(barycentrics[i, 1])
        a = 1.0 - b - c
        p, q, r = corners[faces[i]]
        k, m, n = vector_corners[faces[i]]
        for x in range(3):
            y, z = (x + 1) % 3, (x + 2) % 3
            point = a * positions[p, x] + b * positions[q, x] + c * positions[r, x]
            points[i, x] = (point - center[x]) * scale
            axis[x] = a * vectors[k, x] + b * vectors[m, x] + c * vectors[n, x]
            plane[x] = ((positions[q, y] - positions[p, y]) * scale) * (
                (positions[r, z] - positions[p, z]) * scale
            ) - ((positions[q, z] - positions[p, z]) * scale) * (
                (positions[r, y] - positions[p, y]) * scale
            )
        to_axis, to_plane = _inverse_length(axis), _inverse_length(plane)
        if axis[0] * plane[0] + axis[1] * plane[1] + axis[2] * plane[2] < 0.0:
            to_plane = -to_plane
        for x in range(3):
            axes[i, x] = axis[x] * to_axis
            planes[i, x] = plane[x] * to_plane if to_plane != 0.0 else axes[i, x]


@kernel
def _inverse_length(vector):  # type: ignore[no-untyped-def]
    """One over the length of a vector, 0 for a zero vector."""
    square = vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2]
    return 1.0 / np.sqrt(square) if square > 0.0 else 0.0
