"""What a map is: a value for each hit, how the values of a texel become one, how it is written."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.baking.hits import Hits
from texbake.baking.inputs import BakeInputs
from texbake.baking.options import BakeOptions
from texbake.mesh.mesh import FloatArray

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
        How values become the numbers of a file: `normal` (unit vectors), `height` (one signed
        length), `vector` (signed lengths), `position` (points, coded into `bounds`), `curvature`
        (one over a length; signed, or one-sided where `mid` is 0), `thickness` (a length of 0 or
        more), `color` (linear light; sRGB in 8 bits), `mask` (0 to 1, linear) or `id` (numbers from
        1 on, 0 for none; a color for each in integer files).
    values : callable
        (hits, inputs) to (n, channels) float32: the value of each hit. Misses are not among them,
        but where `of_misses` is set.
    neutral : callable
        options to the value where nothing was baked.
    combine : str
        The value of a texel with several hits: `mean`, `unit mean` (of unit vectors, normalized
        again), or `first` (in the order of the samples; for numbers that stand for things).
    needs : str
        What of the trace: `hits`, or rays that start on the hits: `outer rays` or `inner rays`.
        `Hits.secondary` is there only if a map that is asked for needs any.
    of_misses : bool
        Misses count among the values of a texel, and a texel without any hit has a value.
    mid : float
        Level of 0 in integer files of `curvature`.
    bounds : callable, optional
        inputs to the (2, 3) least and greatest coordinates that integer files hold.
    legend : callable, optional
        inputs to the names of the things that numbers from 1 on stand for.
    require : callable, optional
        Told the inputs before any ray; raises where the map cannot be made of them.
    """

    name: str
    channels: int
    coding: str
    values: Callable[[Hits, BakeInputs], Float32Array]
    neutral: Callable[[BakeOptions], tuple[float, ...]]
    combine: str = "mean"
    needs: str = "hits"
    of_misses: bool = False
    mid: float = 0.5
    bounds: Callable[[BakeInputs], FloatArray] | None = None
    legend: Callable[[BakeInputs], tuple[str, ...]] | None = None
    require: Callable[[BakeInputs], None] | None = None
