"""Mean curvature of a surface at its vertices.

The smooth normals are interpolated linearly over each face; the divergence of that field is twice
the mean curvature of the surface that they describe. A vertex has the mean over the faces around
it, weighted by area, which cancels the areas that the divergence divides by: thin faces do no harm.
On a sphere whose normals point along its radii it is exactly one over the radius.

Based on: Rusinkiewicz, "Estimating Curvatures and Their Derivatives on Triangle Meshes", 2004,
which takes the curvature of a face from the differences of its vertices' normals. Departs from it
in looking for the trace of the curvature alone, which has a closed form.
"""

from __future__ import annotations

import math

import numpy as np

from texbake.kernels import kernel
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import FloatArray, Mesh, frozen
from texbake.mesh.normals import smooth_normals
from texbake.mesh.weld import weld_rows


def vertex_curvatures(
    mesh: Mesh, *, normals: FloatArray | None = None, threads: int | None = None
) -> FloatArray:
    """Mean curvature at each vertex, in units of one over the model unit.

    Parameters
    ----------
    mesh : Mesh
    normals : (V, 3) float64, optional
        Its `smooth_normals`, where they are known.
    threads
        None for every processor.

    Returns
    -------
    (V,) float64
        Positive where the surface is convex, negative where it is hollow; half the sum of the
        curvatures along and across, so 1 / r on a sphere, 1 / (2 r) on a cylinder. Equal for
        vertices at one position. 0 for a vertex that no face with area uses.

    Examples
    --------
    >>> from texbake.mesh.shapes import plane
    >>> vertex_curvatures(plane(3, 3)).max()
    np.float64(0.0)
    """
    if normals is None:
        normals = smooth_normals(mesh, threads=threads)
    firsts = weld_rows(mesh.positions, threads=threads)
    frame = LocalFrame.around(mesh)
    turns, areas = np.zeros(mesh.n_vertices), np.zeros(mesh.n_vertices)
    _turns_kernel(
        frozen(frame.to_local(mesh.positions)), mesh.faces, frozen(firsts), frozen(normals),
        turns, areas,
    )  # fmt: skip
    areas[areas == 0.0] = 1.0
    return np.asarray((turns / areas)[firsts] * frame.scale)


@kernel
def _turns_kernel(points, faces, firsts, normals, turns, areas):  # type: ignore[no-untyped-def]
    """Add the mean curvature of each face times its area, and its area, to its vertices."""
    for face in range(len(faces)):
        a, b, c = faces[face]
        abx, acx = points[b, 0] - points[a, 0], points[c, 0] - points[a, 0]
        aby, acy = points[b, 1] - points[a, 1], points[c, 1] - points[a, 1]
        abz, acz = points[b, 2] - points[a, 2], points[c, 2] - points[a, 2]
        x, y, z = aby * acz - abz * acy, abz * acx - abx * acz, abx * acy - aby * acx
        length = math.sqrt(x * x + y * y + z * z)
        if length == 0.0:
            continue
        x, y, z = x / length, y / length, z / length
        # A corner's weight falls off across the face along normal x opposite edge / (2 area).
        turn = (
            _crossed_dot(x, y, z, acx - abx, acy - aby, acz - abz, normals[a])
            + _crossed_dot(x, y, z, -acx, -acy, -acz, normals[b])
            + _crossed_dot(x, y, z, abx, aby, abz, normals[c])
        ) / 4.0
        for vertex in (a, b, c):
            turns[firsts[vertex]] += turn
            areas[firsts[vertex]] += length / 2.0


@kernel
def _crossed_dot(x, y, z, ex, ey, ez, normal):  # type: ignore[no-untyped-def]
    """Scalar triple product of a face's normal, an edge and a vertex's normal."""
    return (
        (y * ez - z * ey) * normal[0]
        + (z * ex - x * ez) * normal[1]
        + (x * ey - y * ex) * normal[2]
    )
