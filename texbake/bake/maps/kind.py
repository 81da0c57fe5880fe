"""What a map is: a value for each hit, and how it is written."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.bake.hits import Hits
from texbake.bake.inputs import BakeInputs
from texbake.bake.options import BakeOptions

Float32Array = npt.NDArray[np.float32]


@dataclass(frozen=True)
class MapKind:
    """One kind of map.

    Attributes
    ----------
    name : str
        As `--maps` and file names have it.
    channels : int
        Values a texel.
    coding : str
        `normal` (unit vectors), `height` (one signed length) or `vector` (signed lengths): how
        values become the numbers of a file.
    values : callable
        (hits, inputs) to (n, channels) float32: the value of each hit. Misses are not among them.
    neutral : callable
        options to the value where nothing was baked.
    """

    name: str
    channels: int
    coding: str
    values: Callable[[Hits, BakeInputs], Float32Array]
    neutral: Callable[[BakeOptions], tuple[float, ...]]
