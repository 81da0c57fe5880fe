"""Thin sheets that lie on a larger surface, such as stickers and labels, kept above it.

A simplified sheet and what it lies on have triangles of their own, so that one would sink into the
other where they are closer together than what simplifying changes. Sheets are found in the
original, by how they lie over larger parts, and raised in the result where they are too low.
"""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np

from texbake.core import portable_math as pm
from texbake.mesh.distance import area_vectors, unit_normals
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import BoolArray, FloatArray, IntArray, Mesh
from texbake.mesh.objects import weld_vertices
from texbake.mesh.topology import face_components, find_edges
from texbake.mesh.triangle_tree import TriangleTree

# A sheet has at most this share of the area of what it lies on, and lies this close to it, as a
# share of its own size. Its normals are those of the surface to this cosine, or their opposites, as
# is the way down.
_LARGEST, _CLOSE, _LEAST_COSINE = 0.5, 0.05, 0.9
# Parts that may have sheets on them, by area: those above the largest part divided by each.
_HOSTS = (1.0, 8.0, 64.0, 512.0)
# A sheet is found again by its box and area, as shares of its size and area.
_SAME_BOX, _SAME_AREA = 0.15, 0.35
_KEPT = 0.5  # share of its height over the surface that a sheet keeps everywhere
_ROUNDS = 4  # times that a sheet is raised
# Places on a sheet, and on all of them, and steps between them along an edge of a face.
_PLACES, _OF_ALL, _FEWEST_STEPS, _MOST_STEPS = 100_000, 2_000_000, 4, 24


class _Parts:
    """The parts of a mesh that no edge connects, with positions in a local frame."""

    def __init__(self, points: FloatArray, mesh: Mesh, threads: int | None):
        self.points, self.faces, self.threads = points, mesh.faces, threads
        self.firsts = weld_vertices(mesh, threads=threads)
        self.welded = self.firsts[mesh.faces]
        self.numbers, self.n = face_components(self.welded, mesh.n_vertices)

    @cached_property
    def areas(self) -> FloatArray:
        """(n,) area of each."""
        across = area_vectors(self.points, self.faces)
        halves = 0.5 * np.sqrt(np.square(across).sum(axis=1))
        return np.asarray(np.bincount(self.numbers, halves, self.n), dtype=np.float64)

    @cached_property
    def boxes(self) -> FloatArray:
        """(n, 2, 3) least and greatest corner of each."""
        boxes = np.stack([np.full((self.n, 3), np.inf), np.full((self.n, 3), -np.inf)], axis=1)
        for corner in range(3):
            np.minimum.at(boxes[:, 0], self.numbers, self.points[self.faces[:, corner]])
            np.maximum.at(boxes[:, 1], self.numbers, self.points[self.faces[:, corner]])
        return boxes

    @cached_property
    def sizes(self) -> FloatArray:
        """(n,) longest side of each box."""
        return np.asarray((self.boxes[:, 1] - self.boxes[:, 0]).max(axis=1))

    @cached_property
    def is_open(self) -> BoolArray:
        """(n,) bool: those with a boundary."""
        edges = find_edges(self.welded)
        at_edge = np.zeros(len(self.points), dtype=np.bool_)
        at_edge[edges.vertices[edges.boundary]] = True
        return np.bincount(self.numbers, at_edge[self.welded].any(axis=1), self.n) > 0

    def sheets(self) -> FloatArray:
        """(n,) least height of each part over a larger one that it lies on; NaN for others.

        Negative for sheets on the back of what they lie on.
        """
        found = np.full(self.n, np.nan)
        for share in _HOSTS:
            limit = self.areas.max() / share
            wanted = self.is_open & (self.areas <= _LARGEST * limit) & np.isnan(found)
            rows = np.flatnonzero(wanted[self.numbers])
            if not len(rows):
                break
            hosts = self.faces[(self.areas >= limit)[self.numbers]]
            of_faces = self.numbers[rows]
            heights, lies = self._heights(self.faces[rows], hosts, _CLOSE * self.sizes[of_faces])
            is_sheet = wanted & (np.bincount(of_faces, ~lies, self.n) == 0)
            for side in (1.0, -1.0):
                least = np.full(self.n, np.inf)
                np.minimum.at(least, of_faces, side * heights)
                is_there = is_sheet & (least >= 0.0)
                found[is_there] = side * least[is_there]
        return found

    def _heights(
        self, faces: IntArray, hosts: IntArray, close: FloatArray
    ) -> tuple[FloatArray, BoolArray]:
        """Heights (m,) of the middles of faces over others, and whether they lie on these."""
        tree = TriangleTree.build(self.points, hosts, threads=self.threads)
        middles = self.points[faces].mean(axis=1)
        distances, heights, normals = _over(tree, middles, self.threads)
        alike = (unit_normals(self.points, faces) * normals).sum(axis=1)
        is_over = np.abs(heights) >= _LEAST_COSINE * distances
        return heights, is_over & (np.abs(alike) >= _LEAST_COSINE) & (distances <= close)


class Decals:
    """The sheets of a mesh that lie on larger parts of it."""

    def __init__(self, mesh: Mesh, threads: int | None = None):
        self.frame, self.threads = LocalFrame.around(mesh), threads
        self.source = _Parts(self.frame.to_local(mesh.positions), mesh, threads)

    @cached_property
    def heights(self) -> FloatArray:
        """(n,) least height of each part over what it lies on; NaN for parts that are no sheets."""
        return self.source.sheets() if self.source.n > 1 else np.full(self.source.n, np.nan)

    def raised(self, low: Mesh) -> Mesh:
        """Return what the mesh was simplified to, with its sheets above what they lie on there."""
        source, heights, threads = self.source, self.heights, self.threads
        if np.isnan(heights).all():
            return low
        parts = _Parts(self.frame.to_local(low.positions), low, threads)
        points = parts.points.copy()
        tree, n_hosts = None, 0
        sheets = np.flatnonzero(~np.isnan(heights))
        n_places = min(_PLACES, _OF_ALL // len(sheets))
        # Large ones first, so that those that lie on them find them where they stay.
        for sheet in sheets[np.argsort(-source.areas[sheets], kind="stable")]:
            off = np.abs(parts.boxes - source.boxes[sheet]).max(axis=(1, 2))
            is_same = off <= _SAME_BOX * source.sizes[sheet]
            is_same &= np.abs(parts.areas / source.areas[sheet] - 1.0) <= _SAME_AREA
            is_host = parts.areas * _LARGEST >= source.areas[sheet]
            if is_host.sum() > n_hosts:  # otherwise, they are those of the last sheet
                n_hosts = int(is_host.sum())
                hosts = low.faces[is_host[parts.numbers]]
                tree = TriangleTree.build(points[parts.firsts], hosts, threads=threads)
            faces = parts.welded[is_same[parts.numbers]]
            if tree is not None and len(faces):
                n = min(max(math.isqrt(2 * n_places // len(faces)), _FEWEST_STEPS), _MOST_STEPS)
                _raise(points, faces, tree, _KEPT * float(heights[sheet]), n, threads)
        moved = (points - parts.points)[parts.firsts]
        return low.replace(positions=low.positions + self.frame.length_to_model(moved))


def _over(
    tree: TriangleTree, places: FloatArray, threads: int | None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Distances (n,) of places from a surface, heights (n,) over it, and its normals (n, 3)."""
    distances, ids, shares = tree.closest_points(places, threads=threads)
    corners = tree.faces[ids]
    normals = unit_normals(tree.positions, corners)
    below = pm.vecmat(shares, tree.positions[corners])
    return distances, ((places - below) * normals).sum(axis=1), normals


def _raise(
    points: FloatArray,
    faces: IntArray,
    tree: TriangleTree,
    height: float,
    n: int,
    threads: int | None,
) -> None:
    """Raise vertices until their faces are at some height over a tree, at `n` steps of an edge.

    A negative height lies on the back.
    """
    side = -1.0 if height < 0.0 else 1.0
    steps = [(i, j) for i in range(n + 1) for j in range(n + 1 - i)]
    shares = np.array([(i, j, n - i - j) for i, j in steps]) / n
    ids = np.unique(faces)
    for _ in range(_ROUNDS):
        places = (points[faces][:, None] * shares[:, :, None]).sum(axis=2)
        _, heights, _ = _over(tree, places.reshape(-1, 3), threads)
        missing = side * height - (side * heights).reshape(len(faces), -1).min(axis=1)
        if missing.max() <= 0.0:
            break
        steps_up = np.zeros(len(points))
        np.maximum.at(steps_up, faces, missing[:, None])
        _, _, normals = _over(tree, points[ids], threads)
        points[ids] += side * steps_up[ids, None] * normals
