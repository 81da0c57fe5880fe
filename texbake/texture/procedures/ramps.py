"""The colors of marble, wood and granite, and their mean.

A ramp is a one-dimensional texture, interpolated between its stops in linear light. A pattern finer
than a pixel shows the mean of its colors, which is not the color of its mean value.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.texture.procedures import DEFAULT_RAMPS

# Number of values for the mean color; ramps have only a few stops.
_N_VALUES = 1 << 12


@dataclass(frozen=True, eq=False)
class Ramp:
    """Color ramp of a procedure."""

    # (k, 3) float64; linear RGB at evenly spaced values from 0 to 1. Read-only.
    stops: npt.NDArray[np.float64]
    # (3,) float64; mean color over the distribution of the procedure's values. Read-only.
    mean: npt.NDArray[np.float64]


@lru_cache(maxsize=16)
def own_ramp(name: str, distribution: str) -> Ramp:
    """Return the ramp of a procedure with values distributed `even` in [0, 1] or as a `sine`."""
    stops = np.array(DEFAULT_RAMPS[name])
    t = (np.arange(_N_VALUES) + 0.5) / _N_VALUES
    values = t if distribution == "even" else 0.5 + 0.5 * pm.sin(2.0 * np.pi * t)
    places = np.linspace(0.0, 1.0, len(stops))
    mean = np.array([pm.interp(values, places, channel).mean() for channel in stops.T])
    stops.flags.writeable = False
    mean.flags.writeable = False
    return Ramp(stops, mean)
