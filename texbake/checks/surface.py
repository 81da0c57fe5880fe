"""Checks of a surface: its faces, edges and vertices, and faces that pass through one another.

Vertices at one place count as one. Edges and fans are searched among faces with three different
places that repeat no other face, so that each fault is reported once, under its own name.

Two triangles in different planes intersect where each has corners on both sides of the other's
plane, and their segments of the line common to both planes overlap. One crossing is enough to flag
a face. It must be deeper and longer than the rounding of files, so that shells that rest on one
another do not count, nor neighbors that share a corner.

Based on: Guéziec, Taubin, Lazarus, Horn, "Cutting and stitching: converting sets of polygons to
manifold surfaces", 2001 (singular edges and vertices). Kernel of the intersections:
`core/face_crossings.c`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.checks.checked_mesh import CheckedMesh, Finding, Look
from texbake.core import core, portable_math as pm
from texbake.mapping.corner_uvs import unmeasurable_size
from texbake.mapping.seams import merged_labels
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import AnyArray, BoolArray, FloatArray, Int64Array, IntArray, frozen
from texbake.mesh.topology import next_half_edges
from texbake.mesh.triangle_tree import TriangleTree
from texbake.mesh.weld import weld_rows
from texbake.parallel import run_bands

# Share of the diagonal: the error of six decimals in a text file, or of float32.
_CRACK = 1e-6

# A slanted direction, along which few points of a model built on a grid lie at the same height.
_SLANTED = np.array([1.0, math.sqrt(2.0), math.sqrt(3.0)]) / math.sqrt(6.0)
_MAX_NEIGHBORS = 64  # along it, that a point is compared with

# Share of the diagonal: the step of float32 from which detail of a bake is lost.
_COARSE_STEP = 1e-4
_FLOAT32_STEP = 2.0**-24
_SIZES = (1e-5, 1e6)  # model units that most programs handle well


def zero_area_faces(checked: CheckedMesh) -> Finding | None:
    """Faces without area; the longest are the worst."""
    if not checked.has_area.any():  # reported as `no-surface`
        return None
    flat = np.flatnonzero(~checked.has_area)
    corners = checked.corners[flat]
    lengths = ((corners - np.roll(corners, 1, axis=1)) ** 2).sum(axis=2).max(axis=1, initial=0.0)
    return checked.finding("zero-area-faces", len(flat), flat, lengths)


def duplicate_vertices(checked: CheckedMesh) -> Finding | None:
    """Vertices that repeat an earlier one in place, normal, texture coordinates and color."""
    mesh = checked.mesh
    n_at = np.bincount(checked.firsts)[checked.firsts]
    if n_at.max() == 1:
        return None
    split = (n_at > 1)[mesh.faces]
    vertices = mesh.faces[split]
    keys = [checked.places[split]]
    if mesh.uvs is not None:
        keys.append(checked.uv_ids[split])
    if mesh.normals is not None:
        keys.append(weld_rows(mesh.normals)[mesh.normal_faces][split])
    if mesh.colors is not None:
        keys.append(weld_rows(mesh.colors)[vertices])
    carried = keys[0] if len(keys) == 1 else weld_rows(np.stack(keys, axis=1))
    # The first vertex with the same attributes; the others repeat it.
    least = np.full(int(carried.max(initial=-1)) + 1, mesh.n_vertices, dtype=np.int64)
    np.minimum.at(least, carried, vertices)
    repeats = vertices != least[carried]
    faces = np.nonzero(split)[0][repeats]
    return checked.finding("duplicate-vertices", _n_distinct(vertices[repeats]), faces)


def non_manifold_edges(checked: CheckedMesh) -> Finding | None:
    """Edges of more than two faces; those with the most faces are the worst."""
    edges = checked.edges
    many = edges.counts > 2
    faces, at = edges.faces_at(many)
    return checked.finding("non-manifold-edges", many.sum(), faces, edges.counts[at])


def pinched_vertices(checked: CheckedMesh) -> Finding | None:
    """Vertices at which groups of faces touch that share no edge, not even a non-manifold one."""
    edges = checked.edges
    same = np.diff(edges.ids.ravel()[edges.ordered], append=-1) == 0
    one, other = edges.ordered[:-1][same[:-1]], edges.ordered[1:][same[:-1]]
    places = checked.places[edges.faces].ravel()
    along = places[one] == places[other]
    next_one, next_other = next_half_edges(one), next_half_edges(other)
    fans = merged_labels(
        len(places),
        np.concatenate([one, next_one]),
        np.concatenate([np.where(along, other, next_other), np.where(along, next_other, other)]),
    )
    _, firsts = np.unique(fans, return_index=True)
    n_fans = np.bincount(places[firsts], minlength=checked.mesh.n_vertices)
    corners = np.flatnonzero(n_fans[places] > 1)
    faces = edges.faces[corners // 3]
    return checked.finding("pinched-vertices", (n_fans > 1).sum(), faces, n_fans[places[corners]])


def cracks(checked: CheckedMesh) -> Finding | None:
    """Vertices of open edges that lie close to another such vertex but not at its place."""
    edges = checked.edges
    rows, corners = np.nonzero((edges.counts == 1)[edges.ids])
    tails = checked.places[edges.faces[rows], corners]
    heads = checked.places[edges.faces[rows], (corners + 1) % 3]
    distance = _CRACK * checked.diagonal
    places = np.unique(np.concatenate([tails, heads]))
    nearer, farther = _near_pairs(checked.positions[places], distance)
    one, other = places[nearer], places[farther]
    # The two ends of a short edge lie close as well, but are no crack.
    open_edges = _pair_keys(tails, heads)
    apart = ~np.isin(_pair_keys(one, other), open_edges)
    torn = np.zeros(checked.mesh.n_vertices, dtype=bool)
    torn[one[apart]] = torn[other[apart]] = True
    faces = edges.faces[rows[torn[tails] | torn[heads]]]
    return checked.finding("cracks", torn.sum(), faces, distance=distance / checked.scale)


def far_from_origin(checked: CheckedMesh) -> Finding | None:
    """Whether the mesh lies so far away that float32 rounds its vertices."""
    farthest = float(np.abs(checked.mesh.bounds).max()) * checked.scale
    times = farthest / checked.diagonal if checked.diagonal > 0.0 else 0.0
    step = times * _FLOAT32_STEP
    return checked.finding("far-from-origin", int(step > _COARSE_STEP), times=times, step=step)


def extreme_size(checked: CheckedMesh) -> Finding | None:
    """Whether the mesh is very small or very large, or too large or small to be measured."""
    if (extent := unmeasurable_size(checked.mesh)) is not None:  # leaves the range of float64
        length, farthest = extent
        count = int(length > 0.0)  # a mesh that is a point has no surface
        return checked.finding("unmeasurable-size", count, length=length, farthest=farthest)
    size = checked.diagonal / checked.scale
    least, most = _SIZES
    extreme = size > most or 0.0 < size < least
    return checked.finding("extreme-size", int(extreme), size=size)


CHECKS: tuple[Look, ...] = (
    lambda mesh: mesh.finding("no-surface", int(not mesh.has_area.any())),
    zero_area_faces,
    # Faces that repeat an earlier one, with either winding; the largest are the worst.
    lambda mesh: mesh.flag("duplicate-faces", mesh.duplicates, mesh.areas),
    duplicate_vertices,
    lambda mesh: mesh.finding(
        "unused-vertices", mesh.mesh.n_vertices - _n_distinct(mesh.mesh.faces)
    ),
    non_manifold_edges,
    pinched_vertices,
    cracks,
    far_from_origin,
    extreme_size,
)


def _n_distinct(indices: npt.NDArray[np.integer[Any]]) -> int:
    return int(np.count_nonzero(np.bincount(indices.ravel()))) if indices.size else 0


def _near_pairs(points: FloatArray, distance: float) -> tuple[Int64Array, Int64Array]:
    """Pairs of points within a distance, found among neighbors along a slanted line."""
    heights = pm.matmul(points, _SLANTED)
    order = np.argsort(heights, kind="stable")
    heights, sorted_points = heights[order], points[order]
    ones, others = [np.zeros(0, dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
    lower = np.arange(len(points))
    for step in range(1, _MAX_NEIGHBORS + 1):
        lower = lower[lower + step < len(points)]
        lower = lower[heights[lower + step] - heights[lower] <= distance]
        if len(lower) == 0:
            break
        offsets = sorted_points[lower + step] - sorted_points[lower]
        near = lower[pm.vecdot(offsets, offsets) <= distance**2]
        ones.append(order[near])
        others.append(order[near + step])
    return np.concatenate(ones), np.concatenate(others)


def _pair_keys(one: AnyArray, other: AnyArray) -> Int64Array:
    """One integer for each unordered pair of vertices."""
    low, high = np.minimum(one, other).astype(np.int64), np.maximum(one, other)
    return np.asarray((low << 31) | high)


# Depth and length up to which a crossing does not count, as a share of the diagonal: the error of
# six decimals in a text file, for shells that touch; ...
_DEPTH = 1e-6

# ... and of the farthest coordinate: 4 units in the last place of a float32.
_RELATIVE_DEPTH = 2.0**-22
_BAND = 4096  # faces per thread at a time

# Faces that one face is compared with before the search is stopped: all of them in meshes of up to
# 23,000 faces, and never fewer than 512. A common mesh takes about 15 per face.
_MAX_PAIRS = 1 << 29
_MIN_PAIRS_PER_FACE = 512


def self_intersections(checked: CheckedMesh) -> Finding | None:
    """Faces that pass through another, or may; the largest are the worst."""
    others, unsure = crossed_by(checked)
    crossed = others >= 0
    if not crossed.any():
        return checked.flag("undecided-intersections", unsure, checked.areas)
    largest = int(np.where(crossed, checked.areas, -1.0).argmax())
    more = ""
    if unsure.any():
        more = f" {unsure.sum():,} more faces were not decided: too many others lie near them."
    return checked.flag(
        "self-intersections",
        crossed,
        checked.areas,
        one=largest,
        other=int(others[largest]),
        unsure=more,
    )


def crossed_by(checked: CheckedMesh) -> tuple[IntArray, BoolArray]:
    """Face that crosses each (F,), -1 for none, and where the search was stopped."""
    mesh, threads = checked.mesh, checked.options.threads
    frame = LocalFrame.around(mesh)
    positions = frozen(np.ascontiguousarray(frame.to_local(mesh.positions)))
    low, high = mesh.bounds * frame.scale
    depth = max(
        _DEPTH * float(pm.norm(high - low)), _RELATIVE_DEPTH * float(np.abs([low, high]).max())
    )
    normals = _normals_of_thick_faces(positions[mesh.faces], checked.normals, depth)
    tree = TriangleTree.build(positions, mesh.faces, threads=threads)
    parts = (tree.positions, tree.faces, tree.order, tree.boxes, tree.nodes)
    others = np.full(mesh.n_faces, -1, dtype=np.int32)
    unsure = np.zeros(mesh.n_faces, dtype=np.bool_)
    most = max(_MIN_PAIRS_PER_FACE, _MAX_PAIRS // mesh.n_faces)

    def look(start: int, stop: int) -> None:
        core.find_crossings(*parts, normals, depth, most, start, stop, others, unsure)

    run_bands(look, len(tree.order), band=_BAND, threads=threads)
    return others, unsure


def _normals_of_thick_faces(corners: FloatArray, normals: FloatArray, depth: float) -> FloatArray:
    """(F, 3) float64: unit normals, zero for faces no wider than `depth`."""
    edges = np.roll(corners, -1, axis=1) - corners
    longest = np.sqrt(pm.vecdot(edges, edges).max(axis=1))
    doubles = pm.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    thick = doubles > depth * longest
    return frozen(np.ascontiguousarray(np.where(thick[:, None], normals, 0.0)))
