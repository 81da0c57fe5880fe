"""The texels that a mesh covers, with their samples, and how values change between samples."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from texbake.baking.options import BakeOptions
from texbake.baking.texels import NO_FACE, SampleGrid, TexelBand, owned_bands, snap_uvs
from texbake.core import portable_math as pm
from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.progress import Stages
from texbake.texture.lookup import texel_coordinates

# About 200 bytes each while photographs are looked up.
_SAMPLES_AT_ONCE = 1 << 19


class TextureCoverage:
    """The texels that a mesh covers, known in full once all `bands` have been read.

    Attributes
    ----------
    texel_faces : (H, W) int32
        Face that owns the texel's first owned sample, `NO_FACE` for none; filled by `bands`.
    samples_overlapping : int
        Samples that several faces cover; counted by `bands`.
    faces_outside_tile : int
        Faces with a corner outside the unit square.
    """

    def __init__(self, mesh: Mesh, options: BakeOptions) -> None:
        self.grid = SampleGrid(options.width_px, options.height_px, options.samples_per_side)
        self._faces = snap_uvs(mesh, self.grid)
        self._threads = options.threads
        self.texel_faces: IntArray = np.full(
            (self.grid.height, self.grid.width), NO_FACE, dtype=np.int32
        )
        self.samples_overlapping = 0
        self.faces_outside_tile = self._faces.n_outside_tile

    def bands(self, stages: Stages) -> Iterator[TexelBand]:
        """Yield the texels with their samples from the top down, as the stage "bake"."""
        for band in owned_bands(
            self._faces,
            self.grid,
            stages,
            samples_at_once=_SAMPLES_AT_ONCE,
            threads=self._threads,
        ):
            band.note_faces(self.texel_faces)
            self.samples_overlapping += band.n_overlaps
            yield band


def sample_steps(mesh: Mesh, corner_values: FloatArray, grid: SampleGrid) -> FloatArray:
    """Change of values that are linear over each face from one sample to the next.

    `corner_values` (F, 3, K) float64: values at the corners of each face, such as positions.
    Returns (F, K, 2) float64: change per sample to the right and per sample down; 0 for a face
    without area in the texture.
    """
    texels = texel_coordinates(mesh.corner_uvs(), grid.n_columns, grid.n_rows)
    along = corner_values[:, 1] - corner_values[:, 0]
    aside = corner_values[:, 2] - corner_values[:, 0]
    a, b = texels[:, 1] - texels[:, 0], texels[:, 2] - texels[:, 0]
    with np.errstate(over="ignore", invalid="ignore"):
        area = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
        flat = area == 0.0
        area[flat] = 1.0
        right = (along * b[:, 1:] - aside * a[:, 1:]) / area[:, None]
        down = (aside * a[:, :1] - along * b[:, :1]) / area[:, None]
    steps = np.stack([right, down], axis=2)
    steps[flat | ~np.isfinite(steps).all(axis=(1, 2))] = 0.0
    return steps


def greatest_lengths(steps: FloatArray) -> FloatArray:
    """Longest way that a point moves per sample, over all directions in the texture.

    `steps` (F, 3, 2) float64: of positions, from `sample_steps`. Returns (F,) float64: the greatest
    singular value of each matrix.
    """
    a = pm.vecdot(steps[:, :, 0], steps[:, :, 0])
    b = pm.vecdot(steps[:, :, 0], steps[:, :, 1])
    c = pm.vecdot(steps[:, :, 1], steps[:, :, 1])
    return np.asarray(np.sqrt((a + c + pm.hypot(a - c, 2.0 * b)) / 2.0))
