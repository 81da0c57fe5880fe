"""The two halves of a symmetric mesh, and the corners of one that mirror those of the other.

A polygon is on one side of the mirror plane, or in the middle if it is large and crosses the plane.
A small polygon that crosses the plane, as on scans, belongs to the side that contains most of it.
Short edges between the sides of a triangle mesh then move to the straightest path along the plane.
"""

from __future__ import annotations

import numpy as np

from texbake.core import core, portable_math as pm
from texbake.mapping.atlas.charts import ChartSurface
from texbake.mapping.atlas.cutting.path_mirror import LEAST_NEAR, MOST_NEAR
from texbake.mapping.corner_uvs import surface_areas
from texbake.mapping.stretch import longest_squares
from texbake.mesh.mesh import FloatArray, Int64Array, IntArray
from texbake.mesh.symmetry import MirrorPlane, find_mirror_plane, plane_between
from texbake.mesh.triangle_tree import TriangleTree
from texbake.mesh.weld import weld_rows
from texbake.records import dataclass

# A polygon crosses the plane if it extends this far on both sides, in diagonals of the mesh.
_CROSSING = 0.01
_LARGE = 0.002  # share of the area of the mesh above which such a polygon is large
# Most distance between a mirrored vertex and its image, in longest edges of the image's face.
_SAME_VERTEX = 0.1
# Number of vertices that are tested first, and the least share of them with an image.
_LOOKED_AT = 1000
_LEAST_MATCHED = 0.5
# Least share of faces with an image where faces without one would break up charts.
_WELL_MATCHED = 0.97
# Width of the band in which the border of the sides moves, in rings of faces per edge: 0 stands for
# two rings. Longer faces, in diagonals, stay on their sides, as those of mechanical parts do.
_BAND_WIDTH, _SHORT = 0.0, 0.05
_ROUNDS = 2  # of moving the plane halfway between vertices and their images


@dataclass(frozen=True, eq=False)
class Halves:
    """The sides of a mesh about its mirror plane."""

    plane: MirrorPlane
    # (F,) int8; -1 or 1 for faces of a side, 0 in the middle, 2 for those without a mirror image.
    sides: IntArray
    # (F, 3) int64; the corner, 3 f + c, whose mirror image each corner is; -1 where there is none.
    # None if the faces do not mirror each other one by one.
    twins: Int64Array | None
    # Whether straight borders and speed count more than exact mirror images.
    is_loose: bool = False


def halves_of(
    surface: ChartSurface, plane: MirrorPlane, *, apart: bool = False, one_by_one: bool = True
) -> Halves:
    """Find the halves; `apart`: every polygon that is its own mirror image is in the middle.

    `one_by_one`: look for faces that mirror each other; otherwise, nothing is in the middle.
    """
    points, faces = surface.points, surface.faces
    polygons = np.arange(len(faces), dtype=np.int32)
    if surface.polygons is not None:
        polygons = np.unique(surface.polygons, return_inverse=True)[1].astype(np.int32)
    twins: Int64Array | None = None
    if one_by_one:
        plane, twins = _twin_corners(points, faces, polygons, plane, surface.threads)
    least = _LEAST_MATCHED if apart else _WELL_MATCHED
    if twins is not None and np.count_nonzero(twins[:, 0] >= 0) < least * len(faces):
        twins = None
    sides = _sides(points, faces, polygons, plane)
    if not one_by_one:
        sides[sides == 0] = 1
    if twins is None:
        if surface.polygons is None:  # otherwise, they bound the sides by rows of edges
            sides = _straight_sides(surface, plane, sides)
        return Halves(plane, sides, None, is_loose=not one_by_one)
    matched = (twins >= 0).all(axis=1)
    own = matched & (polygons[twins[:, 0] // 3] == polygons)
    if apart:
        sides[own] = 0
    else:
        sides[own & (sides != 0)] = 1
    opposed = matched & ~own
    # Rounding may put both polygons of a pair at the plane on one side: the first then gets side 1.
    wrong = opposed & (sides[twins[:, 0] // 3] != -sides) & (sides != 0)
    sides[wrong] = np.where(polygons < polygons[twins[:, 0] // 3], 1, -1)[wrong]
    middle = opposed & (sides == 0)
    sides[middle & (polygons > polygons[twins[:, 0] // 3])] = 0
    sides[~matched & (sides != 0)] = 2
    return Halves(plane, sides, twins)


def find_halves(
    surface: ChartSurface, *, apart: bool = False, one_by_one: bool = True
) -> Halves | None:
    """Find the mirror plane of a surface, and its halves; None if it is not symmetric."""
    plane = find_mirror_plane(surface.points, surface.faces, threads=surface.threads)
    if plane is None:
        return None
    halves = halves_of(surface, plane, apart=apart, one_by_one=one_by_one)
    return halves if (halves.sides > 0).any() and (halves.sides < 0).any() else None


def _sides(points: FloatArray, faces: IntArray, polygons: IntArray, plane: MirrorPlane) -> IntArray:
    """(F,) sides of faces, by position alone."""
    heights = plane.heights(points)[faces]
    n_polygons = int(polygons.max()) + 1
    low, high = np.full(n_polygons, np.inf), np.full(n_polygons, -np.inf)
    np.minimum.at(low, polygons, heights.min(axis=1))
    np.maximum.at(high, polygons, heights.max(axis=1))
    means = np.bincount(polygons, heights.sum(axis=1), n_polygons)
    areas = np.bincount(polygons, surface_areas(points[faces]), n_polygons)
    least = _CROSSING * float(pm.norm(np.ptp(points[faces].reshape(-1, 3), axis=0)))
    sides = np.where(means >= 0.0, 1, -1)
    sides[(low < -least) & (high > least) & (areas > _LARGE * areas.sum())] = 0
    return np.asarray(sides[polygons], dtype=np.int32)


def _straight_sides(surface: ChartSurface, plane: MirrorPlane, sides: IntArray) -> IntArray:
    """(F,) sides, whose border is the straightest path along the plane."""
    corners, _, opposite = surface.joints
    diagonal = float(pm.norm(np.ptp(surface.points[corners].reshape(-1, 3), axis=0)))
    is_short = longest_squares(surface.points[corners]) <= (_SHORT * diagonal) ** 2
    is_free = np.repeat((sides != 0) & is_short, 3)
    labels = (sides > 0).astype(np.int32)
    core.straighten_borders(
        surface.points,
        corners,
        np.where(is_free & is_free[opposite], opposite, -1).astype(np.int32),
        plane_costs(surface, plane),
        _BAND_WIDTH,
        labels,
    )
    return np.where(sides != 0, 2 * labels - 1, 0).astype(np.int32)


def _twin_corners(
    points: FloatArray, faces: IntArray, polygons: IntArray, plane: MirrorPlane, threads: int | None
) -> tuple[MirrorPlane, Int64Array | None]:
    """Mirror image of each corner, and the plane between vertices and their images."""
    places = weld_rows(points, threads=threads)
    used = np.unique(places[faces])
    tree = TriangleTree.build(points, faces, threads=threads)
    some = used[:: max(len(used) // _LOOKED_AT, 1)]
    for _ in range(_ROUNDS):
        images = _images(some, tree, places, plane, threads)
        found = images >= 0
        if np.count_nonzero(found) < _LEAST_MATCHED * len(some):
            return plane, None
        plane = plane_between(points[some[found]], points[images[found]], plane.error)
    image_of = np.full(len(points), -1, dtype=np.int64)
    image_of[used] = _images(used, tree, places, plane, threads)
    return plane, _twins(places[faces].astype(np.int64), polygons, image_of)


def _images(
    vertices: IntArray,
    tree: TriangleTree,
    places: IntArray,
    plane: MirrorPlane,
    threads: int | None,
) -> Int64Array:
    """(n,) vertices that are the mirror images of vertices, -1 for none."""
    mirrored = plane.mirrored(tree.positions[vertices])
    _, face_ids, weights = tree.closest_points(mirrored, threads=threads)
    corners = tree.faces[face_ids]
    nearest = np.take_along_axis(corners, weights.argmax(axis=1)[:, None], axis=1)[:, 0]
    edges = tree.positions[corners] - tree.positions[np.roll(corners, 1, axis=1)]
    longest = np.sqrt((edges**2).sum(axis=2).max(axis=1))
    near = pm.norm(tree.positions[nearest] - mirrored, axis=1) <= _SAME_VERTEX * longest
    return np.where(near, places[nearest], -1).astype(np.int64)


def _twins(corners: Int64Array, polygons: IntArray, image_of: Int64Array) -> Int64Array:
    """(F, 3) mirror images of corners, by polygons that have images of each other's vertices."""
    images = image_of[corners]
    n_polygons = int(polygons.max()) + 1
    codes = _sums(np.repeat(polygons, 3), corners.ravel(), n_polygons)
    of_images = _sums(np.repeat(polygons, 3), images.ravel(), n_polygons)
    of_images[polygons[(images < 0).any(axis=1)]] = 0
    twin = _matches(codes, of_images)
    # Only polygons that are each other's images, so that none is the image of two.
    twin[(twin >= 0) & (twin[twin] != np.arange(n_polygons))] = -1
    keys = (np.repeat(polygons, 3).astype(np.int64) << 32) + corners.ravel()
    wanted = (np.repeat(twin[polygons], 3).astype(np.int64) << 32) + images.ravel()
    found = _matches(keys, wanted).reshape(-1, 3)
    found[(found < 0).any(axis=1)] = -1
    lost = np.zeros(n_polygons, dtype=bool)
    lost[polygons[found[:, 0] < 0]] = True
    lost |= lost[twin] & (twin >= 0)
    found[lost[polygons]] = -1
    return found


def _matches(keys: Int64Array, wanted: Int64Array) -> Int64Array:
    """(n,) the first of the keys that equals each wanted one, by its index; -1 for none."""
    order = np.argsort(keys, kind="stable")
    at = order[np.minimum(np.searchsorted(keys[order], wanted), len(keys) - 1)]
    return np.where(keys[at] == wanted, at, -1)


def _sums(owners: IntArray, vertices: Int64Array, n: int) -> Int64Array:
    """(n,) sums of codes of the different vertices of each owner."""
    keys = np.unique((owners.astype(np.int64) << 32) + (vertices & 0xFFFFFFFF))
    codes = (keys & 0xFFFFFFFF).astype(np.uint64) + np.uint64(1)
    codes *= np.uint64(0x9E3779B97F4A7C15)
    codes ^= codes >> np.uint64(29)
    codes *= np.uint64(0xBF58476D1CE4E5B9)
    sums = np.zeros(n, dtype=np.uint64)
    np.add.at(sums, keys >> 32, codes)
    return sums.view(np.int64)


# Distance from the mirror plane, in lengths of an edge, beyond which the edge is not at the plane.
_AT_PLANE = 2.0


def image_costs(
    surface: ChartSurface, halves: Halves, opposite: IntArray, labels: IntArray
) -> FloatArray:
    """(F, 3) costs of edges of the other side: low near the mirror images of borders.

    `opposite`: half-edges; `labels` (F,): the borders run between faces of different ones.
    """
    is_cut = np.repeat(halves.sides >= 0, 3)
    edges = np.flatnonzero((opposite >= 0) & is_cut & is_cut[opposite])
    edges = edges[labels[opposite[edges] // 3] > labels[edges // 3]]
    if not len(edges):
        return np.ones(surface.corners.shape)
    ends = surface.corners.ravel(), np.roll(surface.corners, -1, axis=1).ravel()
    lines = np.stack([ends[0][edges], ends[1][edges], ends[1][edges]], axis=1)
    tree = TriangleTree.build(surface.points, lines, threads=surface.threads)
    others = np.unique(surface.corners[halves.sides < 0])
    mirrored = halves.plane.mirrored(surface.points[others])
    distances = np.full(len(surface.points), np.inf)
    distances[others] = tree.closest_points(mirrored, threads=surface.threads)[0]
    costs = np.asarray(_nearness(surface, distances).clip(LEAST_NEAR, MOST_NEAR))
    return np.sqrt(np.sqrt(costs)) if halves.is_loose else costs


def plane_costs(surface: ChartSurface, plane: MirrorPlane) -> FloatArray:
    """(F, 3) costs of edges: low near the plane, infinite for those that are not."""
    nearness = _nearness(surface, np.abs(plane.heights(surface.points)))
    return np.where(nearness <= _AT_PLANE, nearness.clip(LEAST_NEAR, MOST_NEAR), np.inf)


def _nearness(surface: ChartSurface, distances: FloatArray) -> FloatArray:
    """(F, 3) distances of edges by those of their ends (V,), in lengths of the edge."""
    heads = np.roll(surface.corners, -1, axis=1)
    steps = surface.points[heads] - surface.points[surface.corners]
    lengths = np.maximum(pm.norm(steps.reshape(-1, 3), axis=1).reshape(-1, 3), 1e-30)
    return np.asarray((distances[surface.corners] + distances[heads]) / (2.0 * lengths))
