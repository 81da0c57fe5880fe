"""Directions of stripes, veins and trunks."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
import numpy.typing as npt


@lru_cache(maxsize=64)
def unit_vector(direction: tuple[float, float, float]) -> npt.NDArray[np.float64]:
    """(3,) float64, read-only: a direction that has a length, normalized."""
    vector = np.array(direction, np.float64) / math.hypot(*direction)
    vector.flags.writeable = False
    return vector
