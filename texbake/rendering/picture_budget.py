"""The least error of a picture that is predicted to fit into a time, from a short probe of it.

The picture is laid out and its first samples are taken, which any bound needs. Then some strips of
rows are refined, for the widest of a ladder of bounds, then for closer ones, each half of the one
before. What that takes grows with the rows, beside what each window takes that is rasterized, which
a few single pixels tell, and the estimates of errors, which are those of the whole picture already.
The closest bound whose prediction fits is taken, and what the strips have got they keep.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from texbake.durations import parse_seconds
from texbake.rendering.options import RenderOptions
from texbake.rendering.picture_error import CODES, in_codes, parse_max_error
from texbake.rendering.picture_report import PictureBudget, PictureCandidate
from texbake.rendering.pixel_samples import BoolArray, Sides
from texbake.rendering.pixel_sums import PixelSums
from texbake.rendering.second_look import (
    AMONG,
    RUN,
    SHARE,
    SIDE,
)
from texbake.time_budgets import PROBE_SHARE, why_not

if TYPE_CHECKING:
    from texbake.rendering.adaptive import AdaptivePicture

IdArray = npt.NDArray[np.int64]

# The closest bound that a budget is spent on where none is asked for: half of an 8-bit step.
_CLOSEST = 0.5 / CODES
_HALVINGS = 5  # of the bound, from the widest to the closest
_WIDEST = 0.25  # beyond which no bound is worth looking at
_STRIPS = 8
_STRIP_SHARE = 0.08  # of the rows
_TIMED = 400  # pixels that the second look is timed with


def choose_bound(
    adaptive: AdaptivePicture, options: RenderOptions, start: float
) -> tuple[float | None, PictureBudget]:
    """Bound that is predicted to fit into `RenderOptions.time_budget`, and what was predicted.

    Parameters
    ----------
    adaptive
        With its first samples; some strips of it are refined.
    options
        With a time budget.
    start
        `time.perf_counter` when the work on the picture began.

    Returns
    -------
    bound : float, optional
        None where the first samples are all that fits.
    budget : PictureBudget
        Without the actual time.
    """
    assert options.time_budget is not None
    seconds = parse_seconds(options.time_budget)
    closest = _CLOSEST if options.max_error is None else parse_max_error(options.max_error)
    began = time.perf_counter()
    probe = _Probe(adaptive)
    candidates: list[PictureCandidate] = []
    chosen: tuple[float, float] | None = None
    why = "the closest bound of the ladder"
    for k in range(_HALVINGS, -1, -1):
        now = time.perf_counter()
        if now - began > PROBE_SHARE * (seconds - (began - start)):
            why = (
                "because looking at closer bounds would spend more of the budget"
                if candidates
                else "because these left no time to look at any bound"
            )
            break
        bound = closest * 2.0**k
        if bound > _WIDEST and k > 0:
            continue
        candidate = probe.candidate(bound)
        candidates.append(candidate)
        spent = time.perf_counter() - start
        reason = why_not(
            in_codes(bound), spent=spent, predicted=candidate.predicted_seconds, seconds=seconds
        )
        if reason is not None:
            why = reason
            break
        chosen = bound, candidate.predicted_seconds
    spent = time.perf_counter() - start
    choice = "16 samples of each pixel, shaded once" if chosen is None else in_codes(chosen[0])
    budget = PictureBudget(
        seconds=seconds,
        choice=choice if chosen is None else f"max-error {choice}",
        why=why,
        probe_seconds=spent,
        predicted_seconds=spent + (probe.check_seconds if chosen is None else chosen[1]),
        candidates=candidates,
    )
    return None if chosen is None else chosen[0], budget


class _Probe:
    """Refines strips of a picture, and tells how long the rest of it would take.

    Attributes
    ----------
    check_seconds : float
        What the second look will take.
    """

    def __init__(self, adaptive: AdaptivePicture) -> None:
        self._adaptive, self._sampler = adaptive, adaptive.sampler
        covered = adaptive.sums.covered > 0.0
        self._strips = _strips(*covered.shape)
        n_sampled = int(np.count_nonzero(covered & self._strips))
        n_covered = int(np.count_nonzero(covered))
        self._growth = (n_covered - n_sampled) / max(n_sampled, 1)
        self._scratch = PixelSums.empty(*covered.shape)
        shown = np.flatnonzero(covered & self._strips)
        self._window = min(self._time_windows(shown) for _ in range(2))
        looking, n_looked = self._time_looking(shown)
        n_windows = AMONG * SHARE * len(covered) / RUN
        self.check_seconds = n_windows * self._window + looking * SHARE * n_covered / n_looked
        self._taking = 0.0

    def candidate(self, bound: float) -> PictureCandidate:
        """Refine the strips to one bound, which is closer than those before it."""
        sampler = self._sampler
        before = sampler.seconds, sampler.n_windows
        start = time.perf_counter()
        self._adaptive.refine(bound, self._strips)
        whole = time.perf_counter() - start
        taking = sampler.seconds - before[0]
        windows = min((sampler.n_windows - before[1]) * self._window, taking)
        # What the strips took for wider bounds, the rest of the picture has yet to take.
        self._taking += taking - windows
        seconds = whole - taking + windows + self._taking * self._growth + self.check_seconds
        return PictureCandidate(max_error=CODES * bound, predicted_seconds=seconds)

    def _time_windows(self, shown: IdArray) -> float:
        """Seconds of a window, whatever is sampled in it: of one pixel in each strip."""
        rows = shown // self._strips.shape[1]
        seconds, n_windows = self._take(shown[np.unique(rows, return_index=True)[1]], Sides(4, 1))
        return seconds / max(n_windows, 1)

    def _time_looking(self, shown: IdArray) -> tuple[float, int]:
        """Seconds of a second look at some pixels, without their windows; and how many."""
        some = shown[:: max(1, len(shown) // _TIMED)]
        seconds, n_windows = self._take(some, Sides(SIDE, SIDE))
        return max(seconds - n_windows * self._window, 0.0), max(len(some), 1)

    def _take(self, pixels: IdArray, sides: Sides) -> tuple[float, int]:
        """Sample some pixels, and throw it away; seconds, and windows that it took."""
        wanted = np.zeros(self._strips.size, np.bool_)
        wanted[pixels] = True
        n_windows, start = self._sampler.n_windows, time.perf_counter()
        self._sampler.take(wanted.reshape(self._strips.shape), sides, self._scratch)
        return time.perf_counter() - start, self._sampler.n_windows - n_windows


def _strips(height: int, width: int) -> BoolArray:
    """(H, W) bool: rows of the probe, spread evenly."""
    n_rows = max(1, round(_STRIP_SHARE * height / _STRIPS))
    firsts = ((np.arange(_STRIPS) + 0.5) * height / _STRIPS).astype(int)
    rows = np.zeros(height, np.bool_)
    rows[np.minimum(firsts[:, None] + np.arange(n_rows), height - 1)] = True
    return np.repeat(rows[:, None], width, axis=1)
