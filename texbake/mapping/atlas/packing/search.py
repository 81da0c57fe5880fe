"""Dense layouts searched on a coarse grid: many orders of charts are tried, the best is squeezed.

1. Charts are placed one after another, in an order that changes step by step. A change is kept if
   the charts end no higher than they did some changes ago. Whenever they fit, they grow.
2. The grid shrinks by a row or a column at a time, and overlapping charts are moved apart, until
   that fails.

Time is measured in steps of work, so that the result does not depend on the machine.

Based on: Edmund K. Burke, Yuri Bykov, "The late acceptance hill-climbing heuristic", European
Journal of Operational Research 258, 2017 (which changes of the order are kept).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from texbake.core import core, portable_math as pm
from texbake.mapping.atlas.packing.bitmaps import ChartRotations, Outlines, Shapes, shapes_of
from texbake.mapping.atlas.packing.nearness import (
    mirrored_pairs,
    move_nearer,
    pose_directions,
    seam_distance,
)
from texbake.mapping.atlas.packing.refine import RoughLayout, SearchLimits, pair_weights, separate
from texbake.mesh.mesh import BoolArray, FloatArray, IntArray
from texbake.records import dataclass

_COARSE_CELLS = 256  # along each side of a square coarse grid
_N_POSES = 8  # per quarter turn, on the coarse grid
_TURNS = 4
_ANGLES = np.arange(_N_POSES) * (math.pi / 2.0 / _N_POSES)
_FIRST_FILL = 0.5
_SHRINK = 0.9  # factor of the scale until the charts fit
_NOISE = 0.15
_LEAST_GROWTH, _MOST_GROWTH = 1.004, 1.08  # factors of the area when charts fit

# Shares of the scale that mirror images are worth, and seams shorter by a side of the texture.
_MIRRORED_VALUE, _NEAR_VALUE = 0.01, 0.1

_SQUEEZE = SearchLimits(samples=40, radius=24, step=8, patience=300, work=400_000_000)


@dataclass(frozen=True, kw_only=True, eq=False)
class CoarseLayout:
    """Charts placed one after another on the coarse grid."""

    shapes: Shapes  # the charts in `_N_POSES` poses and four quarter turns
    poses: ChartRotations
    margin: float  # cells by which the shapes are enlarged
    angles: FloatArray  # (C, K) float64; of the poses, in radians
    places: IntArray  # (C, 3) int32; column, row and orientation
    areas: FloatArray  # (C,) float64; area of each chart in cells
    size: tuple[int, int]  # columns and rows of the grid
    cell_scale: float  # cells per unit
    scale: float  # texels per unit
    fixed: BoolArray  # (C,); mirror images of others, which keep their orientation


def coarse_layout(
    charts: Outlines, size: tuple[int, int], padding: int, *, most_work: int, seed: int
) -> CoarseLayout | None:
    """Search for an order in which charts can be placed at a large scale; None if none fits."""
    cell = math.sqrt(size[0] * size[1]) / _COARSE_CELLS
    # Charts are enlarged by half the distance that two of them must keep, so that they may touch:
    # on average 2 padding + 1 texels from outline to outline. They need not keep that half from
    # the border, so that the grid is enlarged as well.
    width, height = (max(int((length + 1) / cell), 1) for length in size)
    angles = charts.allowed(_ANGLES)
    poses = charts.turned(angles)
    areas = charts.areas
    strip = _Strip(poses, areas, (width, height), (padding + 0.5) / cell - 0.5, seed)
    first_scale = math.sqrt(_FIRST_FILL * width * height / areas.sum())
    found = _searched_order(strip, most_work, first_scale)
    if found is None:
        return None
    return CoarseLayout(
        shapes=found.shapes,
        poses=poses,
        margin=strip.margin,
        angles=angles,
        places=found.places,
        areas=areas * found.scale**2,
        size=(width, height),
        cell_scale=found.scale,
        scale=found.scale * cell,
        fixed=np.zeros(charts.n_charts, dtype=bool),
    )


def with_neighbors_near(draft: CoarseLayout, most_work: int) -> CoarseLayout:
    """Move charts of a draft near their neighbors, and turn them to mirror their mirror images.

    Pairs that succeed keep their orientations from then on.
    """
    neighbors = draft.poses.charts.neighbors
    assert neighbors is not None
    directions = pose_directions(draft.poses)
    places = move_nearer(
        draft.poses, draft.shapes, draft.places, directions, size=draft.size,
        scale=draft.cell_scale, margin=draft.margin, most_work=most_work,
    )  # fmt: skip
    return replace(draft, places=places, fixed=mirrored_pairs(neighbors, directions, places[:, 2]))


def squeeze_layout(draft: CoarseLayout, *, most_work: int, seed: int) -> RoughLayout:
    """Squeeze a draft into the smallest grid of about the same proportions that it fits into."""
    weights, shapes = pair_weights(draft.areas), _with_fixed(draft)
    places, across, up = _squeezed(shapes, draft.places, weights, draft.size, most_work, seed)
    charts = np.arange(len(places))
    places[:, 2] = np.where(draft.fixed, draft.places[:, 2], places[:, 2])
    boxes = draft.shapes.boxes[charts, places[:, 2]]
    neighbors, near = draft.poses.charts.neighbors, 0.0
    if neighbors is not None:
        n_pairs = max(int(np.count_nonzero(neighbors.partners >= 0)), 1)
        mirrored = np.count_nonzero(draft.fixed) / n_pairs
        distance = seam_distance(draft.poses, places, scale=draft.cell_scale, margin=draft.margin)
        near = _MIRRORED_VALUE * mirrored - _NEAR_VALUE * distance / max(across, up)
    scale = draft.scale * min(draft.size[0] / across, draft.size[1] / up)
    return RoughLayout(
        angles=draft.angles[charts, places[:, 2] // _TURNS]
        + places[:, 2] % _TURNS * (math.pi / 2.0),
        centers=(places[:, :2] + boxes / 2.0) / [across, up],
        scale=scale,
        fixed=draft.fixed,
        value=scale * (1.0 + near),
    )


def _with_fixed(draft: CoarseLayout) -> Shapes:
    """The shapes, of fixed charts in the orientation that they have and no other."""
    shapes = draft.shapes
    ids, kept = np.flatnonzero(draft.fixed), draft.places[draft.fixed, 2]
    boxes, starts = shapes.boxes.copy(), shapes.starts.copy()
    reach_starts = shapes.reach_starts.copy()
    for each in (boxes, starts, reach_starts):
        each[ids] = each[ids, kept][:, None]
    return shapes._replace(boxes=boxes, starts=starts, reach_starts=reach_starts)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Ordered:
    """Charts placed one after another, at a scale in cells per unit."""

    shapes: Shapes
    places: IntArray
    scale: float
    top: int


class _Strip:
    """Charts placed in a strip as wide as the grid but higher, at any number of scales."""

    def __init__(
        self,
        poses: ChartRotations,
        areas: FloatArray,
        size: tuple[int, int],
        margin: float,
        seed: int,
    ) -> None:
        self.poses, self.areas, self.margin, self.seed = poses, areas, margin, seed
        self.width, self.height = size
        self.work = 0
        self._shares = areas / areas.sum() / size[1]
        self.sizes = poses.extents[:, 0].sum(axis=1)
        random = np.random.default_rng(seed)
        noise = random.uniform(-_NOISE, _NOISE, len(areas)) if seed > 0 else 0.0
        self._order = np.argsort(-self.sizes * pm.exp(noise), kind="stable").astype(np.int32)
        self._places = np.zeros((len(areas), 3), dtype=np.int32)
        # A longer chart fits in no pose, and its bitmap could be of any size.
        self.longest_scale = max(size[0], 2 * size[1]) / poses.lengths().max()

    def placed(self, scale: float, most_work: int) -> _Ordered:
        """Place charts at a scale, in orders that change until they fit; `core/order_search.c`."""
        shapes = shapes_of(
            self.poses.bitmaps(scale, self.margin), np.zeros(1, dtype=np.int32), turns=_TURNS
        )
        work = np.empty(1, dtype=np.int64)
        top = core.search_orders(
            shapes.boxes, shapes.spans, shapes.starts, self._shares, 2 * self.height, self.width,
            self.height, most_work, self.seed + self.work, self._order, self._places, work,
        )  # fmt: skip
        self.work += self.poses.work + int(work[0])
        return _Ordered(shapes=shapes, places=self._places.copy(), scale=scale, top=top)


def _searched_order(strip: _Strip, most_work: int, first_scale: float) -> _Ordered | None:
    """Charts placed at the largest scale that fits in some order; None if none does."""
    best: _Ordered | None = None
    scale = min(first_scale, strip.longest_scale)
    while best is None or strip.work < most_work:
        tried = strip.placed(scale, most_work - strip.work if best is not None else 0)
        if tried.top <= strip.height:
            best = tried
            growth = min(max(pm.power(strip.height / tried.top, 0.9), _LEAST_GROWTH), _MOST_GROWTH)
            scale *= math.sqrt(growth)
        elif best is not None:
            break
        else:
            scale *= _SHRINK
            if scale * strip.sizes.max() < 1.0:
                return None
    return best


def _squeezed(
    shapes: Shapes,
    places: IntArray,
    weights: IntArray,
    size: tuple[int, int],
    most_work: int,
    seed: int,
) -> tuple[IntArray, int, int]:
    """Places on the smallest grid of about the same proportions that the charts fit into."""
    random = np.random.default_rng(seed)
    best, work, n_failed = (places, *size), 0, 0
    trial = 0
    while work < most_work:
        across, up = best[1:]
        if across / size[0] >= up / size[1]:
            across -= 1
        else:
            up -= 1
        places, fits = _fitted_in(shapes, places, (across, up))
        if not fits:
            return best
        trial += 1
        places, overlap, steps = separate(
            shapes, places, weights, size=(across, up), search=_SQUEEZE, seed=seed + trial
        )
        work += steps
        if overlap == 0:
            best, n_failed = (places.copy(), across, up), 0
            continue
        n_failed += 1
        if n_failed % 4 == 0:
            places = best[0].copy()
        places = _swapped(shapes, places, random)
    return best


def _fitted_in(shapes: Shapes, places: IntArray, size: tuple[int, int]) -> tuple[IntArray, bool]:
    """Move charts inside a grid, rotated if too long; also return whether all fit."""
    ids = np.arange(len(places))
    fitting: BoolArray = np.all(shapes.boxes <= np.array(size), axis=2)
    places = places.copy()
    places[:, 2] = np.where(fitting[ids, places[:, 2]], places[:, 2], fitting.argmax(axis=1))
    room = np.array(size) - shapes.boxes[ids, places[:, 2]]
    places[:, :2] = np.clip(places[:, :2], 0, room)
    return places, bool(fitting.any(axis=1).all())


def _swapped(shapes: Shapes, places: IntArray, random: np.random.Generator) -> IntArray:
    """Swap two of the larger charts, after moving one at a time has failed."""
    n = len(places)
    if n < 2:
        return places
    boxes = shapes.boxes[np.arange(n), places[:, 2]]
    large = np.argsort(-boxes.prod(axis=1), kind="stable")[: max(2, n // 2)]
    pair = random.choice(large, 2, replace=False)
    centers = places[pair, :2] + boxes[pair] // 2
    places = places.copy()
    places[pair, :2] = centers[::-1] - boxes[pair] // 2
    return places
