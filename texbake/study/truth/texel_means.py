"""The mean normal over each texel, of far more rays than a bake casts for one.

What all rays find is added up before anything is normalized: means of means that are unit vectors
already would count parts in which normals differ for too much.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from texbake.baking.hits import Hits
from texbake.baking.inputs import BakeInputs
from texbake.baking.maps import MAPS
from texbake.baking.options import BakeOptions
from texbake.baking.trace import Trace
from texbake.mesh.mesh import FloatArray
from texbake.progress import Stages
from texbake.raycast.rays import NO_HIT
from texbake.study.case import Pair

# Fine texels along a side of each, and the samples of those: a grid of 16 x 16 in all.
_FINER, _SAMPLES = 2, 64
N_RAYS = _FINER**2 * _SAMPLES


def mean_normals(
    pair: Pair, size: int, *, threads: int | None = None
) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
    """Directions of the mean normals over the texels of a square map.

    Parameters
    ----------
    pair
        Traced as a bake with the default options does.
    size
        Texels a side.

    Returns
    -------
    means : (size, size, 3) float64
        Unit vectors in tangent space, of the covered part of a texel; 0 where nothing was hit.
    known : (size, size) bool
        Where there is one.
    """
    options = BakeOptions(size=_FINER * size, samples=_SAMPLES, threads=threads)
    inputs = BakeInputs(pair.high, pair.low, options)
    sums = np.zeros((size * size, 3))
    for hits in Trace(pair.high, pair.low, options, None, Stages()).hits():
        _add(hits.where(hits.high_faces != NO_HIT), inputs, size, sums)
    lengths = np.linalg.norm(sums, axis=1, keepdims=True)
    means = sums / np.where(lengths > 0.0, lengths, 1.0)
    return means.reshape(size, size, 3), (lengths > 0.0).reshape(size, size)


def _add(hits: Hits, inputs: BakeInputs, size: int, sums: FloatArray) -> None:
    """Add the normals of some hits, whose texels are the fine ones."""
    if not len(hits):
        return
    rows, columns = np.divmod(hits.texel_ids, _FINER * size)
    texels = (rows // _FINER) * size + columns // _FINER
    # A trace goes row by row, so that these are few of all texels.
    first, stop = int(texels.min()), int(texels.max()) + 1
    values = MAPS["normal"].values(hits, inputs)
    for axis in range(3):
        sums[first:stop, axis] += np.bincount(texels - first, values[:, axis], stop - first)
