"""Refining a picture adaptively until its estimated error is below a bound.

docs/explanation/sampling.md describes the steps, of the shading and then of the edges, and the
rounds of a time budget. Each step is completed for all pixels before the next pixels are selected,
so the picture does not depend on the number of threads.

Based on: Whitted, "An Improved Illumination Model for Shaded Display", Communications of the ACM
23(6), 1980, for more samples where neighboring ones disagree. Here samples and shadings are refined
separately, because edges need the former and highlights the latter.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from texbake.core import portable_math as pm
from texbake.mesh.mesh import BoolArray, Float32Array, IntArray
from texbake.progress import Progress, Stages
from texbake.rendering.adaptive_pixels.pixel_statistics import (
    SIDE,
    PixelSums,
    Sides,
    chosen_pixels,
    code_means,
    edge_errors,
    recheck,
    shading_errors,
)
from texbake.rendering.adaptive_pixels.sampler import PixelCache, PixelSampler
from texbake.rendering.camera import Camera
from texbake.rendering.draw import Prepared, lay_out, shade_to_sums
from texbake.rendering.effect import RenderState
from texbake.rendering.options import RenderOptions
from texbake.rendering.resolve import Frame
from texbake.sampling.bounds import CODES, format_codes, parse_picture_bound
from texbake.sampling.rounds import BudgetClock, Rounds, TimeBudget, spread_rows, with_actual_time
from texbake.texture.image import FloatImage

FIRST = Sides(seen=4, shaded=1)
FINEST = 16  # samples, and shaded cells, along one side
# How often pixels that were shaded once are estimated again after their neighbors have changed.
_ROUNDS = 3


# Samples and shaded cells (H, W) along one side of each pixel, and how much the last refinement of
# its shading changed it.
PictureState = tuple[IntArray, IntArray, Float32Array]


class AdaptivePicture:
    """The samples of a picture while it is refined."""

    def __init__(self, state: RenderState, *, keeps: bool = False) -> None:
        shape = state.options.height, state.options.width
        self.sampler = PixelSampler(state)
        self._taker = PixelCache(self.sampler, shape) if keeps else self.sampler
        self.sums = PixelSums.empty(*shape)
        # (H, W): samples and shaded cells along one side of each pixel.
        self.seen = np.full(shape, FIRST.seen, np.int32)
        self.shaded = np.full(shape, FIRST.shaded, np.int32)
        self.codes = np.zeros((*shape, 4), np.float32)  # means, with sRGB-coded light
        self._changes = np.zeros(shape, np.float32)
        self.threads = state.threads

    def begin(self) -> None:
        """Take the first samples of all pixels."""
        self._take(np.ones(self.seen.shape, np.bool_), FIRST)
        self._code()

    @property
    def state(self) -> PictureState:
        """How finely pixels are sampled, to return to with `restore`."""
        return self.seen.copy(), self.shaded.copy(), self._changes.copy()

    def restart(self) -> None:
        """Return to the first samples of all pixels."""
        first = np.full_like(self.seen, FIRST.seen), np.full_like(self.shaded, FIRST.shaded)
        self.restore((*first, np.zeros_like(self._changes)))

    def restore(self, state: PictureState) -> None:
        """Return to an earlier state, with the samples that are kept."""
        seen, shaded, changes = state
        is_changed = (seen != self.seen) | (shaded != self.shaded)
        both = seen * (FINEST + 1) + shaded
        for number in np.unique(both[is_changed]).tolist():
            self._take(is_changed & (both == number), Sides(*divmod(number, FINEST + 1)))
        self._changes = changes.copy()
        self._code()

    def refine(self, bound: float) -> None:
        """Take samples until each pixel's estimated error, white being 1, is within a bound."""
        shaded = FIRST.shaded
        while shaded < FINEST:
            for _ in range(_ROUNDS if shaded == FIRST.shaded else 1):
                if not self._shade_finer(shaded, bound):
                    break
            shaded *= 2
        seen = FIRST.seen
        while seen < FINEST:  # edges with too large errors get four times as many samples
            wanted = (self.seen == seen) & (self.edge_errors() > bound)
            for side in np.unique(self.shaded[wanted]).tolist():
                self._take(wanted & (self.shaded == side), Sides(2 * seen, side))
            self._code()
            seen *= 2

    @property
    def color(self) -> FloatImage:
        """(H, W, 4) float32: mean light, not premultiplied, and opacity."""
        means = self.sums.means
        opacity = means[..., 3:]
        means[..., :3] /= np.where(opacity > 0.0, opacity, 1.0)
        return means.astype(np.float32)

    def errors(self) -> Float32Array:
        """(H, W) float32: estimated errors."""
        return np.maximum(self.edge_errors(), self.shading_errors())

    def _shade_finer(self, shaded: int, bound: float) -> bool:
        """Shade pixels with too large errors twice as finely; return whether there were any."""
        wanted = (self.shaded == shaded) & (self.shading_errors() > bound)
        if not wanted.any():
            return False
        seen = np.maximum(self.seen, 2 * shaded)
        for side in np.unique(seen[wanted]).tolist():
            self._take(wanted & (seen == side), Sides(side, 2 * shaded))
        before = self.codes[wanted]
        self._code()
        self._changes[wanted] = np.abs(self.codes[wanted] - before).max(axis=-1)
        return True

    def _take(self, wanted: BoolArray, sides: Sides) -> None:
        # Noted first, so that an interrupted picture can be restored.
        self.seen[wanted], self.shaded[wanted] = sides.seen, sides.shaded
        self._taker.take(wanted, sides, self.sums)

    def _code(self) -> None:
        code_means(self.sums, self.codes, threads=self.threads)

    def shading_errors(self) -> Float32Array:
        """(H, W) float32: estimated errors of the shading."""
        return shading_errors(self.codes, self.shaded, self._changes, threads=self.threads)

    def edge_errors(self) -> Float32Array:
        """(H, W) float32: estimated errors of edges."""
        return edge_errors(self.sums, threads=self.threads)


# The closest bound where none is given: a 16th of an 8-bit step.
_CLOSEST = 1.0 / 16.0 / CODES
_WIDEST = (CODES - 1.0) / CODES
# Seconds to estimate all errors of a round, in those to estimate them once; and its windows.
_ESTIMATES, _WINDOWS = 8.0, 10
# Measured: what rounds cost, as a multiple of what the errors predict.
_GROWTHS = 0.8, 1.0
# Work of one visibility sample, in that of one shaded cell.
_SEEN_COST = np.float32(1.0 / 16.0)
_TIMED_RUNS = 8  # windows that are timed
_TIMED_SHARE = 1 / 4  # of the check that is timed


class PictureRounds:
    """Refines a picture for as long as `RenderOptions.time_budget` allows."""

    def __init__(
        self,
        adaptive: AdaptivePicture,
        options: RenderOptions,
        clock: BudgetClock,
        first_seconds: float,
    ) -> None:
        assert options.time_budget is not None
        given = options.max_error
        self._adaptive, self._clock = adaptive, clock
        self._closest = _CLOSEST if given is None else parse_picture_bound(given)
        self._rounds = Rounds(options.time_budget, "the picture", clock, _GROWTHS)
        self._rounds.before = clock.spent - first_seconds
        self._state = adaptive.state  # of the last round that is complete
        self._window = 0.0  # seconds of a window without any pixels
        self._before = 0.0, 0.0  # what was taken before the round
        self._predict_least(first_seconds)

    def run(self) -> tuple[float, TimeBudget]:
        """Refine the picture; return the bound that was reached, and the report."""
        sampler = self._adaptive.sampler
        sampler.watch, sampler.now = self._watch, self._clock.now
        report = self._rounds.run(self)
        sampler.watch = None
        self._adaptive.restore(self._state)
        return parse_picture_bound(report.max_error), report

    def name_of(self, bound: float) -> str:
        """Return a bound as the value of `max_error`."""
        return format_codes(min(bound * self._closest, _WIDEST))

    def refine(self, bound: float) -> None:
        """Refine again from the first samples, with all that were taken since."""
        self._adaptive.restart()
        self._before = self.work_done()
        self._adaptive.refine(parse_picture_bound(self.name_of(bound)))
        self._state = self._adaptive.state

    def predicted_errors(self) -> tuple[Float32Array, Float32Array]:
        """Errors in closest bounds, and what samples cost below them, for all next steps."""
        shaded, seen = (
            side.astype(np.float32) for side in (self._adaptive.shaded, self._adaptive.seen)
        )
        shading = self._adaptive.shading_errors() / np.float32(self._closest)
        edges = self._adaptive.edge_errors() / np.float32(self._closest)
        errors, costs = [], []
        finer = 2.0
        while finer <= FINEST:
            at = (shaded < finer) & (shading > 1.0)
            errors.append(shading[at] * (2.0 * shaded[at] / finer))
            costs.append(finer**2 + _SEEN_COST * np.maximum(seen[at], finer) ** 2)
            at = (seen < finer) & (edges > 1.0)
            errors.append(edges[at] * pm.power(2.0 * seen[at] / finer, 1.5))
            costs.append(shaded[at] ** 2 + _SEEN_COST * finer**2)
            finer *= 2.0
        return np.concatenate(errors), np.concatenate(costs)

    def work_done(self) -> tuple[float, float]:
        """Return the work so far, and the seconds that pixels took without windows."""
        sampler = self._adaptive.sampler
        seconds = sampler.seconds - self._window * sampler.n_windows
        return sampler.work(float(_SEEN_COST)), seconds

    def _watch(self, n_pixels: int, sides: Sides) -> None:
        """Give a round up if its next window would take too long, as slow as those before it."""
        work = n_pixels * (sides.shaded**2 + float(_SEEN_COST) * sides.seen**2)
        done, seconds = np.subtract(self.work_done(), self._before).tolist()
        unit = max(self._rounds.unit, seconds / done if done > 0.0 else 0.0)
        self._rounds.check(self._window + unit * work)

    def _predict_least(self, first_seconds: float) -> None:
        """Predict what the fewest samples, and all that follows them, take."""
        adaptive, clock = self._adaptive, self._clock
        n_covered = int(np.count_nonzero(adaptive.sums.covered > 0.0))
        start = clock.spent
        self.predicted_errors()
        estimate = clock.spent - start
        self._window, check = _time_check(adaptive, clock)
        after = estimate + check + _time_finishing(adaptive, clock)
        self._rounds.learn_first(
            unit=first_seconds / max((1.0 + 16.0 * float(_SEEN_COST)) * n_covered, 1.0),
            total=max(adaptive.sampler.work(float(_SEEN_COST)), 1.0),
            overhead=_ESTIMATES * estimate + _WINDOWS * self._window,
            after=after,
        )


def _time_check(adaptive: AdaptivePicture, clock: BudgetClock) -> tuple[float, float]:
    """Time the fixed cost of a window; also predict the time of the check, from a part of it."""
    shows = adaptive.sums.covered > 0.0
    if not shows.any():
        return 0.0, 0.0
    # The fixed cost of a window, with one pixel in each; the first time loads what is needed.
    height, width = shows.shape
    rows = np.concatenate(spread_rows(height, _TIMED_RUNS, _TIMED_RUNS))
    shown = np.flatnonzero(shows)
    some = shown[np.isin(shown // width, rows)]
    some = shown[:1] if len(some) == 0 else some
    ones = np.zeros(shows.size, np.bool_)
    ones[some[np.unique(some // width, return_index=True)[1]]] = True
    timed = [
        _time_taking(adaptive, clock, ones.reshape(shows.shape), Sides(4, 1)) for _ in range(2)
    ]
    window = min(seconds / n_windows for seconds, n_windows in timed)
    checked = chosen_pixels(shows)
    # Rows that lie together, since those of the check share windows where they are close.
    rank = np.cumsum(np.count_nonzero(checked, axis=1)) / np.count_nonzero(checked)
    part = (
        checked & ((rank >= 0.5) & (rank <= max(0.5 + _TIMED_SHARE, rank[rank >= 0.5][0])))[:, None]
    )
    seconds, _ = _time_taking(adaptive, clock, part, Sides(SIDE, SIDE))
    return window, seconds * float(np.count_nonzero(checked) / np.count_nonzero(part))


def _time_taking(
    adaptive: AdaptivePicture, clock: BudgetClock, wanted: BoolArray, sides: Sides
) -> tuple[float, int]:
    """Sample some pixels and discard the result; return the seconds and the windows used."""
    sampler = adaptive.sampler
    n_windows, start = sampler.n_windows, clock.spent
    counts = sampler.n_shaded, sampler.n_seen
    sampler.take(wanted, sides, PixelSums.empty(*wanted.shape))
    sampler.n_shaded, sampler.n_seen = counts  # these are not part of the picture
    return clock.spent - start, sampler.n_windows - n_windows


def _time_finishing(adaptive: AdaptivePicture, clock: BudgetClock) -> float:
    """Time what the clock includes beside the picture itself, such as writing it."""
    if clock.finish is None:
        return 0.0
    seconds = []
    for _ in range(2):  # the first time loads what is needed
        start = clock.spent
        clock.finish(adaptive.color)
        seconds.append(clock.spent - start)
    return seconds[-1]


def draw_adaptively(
    prepared: Prepared,
    camera: Camera,
    *,
    keep: Collection[str] = (),
    progress: Progress = None,
    clock: BudgetClock | None = None,
) -> Frame:
    """Draw a picture to a given error bound or within a time budget; see `draw` for `keep`."""
    clock = clock or BudgetClock()
    options, stages = prepared.options, Stages(progress)
    state = lay_out(prepared, prepared.request(camera, keep), stages, all_objects=True)
    adaptive = AdaptivePicture(state, keeps=options.time_budget is not None)
    coverage: FloatImage | None = None
    normals: FloatImage | None = None
    if "normals" in keep:  # before the first samples, so that its time is known
        with stages.stage("shade normals"):
            _, coverage, normals = shade_to_sums(state).finish(None, threads=state.threads)
    start = clock.spent
    with stages.stage("shade"):
        adaptive.begin()
    budget: TimeBudget | None = None
    with stages.stage("refine"):
        if options.time_budget is not None:
            seconds = clock.spent - start
            bound, budget = PictureRounds(adaptive, options, clock, seconds).run()
        else:
            assert options.max_error is not None
            bound = parse_picture_bound(options.max_error)
            adaptive.refine(bound)
    with stages.stage("check errors"):
        sampling = recheck(adaptive, bound)
    if budget is not None:
        budget = with_actual_time(budget, clock)
    return Frame(
        color=adaptive.color,
        coverage=adaptive.sums.coverage if coverage is None else coverage,
        plan=state.plan,
        costs=state.costs,
        _visibility=state.visible.visibility,
        _near=camera.near,
        _normals=normals,
        sampling=sampling,
        budget=budget,
    )
