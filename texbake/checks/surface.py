"""What is wrong with a surface by itself: its faces, edges and vertices.

Vertices at one place count as one, since many formats split them; what of that is waste is told.
Edges and fans are looked for among faces at three different places that repeat no other, so that
each fault is told once, under its own name.

Based on: Guéziec, Taubin, Lazarus, Horn, "Cutting and stitching: converting sets of polygons to
manifold surfaces", 2001 (singular edges and vertices).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.checks.finding import Finding, found
from texbake.checks.subject import Ids, Subject
from texbake.mapping.adjacency import merged_labels, next_half_edges
from texbake.mesh.weld import weld_rows

# Of the diagonal: what six decimals of a text file, or float32, leave of one point written twice.
_CRACK = 1e-6
# No axis of a model, so that few points of one that is built on a grid lie at one height along it.
_SLANTED = np.array([1.0, 2.0**0.5, 3.0**0.5]) / 6.0**0.5
_MOST_NEIGHBORS = 64  # along it that a point is compared with
# Of the diagonal: the step of float32 from which detail of a bake is lost in it.
_COARSE_STEP = 1e-4
_FLOAT32_STEP = 2.0**-24
_SIZES = (1e-5, 1e6)  # model units that most programs are at ease with


def no_surface(subject: Subject) -> Finding | None:
    """Find out whether no face at all has an area."""
    return found("no-surface", subject.role, int(not subject.has_area.any()))


def zero_area_faces(subject: Subject) -> Finding | None:
    """Find faces without area; the longest are the worst."""
    if not subject.has_area.any():  # told as that
        return None
    flat = np.flatnonzero(~subject.has_area)
    corners = subject.corners[flat]
    lengths = ((corners - np.roll(corners, 1, axis=1)) ** 2).sum(axis=2).max(axis=1, initial=0.0)
    return found("zero-area-faces", subject.role, len(flat), flat, lengths)


def duplicate_faces(subject: Subject) -> Finding | None:
    """Find faces that repeat an earlier one, turned either way; the largest are the worst."""
    faces = np.flatnonzero(subject.duplicates)
    return found("duplicate-faces", subject.role, len(faces), faces, subject.areas[faces])


def duplicate_vertices(subject: Subject) -> Finding | None:
    """Find vertices that repeat an earlier one in place, normal, coordinates and color."""
    mesh = subject.mesh
    n_at = np.bincount(subject.firsts)[subject.firsts]
    if n_at.max() == 1:
        return None
    split = (n_at > 1)[mesh.faces]
    vertices = mesh.faces[split]
    keys = [subject.places[split]]
    if mesh.uvs is not None:
        keys.append(subject.uv_ids[split])
    if mesh.normals is not None:
        keys.append(weld_rows(mesh.normals)[mesh.normal_faces][split])
    if mesh.colors is not None:
        keys.append(weld_rows(mesh.colors)[vertices])
    carried = keys[0] if len(keys) == 1 else weld_rows(np.stack(keys, axis=1))
    # The least vertex that carries the same; the others repeat it.
    least = np.full(int(carried.max(initial=-1)) + 1, mesh.n_vertices, dtype=np.int64)
    np.minimum.at(least, carried, vertices)
    repeats = vertices != least[carried]
    faces = np.nonzero(split)[0][repeats]
    return found("duplicate-vertices", subject.role, _n_distinct(vertices[repeats]), faces)


def unused_vertices(subject: Subject) -> Finding | None:
    """Find vertices of no face."""
    n_used = _n_distinct(subject.mesh.faces)
    return found("unused-vertices", subject.role, subject.mesh.n_vertices - n_used)


def non_manifold_edges(subject: Subject) -> Finding | None:
    """Find edges of more than two faces; those of the most are the worst."""
    edges = subject.edges
    many = edges.counts > 2
    faces, at = edges.faces_at(many)
    return found("non-manifold-edges", subject.role, many.sum(), faces, edges.counts[at])


def pinched_vertices(subject: Subject) -> Finding | None:
    """Find vertices whose faces hang together in nothing but the vertex.

    Faces hang together where they share an edge, however many have it: the vertices of a
    non-manifold edge are told as that.
    """
    edges = subject.edges
    same = np.diff(edges.ids.ravel()[edges.ordered], append=-1) == 0
    one, other = edges.ordered[:-1][same[:-1]], edges.ordered[1:][same[:-1]]
    places = subject.places[edges.faces].ravel()
    along = places[one] == places[other]
    next_one, next_other = next_half_edges(one), next_half_edges(other)
    fans = merged_labels(
        len(places),
        np.concatenate([one, next_one]),
        np.concatenate([np.where(along, other, next_other), np.where(along, next_other, other)]),
    )
    _, firsts = np.unique(fans, return_index=True)
    n_fans = np.bincount(places[firsts], minlength=subject.mesh.n_vertices)
    corners = np.flatnonzero(n_fans[places] > 1)
    return found(
        "pinched-vertices",
        subject.role,
        (n_fans > 1).sum(),
        edges.faces[corners // 3],
        n_fans[places[corners]],
    )


def cracks(subject: Subject) -> Finding | None:
    """Find vertices of open edges that lie next to another such vertex and not at its place."""
    edges = subject.edges
    rows, corners = np.nonzero((edges.counts == 1)[edges.ids])
    tails = subject.places[edges.faces[rows], corners]
    heads = subject.places[edges.faces[rows], (corners + 1) % 3]
    reach = _CRACK * subject.diagonal
    places = np.unique(np.concatenate([tails, heads]))
    nearer, farther = _near_pairs(subject.positions[places], reach)
    one, other = places[nearer], places[farther]
    # The ends of a short edge are near, and no crack.
    open_edges = _pair_keys(tails, heads)
    apart = ~np.isin(_pair_keys(one, other), open_edges)
    torn = np.zeros(subject.mesh.n_vertices, dtype=bool)
    torn[one[apart]] = torn[other[apart]] = True
    faces = edges.faces[rows[torn[tails] | torn[heads]]]
    return found("cracks", subject.role, torn.sum(), faces, distance=reach / subject.scale)


def far_from_origin(subject: Subject) -> Finding | None:
    """Find out whether float32 can hold the mesh where it lies."""
    farthest = float(np.abs(subject.mesh.bounds).max()) * subject.scale
    times = farthest / subject.diagonal if subject.diagonal > 0.0 else 0.0
    coarse = times * _FLOAT32_STEP > _COARSE_STEP
    return found(
        "far-from-origin", subject.role, int(coarse), times=times, step=times * _FLOAT32_STEP
    )


def extreme_size(subject: Subject) -> Finding | None:
    """Find out whether the mesh is very small or very large."""
    size = subject.diagonal / subject.scale
    least, most = _SIZES
    extreme = size > most or 0.0 < size < least
    return found("extreme-size", subject.role, int(extreme), size=size)


CHECKS = (
    no_surface,
    zero_area_faces,
    duplicate_faces,
    duplicate_vertices,
    unused_vertices,
    non_manifold_edges,
    pinched_vertices,
    cracks,
    far_from_origin,
    extreme_size,
)


def _n_distinct(indices: npt.NDArray[np.integer[Any]]) -> int:
    return int(np.count_nonzero(np.bincount(indices.ravel()))) if indices.size else 0


def _near_pairs(points: npt.NDArray[np.float64], reach: float) -> tuple[Ids, Ids]:
    """Pairs of points within reach, found among neighbors along a slanted line."""
    heights = points @ _SLANTED
    order = np.argsort(heights, kind="stable")
    heights, sorted_points = heights[order], points[order]
    ones, others = [np.zeros(0, dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
    lower = np.arange(len(points))
    for step in range(1, _MOST_NEIGHBORS + 1):
        lower = lower[lower + step < len(points)]
        lower = lower[heights[lower + step] - heights[lower] <= reach]
        if len(lower) == 0:
            break
        ways = sorted_points[lower + step] - sorted_points[lower]
        near = lower[np.einsum("ij,ij->i", ways, ways) <= reach**2]
        ones.append(order[near])
        others.append(order[near + step])
    return np.concatenate(ones), np.concatenate(others)


def _pair_keys(one: npt.NDArray[Any], other: npt.NDArray[Any]) -> Ids:
    """One integer for each unordered pair of vertices."""
    low, high = np.minimum(one, other).astype(np.int64), np.maximum(one, other)
    return np.asarray((low << 31) | high)
