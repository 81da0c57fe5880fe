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

import numpy as np
import numpy.typing as npt

from texbake.mapping.atlas.packing.bins import Placed, place_charts
from texbake.mapping.atlas.packing.bitmaps import (
    Bitmaps,
    PackingGrid,
    Shapes,
    shapes_of,
)
from texbake.mapping.atlas.packing.poses import Outlines, Poses
from texbake.mapping.atlas.packing.settle import (
    RoughLayout,
    SearchLimits,
    pair_weights,
    separate,
)
from texbake.mesh.mesh import FloatArray, IntArray

_COARSE_CELLS = 256  # along each side of a square coarse grid
_N_POSES = 8  # per quarter turn, on the coarse grid
_TURNS = 4
_HISTORY = 20  # number of changes after which a score is compared again
_FIRST_FILL = 0.45
_NOISE = 0.15
# Fixed cost of placing all charts, in steps: for few charts it is nearly all of the cost.
_PLACING_STEPS = 50_000
_LEAST_GROWTH, _MOST_GROWTH = 1.004, 1.03  # factors of the area when charts fit

_SQUEEZE = SearchLimits(samples=40, radius=24, step=8, patience=300, work=400_000_000)


def search_layout(
    charts: Outlines,
    size: tuple[int, int],
    padding: int,
    *,
    orders_work: int,
    squeeze_work: int,
    seed: int,
) -> RoughLayout | None:
    """Search for a dense layout on a coarse grid; None if there is none."""
    cell = math.sqrt(size[0] * size[1]) / _COARSE_CELLS
    # Charts are enlarged by half the distance that two of them must keep, so that they may touch:
    # on average 2 padding + 1 texels from outline to outline. They need not keep that half from
    # the border, so that the grid is enlarged as well.
    width, height = (max(int((length + 1) / cell), 1) for length in size)
    turns = np.arange(_N_POSES) * (math.pi / 2.0 / _N_POSES)
    poses = charts.turned(np.repeat(turns[None], charts.n_charts, axis=0))
    strip = _Strip(poses, charts.areas(), (width, height), (padding + 0.5) / cell - 0.5)
    found = _searched_order(strip, orders_work, seed)
    if found is None:
        return None
    scale, bitmaps, placed = found
    shapes = shapes_of(bitmaps, np.zeros(1, dtype=np.int32), turns=_TURNS)
    orientations = placed.places[:, 2] * _TURNS + placed.places[:, 3]
    places = np.concatenate([placed.places[:, :2], orientations[:, None]], axis=1)
    weights = pair_weights(strip.areas * scale**2)
    places, across, up = _squeezed(shapes, places, weights, (width, height), squeeze_work, seed)
    boxes = shapes.boxes[np.arange(charts.n_charts), places[:, 2]]
    return RoughLayout(
        angles=turns[places[:, 2] // _TURNS] + places[:, 2] % _TURNS * (math.pi / 2.0),
        centers=(places[:, :2] + boxes / 2.0) / [across, up],
        scale=scale * min(width / across, height / up) * cell,
    )


class _Strip:
    """Charts placed in a strip as wide as the grid but higher, at any number of scales."""

    def __init__(
        self, poses: Poses, areas: FloatArray, size: tuple[int, int], margin: float
    ) -> None:
        self.poses, self.areas, self.margin = poses, areas, margin
        self.width, self.height = size
        self.work = 0
        self._grid = PackingGrid(
            width=size[0], height=2 * size[1], cell=1, half_widths=np.zeros(1, dtype=np.int32)
        )
        self._shares = areas / areas.sum() / size[1]
        first_scale = math.sqrt(_FIRST_FILL * size[0] * size[1] / areas.sum())
        # A longer chart fits in no pose, and its bitmap could be of any size.
        self.rescale(min(first_scale, max(size[0], 2 * size[1]) / poses.lengths().max()))

    def rescale(self, scale: float) -> None:
        """Make bitmaps of the charts at a scale, in cells per unit."""
        self.scale = scale
        self.bitmaps = self.poses.bitmaps(scale, self.margin)
        self.work += self.poses.work

    def place(self, order: IntArray) -> tuple[float, float, Placed]:
        """Place all charts; return the score (lower is better), the height and the places."""
        placed = place_charts(self.bitmaps, order, self._grid)
        self.work += placed.work + _PLACING_STEPS
        if placed.n_missing:
            return math.inf, math.inf, placed
        top = float(placed.tops.max())
        # Of two equally high layouts, the one with less area far up is likelier to become lower.
        return top + float(self._shares @ placed.tops), top, placed


def _searched_order(
    strip: _Strip, most_work: int, seed: int
) -> tuple[float, Bitmaps, Placed] | None:
    """Scale, bitmaps and places at the largest scale that fits in some order; None if none does."""
    random = np.random.default_rng(seed)
    sizes = strip.poses.extents[:, 0].sum(axis=1)
    noise = random.uniform(-_NOISE, _NOISE, len(sizes)) if seed > 0 else 0.0
    order = np.argsort(-sizes * np.exp(noise), kind="stable").astype(np.int32)
    score, top, placed = strip.place(order)
    while top > strip.height:
        if strip.scale * sizes.max() < 1.0:
            return None
        strip.rescale(strip.scale * 0.8)
        score, top, placed = strip.place(order)
    best, history, step = (strip.scale, strip.bitmaps, placed), [score] * _HISTORY, 0
    while strip.work < most_work:
        if top <= strip.height:
            best = (strip.scale, strip.bitmaps, placed)
            growth = min(max((strip.height / top) ** 0.9, _LEAST_GROWTH), _MOST_GROWTH)
            strip.rescale(strip.scale * math.sqrt(growth))
            score, top, placed = strip.place(order)
            history = [score] * _HISTORY
            continue
        changed = _changed(order, random)
        new_score, new_top, new_placed = strip.place(changed)
        if new_score <= max(score, history[step % _HISTORY]):
            order, score, top, placed = changed, new_score, new_top, new_placed
        history[step % _HISTORY] = score
        step += 1
    return best


def _changed(order: IntArray, random: np.random.Generator) -> IntArray:
    """Swap two charts of an order, or move one, mostly a short way."""
    n = len(order)
    i = int(random.integers(n))
    j = min(max(i + round(random.normal() * max(2.0, n / 6.0)), 0), n - 1)
    if random.random() < 0.5:
        changed = order.copy()
        changed[[i, j]] = order[[j, i]]
        return changed
    return np.insert(np.delete(order, i), j, order[i])


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
    fitting: npt.NDArray[np.bool_] = np.all(shapes.boxes <= np.array(size), axis=2)
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
