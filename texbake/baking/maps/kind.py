"""What defines a map: the value of a hit, how the values of a texel are combined, its encoding.

Kernel: `core/barycentric.c`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.baking.hits import Hits
from texbake.baking.inputs import BakeInputs
from texbake.baking.options import BakeOptions
from texbake.core import core
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.parallel import run_bands

Float32Array = npt.NDArray[np.float32]


@dataclass(frozen=True)
class MapKind:
    """One kind of map.

    Attributes
    ----------
    name : str
        As in `BakeOptions.maps` and in file names.
    coding : str
        How values are encoded in files: `normal` (unit vectors), `height` (one signed length),
        `vector` (signed lengths), `position` (points, relative to `bounds`), `curvature` (one over
        a length; signed, or one-sided where `mid` is 0), `thickness` (a length of 0 or more),
        `color` (linear light; sRGB in 8 bits), `mask` (0 to 1, linear) or `id` (ids from 1 on, 0
        for none; a color per id in integer files).
    values : callable
        (hits, inputs) to (n, channels) float32: the value of each hit. The hits include misses only
        where `of_misses` is set.
    neutral : callable
        options to the value where nothing was baked.
    combine : str
        The value of a texel with several hits: `mean`, `unit mean` (of unit vectors, normalized
        again), or `first` (the first sample counts, as for ids).
    needs : str
        `hits`, or what else the map is made from: `outer rays` or `inner rays`, which start at the
        hits. `Hits.secondary` exists only if one of the maps needs such rays.
    of_misses : bool
        Misses count among the values of a texel, and a texel without any hit has a value.
    hides_misses : bool
        A texel without any hit gets the colors around it instead of the neutral value.
    of_neighbors : bool
        Also made from the neighbors of the faces that were hit, beyond their normals.
    noise : (float, float)
        Standard error of a texel's value v with one ray, as factors of sqrt(v (1 - v)) and of v. It
        is divided by n^(3/4) for n rays.
    mid : float
        Level of 0 in integer files of `curvature`.
    bounds : callable, optional
        inputs to the (2, 3) minimum and maximum coordinates that integer files can hold.
    legend : callable, optional
        inputs to the names that the ids from 1 on have.
    require : callable, optional
        Called with the inputs before any ray is cast; raises if they lack what the map needs.
    """

    name: str
    channels: int
    coding: str
    values: Callable[[Hits, BakeInputs], Float32Array]
    neutral: Callable[[BakeOptions], tuple[float, ...]]
    combine: str = "mean"
    needs: str = "hits"
    of_misses: bool = False
    hides_misses: bool = False
    of_neighbors: bool = False
    noise: tuple[float, float] = (0.0, 0.0)
    mid: float = 0.5
    bounds: Callable[[BakeInputs], FloatArray] | None = None
    legend: Callable[[BakeInputs], tuple[str, ...]] | None = None
    require: Callable[[BakeInputs], None] | None = None


_BAND = 1 << 15


def interpolated(
    hits: Hits, values: Float32Array, corners: IntArray, threads: int | None
) -> Float32Array:
    """Values of corners, interpolated linearly at the hits: (n, C) float32.

    `values` (N, C) float32; `corners` (F, 3) int32.
    """
    found = np.empty((len(hits), values.shape[1]), dtype=np.float32)

    def work(start: int, stop: int) -> None:
        band = slice(start, stop)
        core.interpolate_corners(
            hits.high_faces[band], hits.high_barycentrics[band], values, corners, found[band]
        )

    run_bands(work, len(hits), band=_BAND, threads=threads)
    return found
