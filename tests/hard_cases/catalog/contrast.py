"""A naive formula beside ours on the same hard input, with the same measure of error."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True, kw_only=True, eq=False)
class Contrast:
    """A naive formula and ours: their errors and their times.

    Attributes
    ----------
    name, wrong : str
        The case, and what goes wrong.
    unit : str
        What is measured; 0 is right.
    prepare : function
        Makes the input of both.
    naive, ours : function
        From the input to a result; timed.
    error : function
        From the input and a result to a figure, in `unit`.
    bound : float
        Ours is to be at most this, and the naive result above it.
    why : str
        The reason for the bound.
    alike : bool
        Whether both do the same work, so that their times can be compared: not where ours is a
        whole picture and the naive formula a line.
    """

    name: str
    wrong: str
    unit: str
    prepare: Callable[[], Any]
    naive: Callable[[Any], Any]
    ours: Callable[[Any], Any]
    error: Callable[[Any, Any], float]
    bound: float
    why: str
    alike: bool = True

    def measured(self) -> tuple[float, float]:
        """Errors of the naive result and of ours; NaN counts as infinite."""
        data = self.prepare()
        with np.errstate(all="ignore"):
            naive = float(self.error(data, self.naive(data)))
        ours = float(self.error(data, self.ours(data)))
        return (naive if naive == naive else np.inf), (ours if ours == ours else np.inf)

    def seconds(self, rounds: int = 7) -> tuple[float, float]:
        """Least time of either, over alternating rounds."""
        data = self.prepare()
        functions = (self.naive, self.ours)
        best = [np.inf, np.inf]
        with np.errstate(all="ignore"):
            for function in functions:
                function(data)  # compiles, and warms the caches
            for _ in range(rounds):
                for i, function in enumerate(functions):
                    start = time.perf_counter()
                    function(data)
                    best[i] = min(best[i], time.perf_counter() - start)
        return best[0], best[1]


def not_finite(_: Any, result: Any) -> float:
    """Number of results that are not finite."""
    return float(np.count_nonzero(~np.isfinite(np.asarray(result)).reshape(len(result), -1).all(1)))


def degrees_between(a: Any, b: Any) -> Any:
    """Angles between unit vectors, exact near 0 and 180 as well."""
    a, b = np.asarray(a, np.float64), np.asarray(b, np.float64)
    sines = np.linalg.norm(np.cross(a, b), axis=-1)
    return np.degrees(np.arctan2(sines, np.einsum("...i,...i->...", a, b)))
