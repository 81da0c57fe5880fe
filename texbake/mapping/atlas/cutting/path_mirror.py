"""Paths along edges that are mirror images of others, or run along the mirror plane.

The faces of a symmetric mesh need not mirror each other: a path follows the edges near an image.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from texbake.core import portable_math as pm
from texbake.mesh.mesh import BoolArray, FloatArray, IntArray
from texbake.mesh.symmetry import MirrorPlane
from texbake.mesh.topology import EdgeGraph, path_back
from texbake.mesh.triangle_tree import TriangleTree

# Costs of edges near a line, by their distance in lengths of the edge: the least and the most.
LEAST_NEAR, MOST_NEAR = 0.1, 4.0
_AT_PLANE = 0.6  # distance of a vertex from the plane, in mean edges, up to which it is there
# Distance of the end of a path from the plane, in lengths of the path, up to which the path ends at
# the plane instead.
_BESIDE = 0.2


class PathMirror:
    """The mirror images of paths through a graph of vertices."""

    def __init__(self, plane: MirrorPlane, points: FloatArray, graph: EdgeGraph) -> None:
        self._graph, self._points, self._images = graph, points, plane.mirrored(points)
        self._tails = np.repeat(np.arange(len(points)), np.diff(graph.rows))
        steps = points[graph.ends] - points[self._tails]
        self._lengths = np.maximum(pm.norm(steps, axis=1), 1e-30)
        self.edge = float(self._lengths.mean()) if len(steps) else 0.0
        self.heights = plane.heights(points)
        self.is_at_plane: BoolArray = np.abs(self.heights) <= _AT_PLANE * self.edge

    def image_of(self, vertex: int) -> int:
        """The vertex nearest to the mirror image of one."""
        return int(((self._points - self._images[vertex]) ** 2).sum(axis=1).argmin())

    def at_plane(self, vertex: int, length: float) -> int:
        """A vertex at the plane instead of one that is near it for a path of some length."""
        if not self.is_at_plane.any() or abs(self.heights[vertex]) > _BESIDE * length:
            return vertex
        at_plane = np.flatnonzero(self.is_at_plane)
        squares = ((self._points[at_plane] - self._points[vertex]) ** 2).sum(axis=1)
        return int(at_plane[squares.argmin()])

    def image_path(self, path: list[int], sources: IntArray, end: int) -> list[int]:
        """The path from an end to the nearest source, close to the mirror image of a path."""
        return self._path(self._distances(self._points[np.array(path)]), sources, end)

    def nearest_image(self, path: FloatArray, starts: IntArray, ends: IntArray) -> list[int] | None:
        """The path between one of two sets of vertices each, close to the image of points."""
        found, before = self._paths(self._distances(path), starts.astype(np.int32), -1)
        end = int(ends[found[ends].argmin()])
        return path_back(before, end) if 0.0 < found[end] < np.inf else None

    def _distances(self, path: FloatArray) -> FloatArray:
        """(V,) distances from the mirror image of a path (k, 3)."""
        steps = np.arange(len(path), dtype=np.int32)
        lines = np.stack([steps[:-1], steps[1:], steps[1:]], axis=1)
        tree = TriangleTree.build(path, lines, threads=1)
        far = 2.0 * MOST_NEAR * self.edge
        distances = tree.closest_points(self._images, max_distance=far, threads=1)[0]
        return np.minimum(distances, far)

    def path_at_plane(self, sources: IntArray, end: int) -> list[int]:
        """The path from an end to the nearest source, close to the plane."""
        return self._path(np.abs(self.heights), sources, end)

    def _path(self, distances: FloatArray, sources: IntArray, end: int) -> list[int]:
        return path_back(self._paths(distances, sources, end)[1], end)

    def _paths(
        self, distances: FloatArray, sources: IntArray, end: int
    ) -> tuple[FloatArray, IntArray]:
        """(V,) costs of paths from sources, and the vertices before; final up to an end."""
        far = (distances[self._tails] + distances[self._graph.ends]) / (2.0 * self._lengths)
        costs = self._graph.costs * far.clip(LEAST_NEAR, MOST_NEAR)
        found = np.full(len(self._points), np.inf)
        before = np.full(len(self._points), -1, dtype=np.int32)
        replace(self._graph, costs=costs).shorten(sources, found, before, end)
        return found, before
