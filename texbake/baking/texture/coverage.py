"""The samples of a mesh's own atlas, some rows of texels after another, and means over texels."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.baking.options import BakeOptions
from texbake.baking.texels import (
    NO_FACE,
    TILE,
    SampleGrid,
    Samples,
    owned_samples,
    rasterize_uv,
    snap_uvs,
)
from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.progress import Stages
from texbake.texture.lookup import texel_coordinates

# Some 200 bytes each while photographs are looked up.
_SAMPLES_AT_ONCE = 1 << 19


@dataclass(frozen=True, eq=False)
class Band:
    """Rows of texels with their samples.

    Attributes
    ----------
    rows : range
    width : int
        Texels in a row.
    samples : Samples
        All that the mesh owns in these rows.
    """

    rows: range
    width: int
    samples: Samples

    def sums(
        self, values: npt.NDArray[np.floating], chosen: npt.NDArray[np.int64] | None = None
    ) -> FloatArray:
        """(len(rows) * width, C) float64: sums over the samples of each texel of (n, C) values.

        `chosen` are the samples that the values are of; None for all.
        """
        texels = self.samples.texel_ids if chosen is None else self.samples.texel_ids[chosen]
        n_texels = len(self.rows) * self.width
        places = texels - self.rows.start * self.width
        columns = [np.bincount(places, column, minlength=n_texels) for column in values.T]
        return np.stack(columns, axis=1)

    def counts(self) -> npt.NDArray[np.int64]:
        """(len(rows) * width,) int64: samples of each texel."""
        places = self.samples.texel_ids - self.rows.start * self.width
        return np.bincount(places, minlength=len(self.rows) * self.width)


class Coverage:
    """What of a texture a mesh covers, found row by row.

    Parameters
    ----------
    mesh : Mesh
    options : BakeOptions
        Size, samples and threads are taken from it.

    Attributes
    ----------
    texel_faces : (H, W) int32
        Face that owns the texel's first owned sample, `NO_FACE` for none; filled by `bands`.
    samples_overlapping : int
        Samples that several faces cover; filled by `bands`.
    faces_outside_tile : int

    Raises
    ------
    UvError
        The mesh has no texture coordinates, or they cover nothing.
    """

    def __init__(self, mesh: Mesh, options: BakeOptions) -> None:
        self.grid = SampleGrid(options.width_px, options.height_px, options.samples_per_side)
        self._snapped = snap_uvs(mesh, self.grid)
        self._threads = options.threads
        self.texel_faces: IntArray = np.full(
            (self.grid.height, self.grid.width), NO_FACE, dtype=np.int32
        )
        self.samples_overlapping = 0
        self.faces_outside_tile = self._snapped.n_outside_tile

    def bands(self, stages: Stages) -> Iterator[Band]:
        """Yield all rows with their samples, from the top down; shown as the stage "bake"."""
        grid, threads = self.grid, self._threads
        least = TILE // grid.per_side
        step = max(_SAMPLES_AT_ONCE // (grid.n_columns * grid.per_side) // least, 1) * least
        n_texels = grid.width * grid.height
        with stages.stage("bake", total=n_texels, unit="texels", recorded=False) as advance:
            for first in range(0, grid.height, step):
                rows = range(first, min(first + step, grid.height))
                with stages.part("rasterize"):
                    owners, n_overlaps = rasterize_uv(self._snapped, grid, rows, threads=threads)
                    samples = owned_samples(owners, self._snapped, grid, first, threads=threads)
                    self.samples_overlapping += n_overlaps
                    band = Band(rows, grid.width, samples)
                    self._note_faces(band)
                yield band
                advance(len(rows) * grid.width)

    def _note_faces(self, band: Band) -> None:
        texels = self.texel_faces.reshape(-1)
        # Written from last to first, so that the first sample of a texel stays.
        texels[band.samples.texel_ids[::-1]] = band.samples.faces[::-1]


def sample_steps(mesh: Mesh, corner_values: FloatArray, grid: SampleGrid) -> FloatArray:
    """How what is linear over each face changes from sample to sample.

    Parameters
    ----------
    mesh : Mesh
        With texture coordinates.
    corner_values : (F, 3, K) float64
        At the corners of each face; its positions for instance.
    grid : SampleGrid

    Returns
    -------
    (F, K, 2) float64
        By one sample to the right, and by one down. Zero for a face without area in the texture.
    """
    texels = texel_coordinates(mesh.corner_uvs(), grid.n_columns, grid.n_rows)
    along = corner_values[:, 1] - corner_values[:, 0]
    aside = corner_values[:, 2] - corner_values[:, 0]
    a, b = texels[:, 1] - texels[:, 0], texels[:, 2] - texels[:, 0]
    area = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    flat = area == 0.0
    area[flat] = 1.0
    right = (along * b[:, 1:] - aside * a[:, 1:]) / area[:, None]
    down = (aside * a[:, :1] - along * b[:, :1]) / area[:, None]
    steps = np.stack([right, down], axis=2)
    steps[flat] = 0.0
    return steps


def greatest_lengths(steps: FloatArray) -> FloatArray:
    """(F,) float64: how far a point moves at most by one sample in any direction.

    Of steps (F, 3, 2): the greatest singular value of each matrix.
    """
    a = np.einsum("ij,ij->i", steps[:, :, 0], steps[:, :, 0])
    b = np.einsum("ij,ij->i", steps[:, :, 0], steps[:, :, 1])
    c = np.einsum("ij,ij->i", steps[:, :, 1], steps[:, :, 1])
    return np.asarray(np.sqrt((a + c + np.hypot(a - c, 2.0 * b)) / 2.0))
