"""Normals of faces and vertices, and the mean curvature at vertices that follows from them.

A vertex normal is the sum of the unit normals of its faces, each weighted by the angle that the
face has at the vertex, so that it does not depend on the triangulation. Everything here is relative
to the size of what is measured: scaling a mesh by a power of two gives the same bits. Kernel, which
names the sources: `core/vertex_normals.c`.
"""

from __future__ import annotations

import math

import numpy as np

from texbake.core import core, portable_math as pm
from texbake.mesh.frame import LocalFrame, unit_scale
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.mesh import AnyArray, BoolArray, FloatArray, IntArray, Mesh
from texbake.mesh.objects import weld_vertices
from texbake.mesh.weld import unique_rows
from texbake.parallel import resolve_threads, run_bands

# A cross product shorter than this times the square of the longest edge is rounding, not area:
# subtracting, multiplying and subtracting again leave up to 4 units of 2^-53 an edge.
AREA_ROUNDING = 8.0 * 2.0**-53
# Normals with 8 bits per component are off by up to half a degree.
NORMAL_ROUNDING = math.radians(1.0)


def face_normals(mesh: Mesh, *, threads: int | None = None) -> FloatArray:
    """(F, 3) float64 unit normals, on the side from which a face is seen counter-clockwise."""
    normals = np.empty((mesh.n_faces, 3))
    # A vertex that no face uses may lie anywhere.
    scale = unit_scale(float(np.abs(mesh.bounds).max())) if mesh.n_faces else 1.0

    def work(start: int, stop: int) -> None:
        core.face_normals(mesh.positions, mesh.faces, scale, AREA_ROUNDING, start, stop, normals)

    run_bands(work, mesh.n_faces, band=1 << 17, threads=threads)
    return normals


def degenerate_faces(mesh: Mesh) -> BoolArray:
    """(F,) bool: faces without area."""
    return np.asarray((face_normals(mesh) == 0.0).all(axis=1))


def vertex_normals(mesh: Mesh, *, threads: int | None = None) -> FloatArray:
    """(V, 3) angle-weighted unit normals by index; the first face's where they cancel; else 0."""
    faces = mesh.faces
    return weighted_normals(mesh.positions, faces, faces, mesh.n_vertices, threads=threads)


def smooth_normals(mesh: Mesh, *, threads: int | None = None) -> FloatArray:
    """Angle-weighted unit normal of each position, shared by all vertices of an object there.

    An object that moves along these normals cannot tear: its vertices at bit-equal positions (0.0
    and -0.0 are equal) get bit-equal normals, whatever seams and hard edges the file has. Objects
    that touch have normals of their own; see `texbake.mesh.objects`.

    Returns (V, 3) float64: where faces cancel or have no area, as `vertex_normals`.
    """
    firsts = weld_vertices(mesh, threads=threads)
    if np.array_equal(firsts, np.arange(len(firsts), dtype=np.int32)):
        return vertex_normals(mesh, threads=threads)
    faces = firsts[mesh.faces]
    normals = weighted_normals(mesh.positions, faces, faces, mesh.n_vertices, threads=threads)
    return normals[firsts]


def shading_normals(mesh: Mesh, *, threads: int | None = None) -> tuple[FloatArray, IntArray]:
    """Normals that the mesh is shaded with: its own, else `smooth_normals`.

    Smooth ones go by position, because formats that index all attributes together (glTF, PLY)
    split vertices at seams of the texture, which must not crease. A zero vector among a mesh's own
    normals is replaced, corner by corner, with the smooth normal of the corner's vertex.

    Returns `normals` (N, 3) float64: unit, or zero where the smooth normal is; `normal_faces` (F,
    3) int32: index into `normals` of each corner.
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


def with_shading_normals(mesh: Mesh, *, threads: int | None = None) -> Mesh:
    """Return a mesh that has its `shading_normals` as its own, for files that maps belong to."""
    normals, normal_faces = shading_normals(mesh, threads=threads)
    return mesh.replace(normals=normals, normal_faces=normal_faces)


_STEPS = 100  # by which normals leave the backs of faces


def with_visible_normals(mesh: Mesh, *, threads: int | None = None) -> Mesh:
    """Return a mesh whose shading normals see the front of all of their faces, if possible."""
    normals, rows = shading_normals(mesh, threads=threads)
    sides, margin = face_normals(mesh, threads=threads), pm.sin(NORMAL_ROUNDING)
    turned = pm.vecdot(normals[rows], sides[:, np.newaxis]) < -margin
    if not turned.any():
        return mesh
    firsts = weld_vertices(mesh, threads=threads)
    if rows is not mesh.faces:  # distant corners may share a row
        used, numbers = unique_rows(np.stack([firsts[mesh.faces].ravel(), rows.ravel()], axis=1))
        normals, rows = normals[rows.ravel()[used]], numbers.reshape(-1, 3)
        firsts = np.arange(len(normals), dtype=np.int32)
    corner_rows = firsts[rows]
    is_turned = np.zeros(len(normals), np.bool_)
    is_turned[corner_rows[turned]] = True
    corners = np.flatnonzero(is_turned[corner_rows] & (sides != 0.0).any(axis=1)[:, np.newaxis])
    found, ids = np.unique(corner_rows.ravel()[corners], return_inverse=True)
    around, chosen, least = sides[corners // 3], normals[found], np.empty(len(found))
    for _ in range(_STEPS):
        cosines = pm.vecdot(around, chosen[ids])
        least.fill(np.inf)
        np.minimum.at(least, ids, cosines)
        worst = np.flatnonzero(cosines == least[ids])
        worst = worst[np.unique(ids[worst], return_index=True)[1]]
        chosen += around[worst] * np.maximum(margin - least, 0.0)[:, np.newaxis]
        chosen /= pm.norm(chosen, axis=1)[:, np.newaxis]
    least.fill(np.inf)
    np.minimum.at(least, ids, pm.vecdot(around, chosen[ids]))
    visible = least > 0.0
    normals = normals.copy()
    normals[found[visible]] = chosen[visible]
    return mesh.replace(normals=normals[firsts], normal_faces=rows, tangents=None)


def flat_normals(mesh: Mesh, *, threads: int | None = None) -> tuple[FloatArray, IntArray]:
    """(F, 3) float64 `face_normals`, and (F, 3) int32 indices of them, as `shading_normals`."""
    face_ids = np.arange(mesh.n_faces, dtype=np.int32)
    return face_normals(mesh, threads=threads), np.repeat(face_ids[:, None], 3, axis=1)


def with_flat_normals(mesh: Mesh, *, threads: int | None = None) -> Mesh:
    """Return a mesh that has its `flat_normals` as its own."""
    normals, normal_faces = flat_normals(mesh, threads=threads)
    return mesh.replace(normals=normals, normal_faces=normal_faces)


def weighted_normals(
    positions: FloatArray,
    faces: IntArray,
    rows: IntArray,
    n_normals: int,
    *,
    threads: int | None = None,
) -> FloatArray:
    """(n_normals, 3) angle-weighted unit normals of corners by `rows` (F, 3), in order of faces."""
    normals = np.zeros((n_normals, 3))
    # Brings the largest coordinate near 1, so that no product overflows.
    scale = unit_scale(max(float(positions.max()), -float(positions.min())))
    add_angle_weighted(normals, positions, faces, rows, scale, threads)
    if normalize_sums(normals, threads):
        fill_canceled(normals, positions, faces, rows)
    return normals


def add_angle_weighted(
    normals: FloatArray,
    positions: FloatArray,
    faces: IntArray,
    rows: IntArray,
    scale: float,
    threads: int | None,
) -> None:
    """Add weighted normals to those of corners in place; (F, 3) `rows`, -1 for none."""
    n_bands = resolve_threads(threads) if len(faces) > 1 << 14 else 1
    band = max(-(-len(normals) // n_bands), 1)

    def work(start: int, stop: int) -> None:
        core.add_vertex_normals(positions, faces, rows, scale, AREA_ROUNDING, start, stop, normals)

    run_bands(work, len(normals), band=band, threads=threads)


def normalize_sums(normals: FloatArray, threads: int | None) -> int:
    """Give sums unit length in place, 0 where they cancel; return how many are zero."""
    n_zero: list[int] = []
    run_bands(
        lambda start, stop: n_zero.append(core.normalize_sums(normals[start:stop])),
        len(normals),
        band=1 << 17,
        threads=threads,
    )
    return sum(n_zero)


def fill_canceled(
    normals: FloatArray, positions: FloatArray, faces: IntArray, rows: IntArray
) -> None:
    """Give zero normals that of their first face with area; (F, 3) `rows`, -1 for none."""
    zero = np.append((normals == 0.0).all(axis=1), False)  # -1 is the last
    chosen = zero[rows].any(axis=1)
    touched, rows = faces[chosen], rows[chosen]
    if len(touched) == 0:
        return
    of_faces = face_normals(Mesh(positions=positions, faces=touched), threads=1)
    with_area = (of_faces != 0.0).any(axis=1)
    of_faces, rows = of_faces[with_area], rows[with_area]
    found, firsts = np.unique(rows, return_index=True)
    is_zero = zero[found]
    normals[found[is_zero]] = of_faces[firsts[is_zero] // 3]


def vertex_curvatures(
    mesh: MeshLike, *, normals: FloatArray | None = None, threads: int | None = None
) -> FloatArray:
    """Mean curvature at each vertex, in units of one over the model unit."""
    mesh = as_mesh(mesh)
    if normals is None:
        normals = smooth_normals(mesh, threads=threads)
    firsts = weld_vertices(mesh, threads=threads)
    frame = LocalFrame.around(mesh)
    turns, areas = np.zeros(mesh.n_vertices), np.zeros(mesh.n_vertices)
    core.add_curvatures(
        frame.to_local(mesh.positions), mesh.faces, firsts, np.ascontiguousarray(normals),
        turns, areas,
    )  # fmt: skip
    areas[areas == 0.0] = 1.0
    with np.errstate(over="ignore"):
        return np.asarray((turns / areas)[firsts] * frame.scale)


def angles_between(one: AnyArray, other: AnyArray) -> FloatArray:
    """(n,) radians between unit vectors (n, 3); 0 where one of the two is zero."""
    # 2 asin of half the chord: exact for small angles, where the cosine is not.
    chords = pm.norm(one - other, axis=1) / 2.0
    directed = (one != 0.0).any(axis=1) & (other != 0.0).any(axis=1)
    return np.where(directed, 2.0 * pm.arcsin(np.minimum(chords, 1.0)), 0.0)
