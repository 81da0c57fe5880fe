"""Normals of faces and vertices.

Based on: Thürmer, Wüthrich, "Computing Vertex Normals from Polygonal Facets", Journal of Graphics
Tools 3(1), 1998: a vertex normal is the sum of the unit normals of its faces, each weighted by the
angle that the face has at the vertex, so that it does not depend on the triangulation.

Everything here is relative to the size of what is measured: scaling a mesh by a power of two gives
the same bits.
"""

from __future__ import annotations

import math

import numpy as np

from texbake.kernels import kernel
from texbake.mesh.frame import unit_scale
from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.mesh.weld import weld_rows
from texbake.parallel import resolve_threads, run_bands

# A cross product shorter than this times the square of the longest edge is rounding, not area:
# subtracting, multiplying and subtracting again leave up to 4 units of 2^-53 an edge.
AREA_ROUNDING = 8.0 * 2.0**-53

# In radians. A sum of weighted normals below it is what rounding leaves of normals that cancel.
_CANCELED = 1e-12


def face_normals(mesh: Mesh, *, threads: int | None = None) -> FloatArray:
    """Unit normal of each face, on the side from which it is seen counter-clockwise.

    Returns
    -------
    (F, 3) float64
        (0, 0, 0) for a face without area: corners on one line, to within float64 rounding of the
        longest edge, whatever the scale.

    Examples
    --------
    >>> face_normals(Mesh(positions=[[0, 0, 0], [1, 0, 0], [0, 1, 0]], faces=[[0, 1, 2]]))
    array([[0., 0., 1.]])
    """
    normals = np.empty((mesh.n_faces, 3))
    scale = _position_scale(mesh.positions)

    def work(start: int, stop: int) -> None:
        _face_normals_kernel(mesh.positions, mesh.faces, scale, start, stop, normals)

    run_bands(work, mesh.n_faces, band=1 << 17, threads=threads)
    return normals


def vertex_normals(mesh: Mesh, *, threads: int | None = None) -> FloatArray:
    """Angle-weighted unit normal of each vertex, over the faces that use it by its index.

    Vertices that a file split at a seam keep apart here; see `smooth_normals`.

    Returns
    -------
    (V, 3) float64
        Where the weighted normals cancel (two faces back to back), the normal of the first face
        with area; (0, 0, 0) for a vertex that no face with area uses.
    """
    return _angle_weighted(mesh.positions, mesh.faces, threads)


def smooth_normals(mesh: Mesh, *, threads: int | None = None) -> FloatArray:
    """Angle-weighted unit normal of each position, shared by all vertices that lie there.

    What moves along these normals cannot tear: vertices at bit-equal positions (0.0 and -0.0 are
    equal) get bit-equal normals, whatever seams and hard edges the file has.

    Returns
    -------
    (V, 3) float64
        As `vertex_normals` for special cases.
    """
    firsts = weld_rows(mesh.positions, threads=threads)
    if np.array_equal(firsts, np.arange(len(firsts), dtype=np.int32)):
        return _angle_weighted(mesh.positions, mesh.faces, threads)
    faces = firsts[mesh.faces]
    faces.flags.writeable = False  # numba types read-only arrays by themselves; one is enough
    return _angle_weighted(mesh.positions, faces, threads)[firsts]


def shading_normals(mesh: Mesh, *, threads: int | None = None) -> tuple[FloatArray, IntArray]:
    """Normals that the mesh is shaded with: its own, else `smooth_normals`.

    Smooth ones go by position, because formats that index all attributes together (glTF, PLY)
    split vertices at seams of the texture, which must not crease. A zero vector among a mesh's own
    normals is replaced, corner by corner, with the smooth normal of the corner's vertex.

    Returns
    -------
    normals : (N, 3) float64
        Unit, or zero where the smooth normal is.
    normal_faces : (F, 3) int32
        Index into `normals` of each corner.
    """
    if mesh.normals is None or mesh.normal_faces is None:
        return smooth_normals(mesh, threads=threads), mesh.faces
    missing = (mesh.normals == 0.0).all(axis=1)
    if not missing.any():
        return mesh.normals, mesh.normal_faces
    without = missing[mesh.normal_faces]
    vertices, added = np.unique(mesh.faces[without], return_inverse=True)
    normal_faces = mesh.normal_faces.copy()
    normal_faces[without] = len(mesh.normals) + added
    added_normals = smooth_normals(mesh, threads=threads)[vertices]
    return np.concatenate([mesh.normals, added_normals]), normal_faces


def flat_normals(mesh: Mesh, *, threads: int | None = None) -> tuple[FloatArray, IntArray]:
    """Normals that shade each face flat, in the form of `shading_normals`.

    Returns
    -------
    normals : (F, 3) float64
        As `face_normals`.
    normal_faces : (F, 3) int32
        The face's own index at each of its corners.
    """
    face_ids = np.arange(mesh.n_faces, dtype=np.int32)
    return face_normals(mesh, threads=threads), np.repeat(face_ids[:, None], 3, axis=1)


def _angle_weighted(positions: FloatArray, faces: IntArray, threads: int | None) -> FloatArray:
    """Sum over faces in their order, in bands of vertices.

    Each band walks all faces and adds to its own vertices only: the order of a vertex's terms, and
    so every bit of their sum, is the order of the faces however many bands there are.
    """
    normals = np.zeros((len(positions), 3))
    scale = _position_scale(positions)
    n_bands = resolve_threads(threads) if len(faces) > 1 << 14 else 1
    band = -(-len(positions) // n_bands)

    def work(start: int, stop: int) -> None:
        _vertex_normals_kernel(positions, faces, scale, start, stop, normals)

    run_bands(work, len(positions), band=band, threads=threads)
    _mend_canceled(normals, positions, faces)
    return normals


def _mend_canceled(normals: FloatArray, positions: FloatArray, faces: IntArray) -> None:
    """Give zero normals, in place, the normal of their vertex's first face with area."""
    zero = (normals == 0.0).all(axis=1)
    if not zero.any():
        return
    touched = faces[zero[faces].any(axis=1)]
    if len(touched) == 0:
        return
    of_faces = face_normals(Mesh(positions=positions, faces=touched), threads=1)
    with_area = (of_faces != 0.0).any(axis=1)
    touched, of_faces = touched[with_area], of_faces[with_area]
    vertices, firsts = np.unique(touched, return_index=True)
    chosen = zero[vertices]
    normals[vertices[chosen]] = of_faces[firsts[chosen] // 3]


def _position_scale(positions: FloatArray) -> float:
    """Power of two that brings the largest coordinate near 1, so that no product overflows."""
    return unit_scale(max(float(positions.max()), -float(positions.min())))


@kernel
def _scaled_edge(positions, scale, tail, head):  # type: ignore[no-untyped-def]
    return (
        positions[head, 0] * scale - positions[tail, 0] * scale,
        positions[head, 1] * scale - positions[tail, 1] * scale,
        positions[head, 2] * scale - positions[tail, 2] * scale,
    )


@kernel
def _dot(a, b):  # type: ignore[no-untyped-def]
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def _area_vector(ab, ac):  # type: ignore[no-untyped-def]
    """Cross product of two edges and its length; the length is 0 where it is only rounding."""
    cross = (
        ab[1] * ac[2] - ab[2] * ac[1],
        ab[2] * ac[0] - ab[0] * ac[2],
        ab[0] * ac[1] - ab[1] * ac[0],
    )
    length = math.sqrt(_dot(cross, cross))
    bc = (ac[0] - ab[0], ac[1] - ab[1], ac[2] - ab[2])
    longest_squared = max(_dot(ab, ab), _dot(ac, ac), _dot(bc, bc))
    if length <= AREA_ROUNDING * longest_squared:
        length = 0.0
    return cross, length


@kernel
def _face_normals_kernel(positions, faces, scale, start, stop, normals):  # type: ignore[no-untyped-def]
    for face in range(start, stop):
        ab = _scaled_edge(positions, scale, faces[face, 0], faces[face, 1])
        ac = _scaled_edge(positions, scale, faces[face, 0], faces[face, 2])
        cross, length = _area_vector(ab, ac)
        for axis in range(3):
            normals[face, axis] = cross[axis] / length if length > 0.0 else 0.0


@kernel
def _vertex_normals_kernel(positions, faces, scale, start, stop, normals):  # type: ignore[no-untyped-def]
    """Add every face to those of its corners that lie in start to stop - 1; then normalize them."""
    for face in range(len(faces)):
        a, b, c = faces[face, 0], faces[face, 1], faces[face, 2]
        owns_a, owns_b, owns_c = start <= a < stop, start <= b < stop, start <= c < stop
        if not (owns_a or owns_b or owns_c):
            continue
        ab = _scaled_edge(positions, scale, a, b)
        ac = _scaled_edge(positions, scale, a, c)
        cross, length = _area_vector(ab, ac)
        if length == 0.0:
            continue
        bc = (ac[0] - ab[0], ac[1] - ab[1], ac[2] - ab[2])
        angle_a = math.atan2(length, _dot(ab, ac))
        angle_b = math.atan2(length, -_dot(ab, bc))
        angle_c = max(math.pi - angle_a - angle_b, 0.0)
        for axis in range(3):
            unit = cross[axis] / length
            if owns_a:
                normals[a, axis] += angle_a * unit
            if owns_b:
                normals[b, axis] += angle_b * unit
            if owns_c:
                normals[c, axis] += angle_c * unit
    for vertex in range(start, stop):
        x, y, z = normals[vertex, 0], normals[vertex, 1], normals[vertex, 2]
        length = math.sqrt(x * x + y * y + z * z)
        for axis in range(3):
            normals[vertex, axis] = normals[vertex, axis] / length if length > _CANCELED else 0.0
