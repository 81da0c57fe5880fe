"""Some texels once more, with other and more samples: whether estimated errors can be believed.

The second cast has `PER_SIDE` x `PER_SIDE` samples a texel. That is an odd number, so that but for
the very center none of them is one of the first cast's; it is a multiple of what most texels had.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from texbake.bake.cells import cell_samples
from texbake.bake.hits import NO_HIT, Hits
from texbake.bake.inputs import BakeInputs
from texbake.bake.maps.kind import MapKind
from texbake.bake.texels import SampleGrid, Samples, rasterize_uv, snap_uvs
from texbake.bake.trace import Casts, Trace

PER_SIDE = 7
_SHARE = 0.01  # of the texels
# They are taken from this many times as many, which lie in whole rows: few need be rasterized.
_ROWS = 5
_SEED = 5

BoolArray = npt.NDArray[np.bool_]
IdArray = npt.NDArray[np.int64]


class Recast:
    """A second cast of one texel of a hundred, chosen at random, always the same.

    Parameters
    ----------
    has_data : (height * width,) bool
        The texels to choose from.

    Attributes
    ----------
    texels : (n,) int64
        Row times width plus column, in order.
    n_samples : int
        Of each.
    """

    n_samples = PER_SIDE * PER_SIDE

    def __init__(self, trace: Trace, inputs: BakeInputs, casts: Casts, has_data: BoolArray) -> None:
        options = inputs.options
        self._inputs = inputs
        self._grid = SampleGrid(options.width_px, options.height_px, PER_SIDE)
        self.texels = _chosen(has_data.reshape(options.height_px, options.width_px))
        samples = self._samples()
        hits, lost = casts.look(samples)
        parts = [hits.where(hits.high_faces != NO_HIT)]
        if lost is not None:
            parts.append(casts.look_again([lost]))
        self._hits = Hits.joined(parts)

    def differences(self, kind: MapKind, means: npt.NDArray[np.float32]) -> npt.NDArray[np.float64]:
        """Lengths of the differences of a map's means (height * width, C) to those of this cast.

        One for each texel of which this cast hit anything.
        """
        values = kind.values(self._hits, self._inputs)
        places = self._hits.texel_ids // self.n_samples
        n = len(self.texels)
        counts = np.bincount(places, minlength=n)
        sums = np.stack(
            [np.bincount(places, values[:, c], minlength=n) for c in range(kind.channels)], axis=1
        )
        found = counts > 0
        mine = sums[found] / counts[found, np.newaxis]
        theirs = means[self.texels[found]].astype(np.float64)
        if kind.coding == "normal":
            mine, theirs = _units(mine), _units(theirs)
        return np.asarray(np.linalg.norm(mine - theirs, axis=1))

    def _samples(self) -> Samples:
        """The owned samples; their texel ids are places among all samples of the texels."""
        faces, threads = snap_uvs(self._inputs.low, self._grid), self._inputs.options.threads
        rows, columns = np.divmod(self.texels, self._grid.width)
        cells = np.arange(PER_SIDE)
        down = rows[:, np.newaxis] * PER_SIDE + cells
        right = columns[:, np.newaxis] * PER_SIDE + cells
        ids = down[:, :, np.newaxis] * self._grid.n_columns + right[:, np.newaxis, :]
        parts = []
        for row in np.unique(rows).tolist():
            first, last = np.searchsorted(rows, [row, row + 1]).tolist()
            owners, _ = rasterize_uv(faces, self._grid, range(row, row + 1), threads=threads)
            parts.append(
                cell_samples(
                    owners,
                    faces,
                    self._grid,
                    row * PER_SIDE,
                    ids[first:last].ravel(),
                    first * self.n_samples,
                    threads=threads,
                )
            )
        return Samples.joined(parts)


def _chosen(has_data: BoolArray) -> IdArray:
    """Ids of some texels, out of whole rows that are chosen first."""
    rng = np.random.default_rng(_SEED)
    by_row = np.count_nonzero(has_data, axis=1)
    n_wanted = int(np.ceil(_SHARE * by_row.sum()))
    order = rng.permutation(len(by_row))
    n_rows = 1 + int(np.searchsorted(np.cumsum(by_row[order]), _ROWS * n_wanted))
    chosen_rows = np.zeros(len(by_row), dtype=np.bool_)
    chosen_rows[order[:n_rows]] = True
    candidates = np.flatnonzero((has_data & chosen_rows[:, np.newaxis]).ravel())
    return np.sort(rng.choice(candidates, min(n_wanted, len(candidates)), replace=False))


def _units(vectors: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors / np.where(lengths > 0.0, lengths, 1.0)
