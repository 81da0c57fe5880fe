"""What adaptive samples achieved: how many there are, and how far off the result is.

Some texels or pixels are sampled again, to see whether the estimated errors can be trusted. They
are drawn at random, but the same ones each time. Their second samples are several times as many as
most of them had, and lie elsewhere. The mean over these has an error of its own.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from texbake.mesh.mesh import AnyArray
from texbake.records import dataclass

CHECKED_SHARE = 0.01  # of the texels or pixels that have data
MOST_CHECKED = 2000  # standard error of a share of so many: 0.2 % at 1 %, 1.1 % at 50 %
_SEED = 5
_PERCENTILES = (50, 99, 100)
_REPORTED_PERCENT = 1.0  # fewer texels or pixels above the bound are not warned of


def check_random() -> np.random.Generator:
    """Return the random numbers of a check."""
    return np.random.default_rng(_SEED)


def n_to_check(n: int) -> int:
    """Return how many out of `n` texels or pixels are sampled again."""
    return min(int(np.ceil(CHECKED_SHARE * n)), MOST_CHECKED)


@dataclass(frozen=True)
class ErrorSummary:
    """Errors of one map, or of a picture."""

    name: str  # name of the map
    unit: str  # unit of the errors
    bound: float | None  # what the errors were to be within; None if they were not bounded
    # Percentages of all texels or pixels, and the estimated error that they do not exceed.
    estimated: dict[int, float]
    # The same for those that were sampled again, by the difference to these other samples.
    measured: dict[int, float]
    measured_within_percent: float  # how many of the latter are within the bound

    def row(self, n_checked: int, element: str) -> tuple[str, str]:
        """Return a label and the figures, for a person."""
        within = ""
        if self.bound is not None:
            within = f", {self.measured_within_percent:.2f} % of them within {self.bound:.4g}"
        return (
            f"error of {self.name}",
            f"estimated {_format_percentiles(self.estimated)} {self.unit}, "
            f"checked on {n_checked:,} {element}s {_format_percentiles(self.measured)}{within}",
        )


def percentiles_of(errors: AnyArray, factor: float = 1.0) -> dict[int, float]:
    """Return percentages, and the errors, times a factor, that they do not exceed; {} for none."""
    if not len(errors):
        return {}
    values = factor * np.percentile(errors, _PERCENTILES)
    return {percent: float(v) for percent, v in zip(_PERCENTILES, values, strict=True)}


def percent_within(errors: AnyArray, bound: float | None) -> float:
    """Return how many errors are within a bound; 100 if there is no error or no bound."""
    if bound is None or not len(errors):
        return 100.0
    return 100.0 * int(np.count_nonzero(errors <= bound)) / len(errors)


@dataclass(frozen=True, kw_only=True)
class SamplingReport:
    """What adaptive samples achieved; percentages are of the texels or pixels that have data."""

    # as given, or the default; None where a time budget left no time for any bound
    max_error: str | None
    # number of samples in a texel or pixel, and the percentage of them that have it
    sample_percents: dict[int, float]
    within_percent: float  # how many have an estimated error within every bound
    n_checked: int  # how many were sampled again, and with how many other samples each
    samples_of_check: int
    errors: tuple[ErrorSummary, ...]  # of each map that has a bound, or of the picture

    # What is sampled, and the most samples that one of it gets.
    element: ClassVar[str]
    most_samples: ClassVar[int]

    @property
    def warnings(self) -> list[str]:
        """One, if the most samples were too few for many texels or pixels."""
        if self.max_error is None or self.within_percent >= 100.0 - _REPORTED_PERCENT:
            return []
        return [
            f"{100.0 - self.within_percent:.2f} % of the {self.element}s are estimated to be off "
            f"by more than {self.max_error} with {self.most_samples} samples; raise the size, or "
            "accept a greater error"
        ]

    def table(self) -> list[tuple[str, str]]:
        """Rows of a label and a figure, for a person."""
        return [item.row(self.n_checked, self.element) for item in self.errors]


def format_percents(percents: dict[int, float]) -> str:
    """Write percents as `1: 93.0 %, 4: 7.0 %`."""
    return ", ".join(f"{n}: {percent:.1f} %" for n, percent in percents.items())


def _format_percentiles(percentiles: dict[int, float]) -> str:
    if not percentiles:
        return "nothing"
    return " / ".join(f"{value:.3g}" for value in percentiles.values()) + " (median, p99, greatest)"
