"""Choosing an error bound for a time budget: the tightest bound predicted to fit by a short probe.

The probe refines some strips of rows for a series of ever tighter bounds, and the strips keep their
samples. The time for the whole picture is extrapolated in proportion to the rows. Two parts are not
extrapolated: the fixed time to rasterize a window, which is measured with a few single pixels, and
the estimation of errors, which already covers the whole picture.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from texbake.durations import parse_seconds
from texbake.rendering.adaptive_pixels.pixel_sums import PixelSums
from texbake.rendering.adaptive_pixels.recheck import AMONG, RUN, SIDE
from texbake.rendering.adaptive_pixels.sampler import BoolArray, Sides
from texbake.rendering.options import RenderOptions
from texbake.sampling.bounds import CODES, in_codes, parse_picture_bound
from texbake.sampling.report import CHECKED_SHARE
from texbake.sampling.time_budget import Candidate, TimeBudget, choose_bound

if TYPE_CHECKING:
    from texbake.rendering.adaptive_pixels.samples import AdaptivePicture

IdArray = npt.NDArray[np.int64]

# Tightest bound that is tried if `max_error` is not given: half of an 8-bit step.
_CLOSEST = 0.5 / CODES
_HALVINGS = 5  # of the bound, from the loosest to the tightest
_WIDEST = 0.25  # loosest bound that is tried
_STRIPS = 8
_STRIP_SHARE = 0.08  # share of the rows that the probe refines
_TIMED = 400  # number of pixels for timing the check


def choose_picture_bound(
    adaptive: AdaptivePicture, options: RenderOptions, start: float
) -> tuple[float | None, TimeBudget]:
    """Choose an error bound that is predicted to fit into `RenderOptions.time_budget`.

    Parameters
    ----------
    adaptive
        The picture with its first samples; some strips of it are refined.
    options
        Options with a time budget.
    start
        `time.perf_counter` when the work on the picture began.

    Returns
    -------
    bound : float, optional
        None if only the first samples fit.
    budget : TimeBudget
        Report on the choice, still without the actual time.
    """
    assert options.time_budget is not None
    seconds = parse_seconds(options.time_budget)
    closest = _CLOSEST if options.max_error is None else parse_picture_bound(options.max_error)
    ladder = [closest * 2.0**k for k in range(_HALVINGS, 0, -1)]
    ladder = [*(bound for bound in ladder if bound <= _WIDEST), closest]
    began = time.perf_counter()
    probe = _PictureProbe(adaptive)
    choice = choose_bound(
        ladder, probe.try_out, seconds, start=start, began=began, tries_first=False
    )
    settings = "16 samples per pixel, each pixel shaded once"
    if choice.bound is not None:
        settings = f"`max_error={in_codes(choice.bound)}`"
    predicted = probe.check_seconds if choice.predicted is None else choice.predicted
    budget = TimeBudget(
        work="the picture",
        seconds=seconds,
        choice=settings,
        why=choice.why,
        probe_seconds=choice.spent,
        predicted_seconds=choice.spent + predicted,
        candidates=choice.candidates,
    )
    return choice.bound, budget


class _PictureProbe:
    """Refines strips of a picture and predicts how long the rest of it would take.

    Attributes
    ----------
    check_seconds : float
        Predicted time of the check.
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
        checking, n_timed = self._time_checking(shown)
        n_windows = AMONG * CHECKED_SHARE * len(covered) / RUN
        self.check_seconds = (
            n_windows * self._window + checking * CHECKED_SHARE * n_covered / n_timed
        )
        self._taking = 0.0

    def try_out(self, bound: float) -> Candidate:
        """Refine the strips to a bound, which must be tighter than the ones before."""
        sampler = self._sampler
        before = sampler.seconds, sampler.n_windows
        start = time.perf_counter()
        self._adaptive.refine(bound, self._strips)
        whole = time.perf_counter() - start
        taking = sampler.seconds - before[0]
        windows = min((sampler.n_windows - before[1]) * self._window, taking)
        # The rest of the picture still has to pass through the looser bounds, too.
        self._taking += taking - windows
        seconds = whole - taking + windows + self._taking * self._growth + self.check_seconds
        return Candidate(in_codes(bound), predicted_seconds=seconds)

    def _time_windows(self, shown: IdArray) -> float:
        """Time the fixed cost of a window in seconds, with one pixel in each strip."""
        rows = shown // self._strips.shape[1]
        seconds, n_windows = self._take(shown[np.unique(rows, return_index=True)[1]], Sides(4, 1))
        return seconds / max(n_windows, 1)

    def _time_checking(self, shown: IdArray) -> tuple[float, int]:
        """Time the check of some pixels in seconds, without windows; also return their number."""
        some = shown[:: max(1, len(shown) // _TIMED)]
        seconds, n_windows = self._take(some, Sides(SIDE, SIDE))
        return max(seconds - n_windows * self._window, 0.0), max(len(some), 1)

    def _take(self, pixels: IdArray, sides: Sides) -> tuple[float, int]:
        """Sample some pixels and discard the result; return the seconds and the windows used."""
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
