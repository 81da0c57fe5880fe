"""What a picture with adaptive samples tells of them, and of the time that it was given.

All errors are in steps of 1/255 of the sRGB-coded picture (`texbake.rendering.picture_error`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from texbake.time_budgets import TimeBudget

_TOLD_PERCENT = 1.0  # of pixels above the bound; less is seen in the report


@dataclass(frozen=True)
class PictureSampling:
    """What adaptive samples reached.

    Percentages are of the pixels that show a surface.

    Attributes
    ----------
    max_error : float, optional
        As asked for, or as the budget allowed; None where it allowed for nothing.
    shaded_percents : dict of int to float
        Cells of a pixel that were shaded, to the percent that had so many.
    seen_percents : dict of int to float
        The same of samples that were looked at, of which triangles in one cell share a shading.
    shadings_per_pixel : float
        Cells shaded in all, also those that finer ones took the place of, by these pixels.
    within_percent : float
        How many have an estimated error within the bound.
    estimated : dict of int to float
        Percent to an error that they do not exceed, as estimated.
    pixels_checked, samples_of_check : int
        Pixels that were sampled again with so many samples each, all shaded.
    measured : dict of int to float
        Percent of those to an error that they do not exceed, against that second look.
    measured_within_percent : float
        How many of those are within the bound.
    """

    max_error: float | None
    shaded_percents: dict[int, float]
    seen_percents: dict[int, float]
    shadings_per_pixel: float
    within_percent: float
    estimated: dict[int, float]
    pixels_checked: int
    samples_of_check: int
    measured: dict[int, float]
    measured_within_percent: float

    @property
    def warnings(self) -> list[str]:
        """Says so where the most samples were too few for many pixels."""
        if self.max_error is None or self.within_percent >= 100.0 - _TOLD_PERCENT:
            return []
        return [
            f"{100.0 - self.within_percent:.2f} % of the pixels are estimated to be off by more "
            f"than {self.max_error:.3g}/255 with 256 samples; use a greater --size, or look at "
            "what was measured"
        ]

    def table(self) -> list[tuple[str, str]]:
        """Rows of a label and a figure, for a person."""
        within = ""
        if self.max_error is not None:
            within = f", {self.measured_within_percent:.2f} % of them within {self.max_error:.3g}"
        return [
            (
                "shadings by pixel",
                f"{_shares(self.shaded_percents)}; {self.shadings_per_pixel:.2f} taken in the mean",
            ),
            ("samples by pixel", _shares(self.seen_percents)),
            (
                "error in steps of 255",
                f"estimated {_ends(self.estimated)}, checked on {self.pixels_checked:,} pixels "
                f"{_ends(self.measured)}{within}",
            ),
        ]


def _shares(percents: dict[int, float]) -> str:
    return ", ".join(f"{n}: {percent:.1f} %" for n, percent in percents.items())


def _ends(percentiles: dict[int, float]) -> str:
    if not percentiles:
        return "nothing"
    return " / ".join(f"{value:.3g}" for value in percentiles.values()) + " (median, p99, greatest)"


@dataclass(frozen=True)
class PictureCandidate:
    """One bound that the probe looked at; the seconds are of what comes after the probe."""

    max_error: float
    predicted_seconds: float


@dataclass(frozen=True)
class PictureBudget(TimeBudget[PictureCandidate]):
    """Which bound the time of a picture was turned into; see `TimeBudget`.

    Most of what comes before the choice is part of the picture itself.
    """

    work: ClassVar[str] = "the picture"
    first_part: ClassVar[str] = "up to the choice"
