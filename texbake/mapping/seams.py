"""Where the texture is cut: charts, the seams between them, and which faces are neighbors.

Edges are compared by where they lie, not by their indices, so that vertices and texture coordinates
that a file repeats do not cut anything.

A half-edge is the edge of one face from one of its corners to the next, number 3 f + c for corner c
of face f. Two half-edges are opposite where exactly two faces meet along one edge and run along it
in opposite directions.

Based on: K. Weiler, "Edge-based data structures for solid modeling in curved-surface environments",
1985 (half-edges).
"""

from __future__ import annotations

import numpy as np

from texbake.core import core, portable_math as pm
from texbake.mesh.hard_edges import exceed_angle, inner_edges, normals_jump
from texbake.mesh.mesh import BoolArray, FloatArray, Int64Array, IntArray, Mesh
from texbake.mesh.normals import face_normals
from texbake.mesh.topology import edge_ids, face_components
from texbake.mesh.weld import unique_rows, weld_rows


def chart_ids(mesh: Mesh, *, cut: BoolArray | None = None) -> IntArray:
    """(F,) charts: faces joined in space and texture, not across `cut` (F,), by first faces."""
    corners = _texture_corners(mesh)
    if cut is not None:
        corners = corners + (int(corners.max(initial=-1)) + 1) * cut[:, np.newaxis]
    return connected_faces(edge_ids(corners))


def charts_and_seams(mesh: Mesh, faces: BoolArray) -> tuple[IntArray, float]:
    """`chart_ids` of a mesh, and `seam_length` of some of its faces."""
    edges = edge_ids(_texture_corners(mesh))
    return connected_faces(edges), _length(mesh, _seams(mesh, edges, faces))


def border_edges(mesh: Mesh) -> BoolArray:
    """(F, 3) edges that no other face shares in space and texture: outlines of charts."""
    return _used_once(edge_ids(_texture_corners(mesh)))


def seam_edges(mesh: Mesh, faces: BoolArray | None = None) -> BoolArray:
    """(F, 3) edges of `faces`, as if alone, where the texture is cut but the surface is not."""
    kept = np.ones(mesh.n_faces, dtype=bool) if faces is None else faces
    return _seams(mesh, edge_ids(_texture_corners(mesh)), kept)


def _seams(mesh: Mesh, edges: Int64Array, kept: BoolArray) -> BoolArray:
    """`seam_edges` of the `kept` (F,) faces, whose edges in the texture are `edges` (F, 3)."""
    cut = np.zeros((mesh.n_faces, 3), dtype=bool)
    cut[kept] = _used_once(edges[kept])
    tails = weld_rows(mesh.positions)[mesh.faces]
    heads = np.roll(tails, -1, axis=1)
    # Few edges lie between two vertices of borders: all that could be equal to one of those.
    at_border = np.zeros(mesh.n_vertices, dtype=bool)
    at_border[tails[cut]] = at_border[heads[cut]] = True
    near = np.nonzero(at_border[tails] & at_border[heads] & kept[:, np.newaxis])
    ends = np.stack([tails[near], heads[near]], axis=1)
    ends.sort(axis=1)
    cut[near] &= ~_used_once(unique_rows(ends)[1].astype(np.int64))
    return cut


def seam_length(
    mesh: Mesh, faces: BoolArray | None = None, weights: FloatArray | None = None
) -> float:
    """Length of the seams of `faces`, each counted once, in model units by `weights` (F, 3)."""
    return _length(mesh, seam_edges(mesh, faces), weights)


def _length(mesh: Mesh, seams: BoolArray, weights: FloatArray | None = None) -> float:
    rows, starts = np.nonzero(seams)
    tails = mesh.positions[mesh.faces[rows, starts]]
    heads = mesh.positions[mesh.faces[rows, (starts + 1) % 3]]
    lengths = pm.norm(heads - tails, axis=1)
    return float((lengths if weights is None else lengths * weights[rows, starts]).sum()) / 2.0


def connected_faces(edges: Int64Array) -> IntArray:
    """(F,) components of faces that share an `edge_ids` edge, numbered by their first faces."""
    # Edges take the place of vertices: faces that share one are connected.
    components, _ = face_components(edges.astype(np.int32), int(edges.max(initial=-1)) + 1)
    return components


def _texture_corners(mesh: Mesh) -> IntArray:
    """(F, 3) int32: equal for corners with the same position and texture coordinate."""
    mesh.corner_uvs()  # raises where there are none
    assert mesh.uvs is not None
    places = weld_rows(mesh.positions)[mesh.faces]
    uvs = weld_rows(mesh.uvs)[mesh.uv_faces]
    place_of = np.empty(len(mesh.uvs), dtype=np.int32)
    place_of[uvs] = places
    if np.array_equal(place_of[uvs], places):  # as in an atlas
        return uvs
    return weld_rows(np.stack([places, uvs], axis=2).reshape(-1, 2)).reshape(-1, 3)


def _used_once(edges: Int64Array) -> BoolArray:
    return np.asarray(np.bincount(edges.ravel())[edges] == 1)


def merged_labels(n_items: int, firsts: IntArray, seconds: IntArray) -> IntArray:
    """(n_items,) groups of items connected by pairs, by their first items; `core/union_find.c`."""
    labels = np.arange(n_items, dtype=np.int32)
    core.merge_labels(
        labels,
        np.ascontiguousarray(firsts, dtype=np.int32),
        np.ascontiguousarray(seconds, dtype=np.int32),
    )
    return labels


def regions_between(
    mesh: Mesh, *, hard_edges: bool, angle: float | None, regions: IntArray | None = None
) -> tuple[IntArray | None, int]:
    """Divide `regions` (F,) at hard normals, and where faces meet at more than `angle` degrees.

    Returns the regions, as they are if nothing divides them, and the hard edges that end within
    one.
    """
    if angle is None and not (hard_edges and mesh.normals is not None):
        return regions, 0
    one, other = inner_edges(mesh, regions)
    divides = np.zeros(len(one), dtype=np.bool_)
    if hard_edges and mesh.normals is not None:
        divides |= normals_jump(mesh, one, other)
    if angle is not None:
        normals = face_normals(mesh)
        divides |= exceed_angle(normals[one // 3], normals[other // 3], angle)
    labels = merged_labels(
        mesh.n_faces, (one[~divides] // 3).astype(np.int32), (other[~divides] // 3).astype(np.int32)
    )
    return labels, int(np.count_nonzero(divides & (labels[one // 3] == labels[other // 3])))
