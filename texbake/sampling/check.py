"""The check of adaptive samples: some texels or pixels are sampled again, and the errors summed up.

They are drawn at random, but the same ones each time. Their second samples are several times as
many as most of them had, and lie elsewhere. The mean over these has an error of its own.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

CHECKED_SHARE = 0.01  # of the texels or pixels that have data
_SEED = 5
_PERCENTILES = (50, 99, 100)


def generator() -> np.random.Generator:
    """Return the random numbers of a check."""
    return np.random.default_rng(_SEED)


def n_to_check(n: int) -> int:
    """Return how many out of `n` texels or pixels are sampled again."""
    return int(np.ceil(CHECKED_SHARE * n))


@dataclass(frozen=True)
class ErrorSummary:
    """Errors of one map, or of a picture.

    Attributes
    ----------
    name : str
        Name of the map.
    unit : str
        Unit of the errors.
    bound : float, optional
        What the errors were to be within; None if they were not bounded.
    estimated : dict of int to float
        Percent of all texels or pixels, and the error that so many do not exceed, as estimated.
    measured : dict of int to float
        The same for those that were sampled again, by the difference to these other samples.
    measured_within_percent : float
        How many of the latter are within the bound.
    """

    name: str
    unit: str
    bound: float | None
    estimated: dict[int, float]
    measured: dict[int, float]
    measured_within_percent: float

    def row(self, n_checked: int, element: str) -> tuple[str, str]:
        """Return a label and the figures, for a person."""
        within = ""
        if self.bound is not None:
            within = f", {self.measured_within_percent:.2f} % of them within {self.bound:.4g}"
        return (
            f"error of {self.name}",
            f"estimated {_joined(self.estimated)} {self.unit}, checked on {n_checked:,} {element}s "
            f"{_joined(self.measured)}{within}",
        )


def percentiles_of(errors: npt.NDArray[Any], factor: float = 1.0) -> dict[int, float]:
    """Return percents and the errors, times a factor, that so many do not exceed; {} for none."""
    if not len(errors):
        return {}
    values = factor * np.percentile(errors, _PERCENTILES)
    return {percent: float(v) for percent, v in zip(_PERCENTILES, values, strict=True)}


def percent_within(errors: npt.NDArray[Any], bound: float | None) -> float:
    """Return how many errors are within a bound; 100 if there is no error or no bound."""
    if bound is None or not len(errors):
        return 100.0
    return 100.0 * int(np.count_nonzero(errors <= bound)) / len(errors)


def _joined(percentiles: dict[int, float]) -> str:
    if not percentiles:
        return "nothing"
    return " / ".join(f"{value:.3g}" for value in percentiles.values()) + " (median, p99, greatest)"
