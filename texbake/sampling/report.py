"""What adaptive samples achieved: how many there are, and how far off the result is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from texbake.sampling.check import ErrorSummary

_REPORTED_PERCENT = 1.0  # fewer texels or pixels above the bound are not warned of


@dataclass(frozen=True, kw_only=True)
class SamplingReport:
    """What adaptive samples achieved; percentages are of the texels or pixels that have data.

    Attributes
    ----------
    max_error : str, optional
        As given, or the default; None where a time budget left no time for any bound.
    sample_percents : dict of int to float
        Number of samples in a texel or pixel, and the percent of them that have so many.
    within_percent : float
        How many have an estimated error within every bound.
    n_checked, samples_of_check : int
        How many were sampled again, and with how many other samples each.
    errors : tuple of ErrorSummary
        Of each map that has a bound, or of the picture.
    """

    max_error: str | None
    sample_percents: dict[int, float]
    within_percent: float
    n_checked: int
    samples_of_check: int
    errors: tuple[ErrorSummary, ...]

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


def listed(percents: dict[int, float]) -> str:
    """Write percents as `1: 93.0 %, 4: 7.0 %`."""
    return ", ".join(f"{n}: {percent:.1f} %" for n, percent in percents.items())
