"""A picture refined in rounds, each to a closer bound, until its time is spent.

Each round begins with the first samples of all pixels, as a picture of its bound alone does, and
takes over all samples of the rounds before. What follows them, the check of the errors and writing
the picture, is timed on a few pixels and on the picture that the first samples give.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from texbake.core import portable_math as pm
from texbake.rendering.adaptive_pixels.pixel_statistics import Float32Array, PixelSums
from texbake.rendering.adaptive_pixels.recheck import SIDE, chosen_pixels
from texbake.rendering.adaptive_pixels.sampler import BoolArray, Sides
from texbake.rendering.options import RenderOptions
from texbake.sampling.bounds import CODES, format_codes, parse_picture_bound
from texbake.sampling.rounds import Rounds, spread_rows
from texbake.sampling.time_budget import BudgetClock, TimeBudget

if TYPE_CHECKING:
    from texbake.rendering.adaptive_pixels.samples import AdaptivePicture

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
        """Return estimated errors in closest bounds, and the work that each costs."""
        return _further(self._adaptive, self._closest)

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
        adaptive, clock, rounds = self._adaptive, self._clock, self._rounds
        n_covered = int(np.count_nonzero(adaptive.sums.covered > 0.0))
        rounds.unit = first_seconds / max((1.0 + 16.0 * float(_SEEN_COST)) * n_covered, 1.0)
        start = clock.spent
        self.predicted_errors()
        estimate = clock.spent - start
        self._window, check = _time_check(adaptive, clock)
        rounds.overhead = _ESTIMATES * estimate + _WINDOWS * self._window
        rounds.after = estimate + check + _time_finishing(adaptive, clock)
        rounds.expect_at_least(clock.spent + rounds.after + rounds.overhead)
        rounds.total = max(adaptive.sampler.work(float(_SEEN_COST)), 1.0)


def _further(adaptive: AdaptivePicture, closest: float) -> tuple[Float32Array, Float32Array]:
    """Errors in closest bounds, and what samples cost below them, for all pixels and next steps.

    Twice as many cells along a side halve the error of the shading; that of edges falls with the
    power of 1.5 of the samples along a side.
    """
    shaded, seen = (side.astype(np.float32) for side in (adaptive.shaded, adaptive.seen))
    shading = adaptive.shading_errors() / np.float32(closest)
    edges = adaptive.edge_errors() / np.float32(closest)
    errors, costs = [], []
    finer = 2.0
    while finer <= adaptive.finest:
        at = (shaded < finer) & (shading > 1.0)
        errors.append(shading[at] * (2.0 * shaded[at] / finer))
        costs.append(finer**2 + _SEEN_COST * np.maximum(seen[at], finer) ** 2)
        at = (seen < finer) & (edges > 1.0)
        errors.append(edges[at] * pm.power(2.0 * seen[at] / finer, 1.5))
        costs.append(shaded[at] ** 2 + _SEEN_COST * finer**2)
        finer *= 2.0
    return np.concatenate(errors), np.concatenate(costs)


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
