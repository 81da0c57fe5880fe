"""The vertices of a simplified mesh, moved to where its surface lies closest to the original.

A collapse puts a vertex where it is best among its neighbors at that time. In the end, all of them
are fitted together: points spread over both surfaces say where the closest points of the triangles
should be, the farther ones more. The triangles stay what they are, and so do open edges and flat
parts. A vertex goes back to where it was if a face would fold, or the surface would leave the
original by more.

Based on: Hugues Hoppe, Tony DeRose, Tom Duchamp, John McDonald, Werner Stuetzle, "Mesh
optimization", SIGGRAPH 1993. Kernel: `core/surface_fit.c`.
"""

from __future__ import annotations

import numpy as np

from texbake.core import core, portable_math as pm
from texbake.mesh.distance import area_vectors, samples_allowed, spread_samples
from texbake.mesh.frame import UnitGrid
from texbake.mesh.mesh import BoolArray, FloatArray, IndexArray, IntArray, Mesh
from texbake.mesh.topology import find_edges
from texbake.mesh.triangle_tree import TriangleTree
from texbake.mesh.weld import later_copies, row_sums, weld_rows
from texbake.records import dataclass

_ROUNDS = 3
# Samples on each surface: for each triangle of the simplified one, and within these numbers.
_SAMPLES_A_FACE, _FEWEST_SAMPLES, _MOST_SAMPLES = 10, 5_000, 40_000
# Weight of a place that stands for no area: a vertex, or one at these shares of an edge.
_POINT_WEIGHT = 0.5
_ON_EDGES = (0.25, 0.5, 0.75)
# A surface may leave the other by this share of the greatest distance, or where it already did.
_FAR = 0.9
# A face lies on the other surface if no place within it is farther than this share of the RMS
# distance, and no vertex than that one: where the surface bends, those are off along the face, too.
_EXACT, _EXACT_ENDS = 0.3, 2.0
_LEAST_COSINE = 0.5  # between the normals of a face before and after
_FLATTEST = 1e-3  # height of a face as a share of its longest edge
_HALVINGS = 5


@dataclass(frozen=True, eq=False)
class _Samples:
    """Places on triangles, by the shares of their corners, and where they should be."""

    corners: IntArray  # (n, 3) int32
    shares: FloatArray  # (n, 3) float64
    targets: FloatArray  # (n, 3) float64
    distances: FloatArray  # (n,) float64
    weights: FloatArray  # (n,) float64
    is_exact: BoolArray  # (F,) bool: faces that lie on the other surface


class _Fit:
    """Two surfaces between which samples are taken, on one grid."""

    def __init__(
        self, source: FloatArray, of_source: IntArray, faces: IntArray, threads: int | None
    ):
        self.faces, self.threads = faces, threads
        self.edges = find_edges(faces)
        tails, heads = self.edges.vertices.T
        # The middles of the faces, the vertices, and places on the edges.
        self.used = np.unique(faces)
        lines = [np.stack([tails, heads, heads], axis=1)] * len(_ON_EDGES)
        self.on_points = np.concatenate([faces, np.repeat(self.used[:, None], 3, axis=1), *lines])
        counts = [len(faces), len(self.used)] + [len(tails)] * len(_ON_EDGES)
        on_edges = [[1.0 - t, t, 0.0] for t in (0.0, *_ON_EDGES)]
        self.of_points = np.repeat([[1.0 / 3.0] * 3, *on_edges], counts, axis=0)
        n = min(max(_SAMPLES_A_FACE * len(faces), _FEWEST_SAMPLES), _MOST_SAMPLES)
        self.tree = TriangleTree.for_points(n, source, of_source, threads=threads)
        self.n_samples = n = samples_allowed(self.tree, n)
        on_source, shares = spread_samples(source, of_source, n, 0, threads)
        used = np.unique(of_source)
        used = used[np.arange(min(n, len(used))) * len(used) // min(n, len(used))]
        self.own = np.concatenate([pm.vecmat(shares, source[of_source[on_source]]), source[used]])

    def _spread(self, points: FloatArray) -> tuple[IntArray, IntArray, FloatArray]:
        """Samples on the faces, with vertices at some points: faces, corners and their shares."""
        on_faces, shares = spread_samples(points, self.faces, self.n_samples, 0, self.threads)
        corners = np.concatenate([self.faces[on_faces], self.on_points])
        return on_faces, corners, np.concatenate([shares, self.of_points])

    def farthest(self, points: FloatArray, before: _Samples, enough: float) -> FloatArray:
        """(V,) greatest distance of the samples around vertices at some points, if above `enough`.

        No closest point is looked for where that of the samples before is near enough.
        """
        n = len(self.own)
        ends = pm.vecmat(before.shares[:n], points[before.corners[:n]])
        own = self.own[pm.norm(self.own - ends, axis=1) > enough]
        tree = TriangleTree.build(points, self.faces, threads=self.threads)
        to_here, ids, of_own = tree.closest_points(own, threads=self.threads)
        _, corners, shares = self._spread(points)
        places = pm.vecmat(shares, points[corners])
        far = np.flatnonzero(pm.norm(places - before.targets[n:], axis=1) > enough)
        there = self.tree.closest_points(places[far], threads=self.threads)[0]
        return _farthest(
            np.concatenate([self.faces[ids], corners[far]]),
            np.concatenate([of_own, shares[far]]),
            np.concatenate([to_here, there]),
            len(points),
        )

    def samples(self, points: FloatArray) -> _Samples:
        """Sample both surfaces, with the vertices of one at some points."""
        n, faces = self.n_samples, self.faces
        tree = TriangleTree.build(points, faces, threads=self.threads)
        to_here, ids, shares = tree.closest_points(self.own, threads=self.threads)
        on_faces, corners, of_corners = self._spread(points)
        places = pm.vecmat(of_corners, points[corners])
        there, on_source, of_source = self.tree.closest_points(places, threads=self.threads)
        closest = pm.vecmat(of_source, self.tree.positions[self.tree.faces[on_source]])
        weights = np.full(len(self.own) + len(places), _POINT_WEIGHT)
        weights[:n] = weights[len(self.own) : len(self.own) + n] = 1.0 + _POINT_WEIGHT
        distances = np.concatenate([to_here, there])
        squares = np.square(distances)
        off_by = there / np.sqrt(max(float(squares.mean()), 1e-300))
        is_off = off_by > _EXACT
        n_inside = n + len(faces)  # without what faces share
        off_vertices = np.zeros(len(points), dtype=np.bool_)
        off_vertices[self.used] = off_by[n_inside : n_inside + len(self.used)] > _EXACT_ENDS
        is_exact = np.asarray(~off_vertices[faces].any(axis=1))
        is_exact[on_faces[is_off[:n]]] = False
        is_exact[is_off[n:n_inside]] = False
        weights *= 1.0 + squares / max(float(squares.mean()), 1e-300)
        return _Samples(
            np.concatenate([faces[ids], corners]),
            np.concatenate([shares, of_corners]),
            np.concatenate([self.own, closest]),
            distances,
            weights,
            is_exact,
        )


def _farthest(
    corners: IntArray, shares: FloatArray, distances: FloatArray, n_vertices: int
) -> FloatArray:
    """(n_vertices,) greatest distance of the samples that a vertex has a share of."""
    most = np.zeros(n_vertices)
    for corner in range(3):
        own = shares[:, corner] > 0.0
        np.maximum.at(most, corners[own, corner], distances[own])
    return most


def refitted(mesh: Mesh, low: Mesh, threads: int | None = None) -> Mesh:
    """Return `low`, its vertices moved closer to `mesh`.

    With attributes, vertices move along their normals, or freely at hard edges. Those of edges that
    do not have two faces stay.
    """
    grid = UnitGrid.around(mesh)
    before, source = grid.to_grid(low.positions), grid.to_grid(mesh.positions)
    # Neither the winding of faces nor copies of them change what is sampled.
    order = np.argsort(low.faces, axis=1, kind="stable")
    faces = np.take_along_axis(low.faces, order, axis=1)
    signs = np.where((order[:, 1] - order[:, 0]) % 3 == 1, 1.0, -1.0)
    of_source = np.sort(weld_rows(source, threads=threads)[mesh.faces], axis=1)
    fit = _Fit(source, of_source[~later_copies(of_source)], faces, threads)
    has_attributes = low.uv_faces is not None or low.normal_faces is not None
    freedoms = np.full(len(before), 1 if has_attributes else 2, dtype=np.uint8)
    freedoms[split_vertices(low, low.normal_faces)] = 2
    freedoms[fit.edges.vertices[fit.edges.n_faces != 2]] = 0
    points = before
    is_exact: BoolArray | None = None
    for _ in range(_ROUNDS):
        samples = fit.samples(points)
        is_exact = samples.is_exact if is_exact is None else is_exact
        moved = points.copy()
        core.fit_vertices(
            samples.corners, samples.shares, samples.targets, samples.weights,
            faces, is_exact, freedoms, _normals(points, faces, signs), moved,
        )  # fmt: skip
        moved = _without_folds(points, moved, faces)
        enough = _FAR * float(samples.distances.max(initial=0.0))
        farthest = _farthest(samples.corners, samples.shares, samples.distances, len(points))
        is_far = fit.farthest(moved, samples, enough) > np.maximum(farthest, enough)
        moved[is_far] = points[is_far]
        points = moved
    return low.replace(positions=low.positions + grid.length_to_model(points - before))


def split_vertices(mesh: Mesh, ids: IntArray | None) -> IndexArray:
    """Vertices whose corners have several `ids` (F, 3): normals, or texture coordinates."""
    if ids is None:
        return np.empty(0, dtype=np.intp)
    pairs = np.unique(np.stack([mesh.faces.ravel(), ids.ravel()], axis=1), axis=0)
    return np.flatnonzero(np.bincount(pairs[:, 0], minlength=mesh.n_vertices) > 1)


def _normals(points: FloatArray, faces: IntArray, signs: FloatArray) -> FloatArray:
    """(V, 3) unit normals of vertices by the areas of their faces, 0 without any.

    `signs` (F,): -1 for faces that are wound the other way.
    """
    across = signs[:, None] * area_vectors(points, faces)
    normals = row_sums(faces.ravel(), np.repeat(across, 3, axis=0), len(points))
    lengths = np.sqrt(np.square(normals).sum(axis=1, keepdims=True))
    return np.asarray(normals / np.maximum(lengths, 1e-300))


def _shapes(points: FloatArray, faces: IntArray) -> tuple[FloatArray, FloatArray]:
    """Doubled area vectors (F, 3) of faces, and heights as shares of longest edges (F,)."""
    across = area_vectors(points, faces)
    edges = points[faces] - points[np.roll(faces, 1, axis=1)]
    longest = np.square(edges).sum(axis=2).max(axis=1)
    areas = np.sqrt(np.square(across).sum(axis=1))
    return across, areas / np.maximum(longest, 1e-300)


def _folds(before: FloatArray, after: FloatArray, faces: IntArray) -> BoolArray:
    """(F,) bool: faces that turn too far, or become flat."""
    (old, old_heights), (new, new_heights) = _shapes(before, faces), _shapes(after, faces)
    cosines = (old * new).sum(axis=1)
    sizes = np.sqrt(np.square(old).sum(axis=1) * np.square(new).sum(axis=1))
    is_flat = new_heights < np.minimum(_FLATTEST, old_heights)
    return np.asarray((cosines < _LEAST_COSINE * sizes) | is_flat)


def _without_folds(before: FloatArray, after: FloatArray, faces: IntArray) -> FloatArray:
    """Take back steps of vertices of faces that would fold, by parts, then wholly."""
    step = after - before
    for halving in range(_HALVINGS + len(faces)):
        folded = _folds(before, before + step, faces)
        if not folded.any():
            break
        step[np.unique(faces[folded])] *= 0.4 if halving < _HALVINGS else 0.0
    return np.asarray(before + step)
