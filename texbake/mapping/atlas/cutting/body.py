"""Whole bodies: cut along a tree of seams and flattened as one chart, as an artist would.

Handles are cut open first, and closed bodies from end to end. Darts follow, each from the place of
most stretch to the nearest seam; those that cost more than they save are taken back.

Based on: X. Gu, S. Gortler, H. Hoppe, "Geometry Images", 2002 (the cut grows to where the layout
stretches most). A. Sheffer, J. Hart, "Seamster: Inconspicuous Low-Distortion Texture Seam Layout",
2002 (a tree over extremities, by costs of edges). J. Erickson, K. Whittlesey, "Greedy Optimal
Homotopy and Homology Generators", 2005 (short loops around handles).
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.mapping.atlas.charts import Charts
from texbake.mapping.atlas.cutting.path_mirror import PathMirror
from texbake.mapping.atlas.flatten import Flat, face_energies, flatten
from texbake.mapping.corner_uvs import surface_areas
from texbake.mapping.seams import merged_labels
from texbake.mesh.mesh import AnyArray, BoolArray, FloatArray, IntArray
from texbake.mesh.symmetry import MirrorPlane
from texbake.mesh.topology import EdgeGraph, next_half_edges, path_back
from texbake.records import dataclass

# In sides of a square as large as the body: distance of an end from the mirror plane up to which
# the first cut runs along the plane, and least length of a dart.
_BESIDE, _LEAST_DART = 0.5, 0.05
_MOST_DARTS = 24
_PATIENCE = 5  # darts in a row that do not lower the cost, after which no more are tried
_NEAR_DART = 0.5  # distance from the end of such a dart, in its lengths, where no other ends

# Cost of a body: its seams, and a constant for its outline, in sides of a square as large, times
# its energy (1 at best) to this power.
_OUTLINE, _POWER = 1.0, 8.0

_MOST_HANDLES = 6  # with more, the loops are longer than the seams of many charts
_ROOTS = 6  # further vertices that loops are searched from

_LONG_OUTLINE = 25.0  # squared, in areas: of a rectangle four times as long as wide

_STEPS = 12  # of the layout after each dart
_ROUGH, _FINE = 1e-3, 1e-5  # accuracies of layouts
_SMOOTHINGS = 6  # rounds of averaging stretch over neighboring faces


@dataclass(frozen=True, kw_only=True, eq=False)
class BodyLayout:
    """A body flattened as one chart."""

    faces: IntArray  # (m, 3) int32; indices into the coordinates
    flat: Flat

    def charts(self) -> Charts:
        """The one chart."""
        n = len(self.flat.uvs)
        return Charts(uvs=self.flat.uvs, faces=self.faces, chart_ids=np.zeros(n, dtype=np.int32))


def flatten_body(
    points: FloatArray,
    opposite: IntArray,
    weights: FloatArray,
    plane: MirrorPlane | None = None,
    *,
    n_faces: int | None = None,
) -> BodyLayout | None:
    """Flatten a connected surface as one chart, which may overlap itself; None if impossible.

    `points` (m, 3, 3) float64: the corners of its faces; `opposite` (3 m,) int32: their half-edges;
    `weights` (3 m,) float64: cost of a seam for each unit of its length, infinite for none;
    `plane`: a mirror plane of the body, whose seams are cut in pairs; `n_faces`: those of the
    chart, which come first; others only close holes.
    """
    body = _Body(points, opposite, weights, plane)
    if not body.has_seam and not _open_up(body):
        return None
    rough = _best_darts(body)
    return None if rough is None else _finished(body, rough, n_faces)


def cut_tube_open(
    points: FloatArray, opposite: IntArray, weights: FloatArray
) -> tuple[IntArray, npt.NDArray[np.intp], IntArray | None] | None:
    """Cut a tube or a torus, as in `flatten_body`, to a disk with four corners; None for others.

    Returns (m, 3) int32: vertices of the faces; (n,): a corner (face and side) of each; (4,): the
    vertices at the corners of the disk. In place of these, None stands for a long disk that needs
    no cut, such as a strip, whose corners are unknown.
    """
    body = _Body(points, opposite, weights)
    n_edges = (len(opposite) + np.count_nonzero(body.cut)) // 2
    shape = len(body.points) - n_edges + len(points)  # 1 for a disk, 0 for a tube or a torus
    if shape == 1 and float(body.lengths[body.cut].sum()) ** 2 > _LONG_OUTLINE * body.area:
        return *body.split_corners(), None
    if shape != 0:
        return None
    if not body.has_seam:  # a torus, which a cut along the loop of fewer edges turns into a tube
        body.cut_along(min(_loops(body), key=len))
        opposite = np.where(body.cut, np.int32(-1), opposite)
        body = _Body(points, opposite, weights)
    tails, heads = body.tails[body.cut], body.heads[body.cut]
    loops = merged_labels(len(body.points), tails, heads)
    is_first = loops[tails] == loops[tails[0]]
    distances = np.full(len(body.points), np.inf)
    before = np.full(len(body.points), -1, dtype=np.int32)
    body.graph.shorten(np.unique(tails[is_first]).astype(np.int32), distances, before)
    others = np.unique(tails[~is_first])
    if not len(others) or not np.isfinite(distances[others]).any():
        return None
    path = path_back(before, int(others[distances[others].argmin()]))
    body.cut_along(path)
    vertices, first = body.split_corners()
    ends = np.isin(body.vertices.ravel()[first], [path[0], path[-1]])
    corners = np.flatnonzero(ends).astype(np.int32)
    return (vertices, first, corners) if len(corners) == 4 else None


class _Body:
    """A connected surface, and the seams so far."""

    def __init__(
        self,
        points: FloatArray,
        opposite: IntArray,
        weights: FloatArray,
        plane: MirrorPlane | None = None,
    ) -> None:
        edges = np.flatnonzero(opposite >= 0).astype(np.int32)
        self.opposite = opposite
        self.cut = opposite < 0
        _, first, numbers = np.unique(self._corner_labels(), return_index=True, return_inverse=True)
        self.points: FloatArray = points.reshape(-1, 3)[first]
        self.corners = points
        self.vertices = numbers.reshape(-1, 3).astype(np.int32)
        self.tails, self.heads = self.vertices.ravel(), np.roll(self.vertices, -1, 1).ravel()
        self.lengths = pm.norm(self.points[self.heads] - self.points[self.tails], axis=1)
        self.may_cut: BoolArray = np.isfinite(weights)
        self.areas = surface_areas(points)
        self.area = float(self.areas.sum())
        self.side = math.sqrt(self.area)
        self.neighbors = np.where(
            opposite >= 0, opposite // 3, np.arange(len(opposite)) // 3
        ).reshape(-1, 3)
        # The two half-edges of an edge lead in both directions; at a border, one stands for both.
        half_edges = np.concatenate([edges, np.flatnonzero(self.cut)]).astype(np.int32)
        back = np.flatnonzero(self.cut).astype(np.int32)
        starts = np.concatenate([self.tails[half_edges], self.heads[back]])
        ids = np.concatenate([half_edges, back])
        ends = np.concatenate([self.heads[half_edges], self.tails[back]])
        self.costs = self.lengths * np.where(self.may_cut, weights, 1.0)
        self.graph = EdgeGraph.build(len(self.points), starts, ends, (self.lengths * weights)[ids])
        lengths = np.where(self.may_cut, self.lengths, np.inf)[ids]
        self.plain = replace(self.graph, costs=lengths[self.graph.order])
        self._ids = ids[self.graph.order]
        self.mirror = None if plane is None else PathMirror(plane, self.points, self.graph)
        # From the nearest seam: by length, less where the cheapest path is dear for its length.
        lengths = np.full((3, len(self.points)), np.inf)
        paths = np.full((2, len(self.points)), -1, dtype=np.int32)
        self.distances, self.seam_lengths, self._path_costs = lengths
        self.before, self._nearest = paths
        self._state: list[AnyArray] = [self.cut, lengths, paths]
        self._reach_from(np.unique(np.concatenate([self.tails[back], self.heads[back]])))

    @property
    def has_seam(self) -> bool:
        return bool(self.cut.any())

    @property
    def seam_cost(self) -> float:
        """Weighted length of the seams, without the border of the surface."""
        return float(self.costs[self.cut & (self.opposite >= 0)].sum()) / 2.0

    def cut_to(self, vertex: int) -> bool:
        """Cut from the nearest seam to a vertex; return whether there is anything to cut."""
        if self.mirror is not None:
            instead = self.mirror.at_plane(vertex, float(self.seam_lengths[vertex]))
            vertex = instead if self.distances[instead] > 0.0 else vertex
        path = path_back(self.before, vertex)
        if self.mirror is not None and self.mirror.is_at_plane[vertex]:
            path = self.mirror.path_at_plane(self._seam_vertices(), vertex)
        self.cut_along(path)
        self.cut_image(path)
        return len(path) > 1

    def cut_image(self, path: list[int]) -> None:
        """Cut along the mirror image of a path, from its first vertex to the nearest seam."""
        if self.mirror is not None and len(path) > 1:
            end = int(self.mirror.image_of(path[0]))
            if self.distances[end] > 0.0:
                self.cut_along(self.mirror.image_path(path, self._seam_vertices(), end))

    def _seam_vertices(self) -> IntArray:
        return np.flatnonzero(self.distances == 0.0).astype(np.int32)

    def cut_along(self, path: list[int]) -> None:
        """Cut the edges between consecutive vertices."""
        for tail, head in pairwise(path):
            row = slice(self.graph.rows[tail], self.graph.rows[tail + 1])
            ids = self._ids[row][self.graph.ends[row] == head]
            ids = ids[self.opposite[ids] >= 0]
            self.cut[ids] = self.cut[self.opposite[ids]] = True
        self._reach_from(np.array(path))

    def seams(self) -> list[AnyArray]:
        """The seams so far, and what is nearest to them, for `restore`."""
        return [each.copy() for each in self._state]

    def restore(self, seams: list[AnyArray]) -> None:
        """Take cuts back."""
        for each, values in zip(self._state, seams, strict=True):
            each[:] = values

    def is_near(self, vertex: int) -> BoolArray:
        """(m,) faces around a vertex, up to half as far as the nearest seam, and their images."""
        ends = [vertex] if self.mirror is None else [vertex, self.mirror.image_of(vertex)]
        gaps = pm.norm(self.corners.mean(axis=1)[:, None] - self.points[ends], axis=2)
        return np.asarray(gaps.min(axis=1) <= _NEAR_DART * self.seam_lengths[vertex])

    def split_corners(self) -> tuple[IntArray, npt.NDArray[np.intp]]:
        """(m, 3) int32: vertices on either side of a seam, numbered; and a corner of each."""
        _, first, numbers = np.unique(self._corner_labels(), return_index=True, return_inverse=True)
        return numbers.reshape(-1, 3).astype(np.int32), first

    def _corner_labels(self) -> IntArray:
        edges = np.flatnonzero(~self.cut).astype(np.int32)
        across = self.opposite[edges]
        return merged_labels(
            len(self.cut),
            np.concatenate([edges, next_half_edges(edges)]),
            np.concatenate([next_half_edges(across), across]),
        )

    def _reach_from(self, sources: IntArray) -> None:
        sources = sources.astype(np.int32)
        self.graph.shorten(sources, self._path_costs, self.before)
        self.plain.shorten(sources, self.seam_lengths, self._nearest)
        self.distances[:] = self.seam_lengths
        dear = np.isfinite(self._path_costs) & (self._path_costs > self.seam_lengths)
        self.distances[dear] *= self.seam_lengths[dear] / self._path_costs[dear]


def _open_up(body: _Body) -> bool:
    """Make the first cuts of a closed surface; return whether it can be a disk then."""
    n_handles = (2 + len(body.lengths) // 2 - len(body.points) - len(body.vertices)) // 2
    if n_handles > _MOST_HANDLES:
        return False
    if n_handles > 0:
        for loop in _loops(body):
            body.cut_along(loop)
        return True
    start = _farthest(body.plain.paths_from(0)[0])
    distances = body.plain.paths_from(start)[0]
    before = body.graph.paths_from(start)[1]
    if body.mirror is not None and body.mirror.is_at_plane.any():
        return _open_halves(body, body.mirror, distances, before)
    path = path_back(before, _farthest(distances))
    body.cut_along(path)
    return len(path) > 2


def _open_halves(body: _Body, mirror: PathMirror, distances: FloatArray, before: IntArray) -> bool:
    """Cut from the plane to where `distances` are 0, and the mirror image; or along the plane."""
    at_plane = np.flatnonzero(mirror.is_at_plane)
    root = int(at_plane[distances[at_plane].argmin()])
    if distances[root] < _BESIDE * body.side:
        end = int(at_plane[np.where(np.isfinite(distances), distances, -1.0)[at_plane].argmax()])
        path = mirror.path_at_plane(np.array([root], dtype=np.int32), end)
        body.cut_along(path)
        return len(path) > 2
    path = path_back(before, root)[::-1]
    body.cut_along(path)
    body.cut_image(path)
    return len(path) > 2


def _farthest(distances: FloatArray) -> int:
    """The vertex with the greatest finite distance."""
    return int(np.where(np.isfinite(distances), distances, -1.0).argmax())


def _loops(body: _Body) -> list[list[int]]:
    """Loops through one vertex that cut all handles open, the shortest of several attempts."""
    best: tuple[float, list[list[int]]] = (math.inf, [])
    distances = np.full(len(body.points), np.inf)
    root = 0
    for _ in range(_ROOTS + 1):
        found, before = body.graph.paths_from(root)
        loops = _loops_at(body, found, before)
        steps = {tuple(sorted(pair)) for loop in loops for pair in pairwise(loop)}
        pairs = np.array(sorted(steps), dtype=np.int64).reshape(-1, 2)
        length = float(pm.norm(body.points[pairs[:, 0]] - body.points[pairs[:, 1]], axis=1).sum())
        if length < best[0]:
            best = length, loops
        distances = np.minimum(distances, found)
        root = _farthest(distances)
    return best[1]


def _loops_at(body: _Body, distances: FloatArray, before: IntArray) -> list[list[int]]:
    """Loops through the root of a tree of shortest paths: one per edge in neither of two trees."""
    half_edges = np.flatnonzero(body.opposite > np.arange(len(body.opposite)))
    tails, heads = body.tails[half_edges], body.heads[half_edges]
    is_free = (before[tails] != heads) & (before[heads] != tails)
    half_edges, tails, heads = half_edges[is_free], tails[is_free], heads[is_free]
    lengths = distances[tails] + distances[heads] + body.lengths[half_edges]
    lengths[~body.may_cut[half_edges]] = np.inf
    # A spanning tree of faces across the longest loops leaves the shortest that cut all handles.
    order = np.argsort(-lengths, kind="stable")
    faces = np.stack([half_edges // 3, body.opposite[half_edges] // 3], axis=1)[order]
    labels = list(range(len(body.vertices)))
    left = []
    for number, (one, other) in zip(order.tolist(), faces.tolist(), strict=True):
        while labels[one] != one:
            labels[one] = one = labels[labels[one]]
        while labels[other] != other:
            labels[other] = other = labels[labels[other]]
        if one == other:
            left.append(number)
        labels[max(one, other)] = min(one, other)
    return [
        [*path_back(before, int(tails[number]))[::-1], *path_back(before, int(heads[number]))]
        for number in left
    ]


@dataclass(frozen=True, eq=False)
class _Rough:
    """The seams of a body, its layout, and what it costs."""

    cut: BoolArray
    corner_uvs: FloatArray  # (m, 3, 2)
    cost: float


def _best_darts(body: _Body) -> _Rough | None:
    """Cut the darts that lower the cost; return the layout, which may overlap itself."""
    best: _Rough | None = None
    is_tried = np.zeros(len(body.vertices), dtype=bool)
    before, end, n_worse = body.seams(), -1, 0
    for _ in range(_MOST_DARTS):
        faces, first = body.split_corners()
        points = body.corners.reshape(-1, 3)[first]
        start = None if best is None else best.corner_uvs.reshape(-1, 2)[first]
        flat = flatten(points, faces, start, n_iterations=_STEPS, accuracy=_ROUGH)
        cost = math.inf if flat is None else _cost(body, flat)
        if flat is not None and (best is None or cost < best.cost):
            best, n_worse = _Rough(body.cut.copy(), flat.uvs[faces], cost), 0
        elif best is None:
            return None
        else:  # no dart to its neighborhood
            n_worse += 1
            body.restore(before)
            is_tried |= body.is_near(end)
        end = _most_stretched(body, best.corner_uvs, is_tried)
        before = body.seams()
        if n_worse > _PATIENCE or end < 0 or not body.cut_to(end):
            break
    return best


def _cost(body: _Body, flat: Flat) -> float:
    return (body.seam_cost / body.side + _OUTLINE) * float(pm.power(flat.energy / 4.0, _POWER))


def _most_stretched(body: _Body, corner_uvs: FloatArray, is_tried: BoolArray) -> int:
    """The vertex that a dart should lead to; -1 if all faces are tried or close to a seam."""
    excess = (face_energies(body.corners, corner_uvs) - 1.0) * body.areas
    areas = body.areas
    for _ in range(_SMOOTHINGS):
        excess = (excess + excess[body.neighbors].sum(axis=1)) / 4.0
        areas = (areas + areas[body.neighbors].sum(axis=1)) / 4.0
    distances = np.where(np.isfinite(body.distances), body.distances, 0.0)[body.vertices]
    density = np.divide(excess, areas, out=np.zeros_like(excess), where=areas > 0.0)
    is_far = ~is_tried & (distances.max(axis=1) >= _LEAST_DART * body.side)
    gains = np.where(is_far, density * distances.mean(axis=1), 0.0)
    face = int(gains.argmax())
    if gains[face] <= 0.0:
        return -1
    return int(body.vertices[face][distances[face].argmax()])


def _finished(body: _Body, rough: _Rough, n_faces: int | None) -> BodyLayout | None:
    """Relax a layout fully, and keep its first faces."""
    body.cut[:] = rough.cut
    faces, first = body.split_corners()
    points = body.corners.reshape(-1, 3)[first]
    flat = flatten(points, faces, rough.corner_uvs.reshape(-1, 2)[first], accuracy=_FINE)
    if flat is None:
        return None
    used, numbers = np.unique(faces[:n_faces], return_inverse=True)
    return BodyLayout(
        faces=numbers.reshape(-1, 3).astype(np.int32), flat=replace(flat, uvs=flat.uvs[used])
    )
