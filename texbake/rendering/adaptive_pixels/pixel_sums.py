"""Sums of samples per pixel, and of their squares, from which the variance follows.

Kernel: `core/sample_statistics.c`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.core import core
from texbake.mesh.mesh import FloatArray, IntArray

Float32Array = npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class PixelSums:
    """Sums over the samples of each pixel."""

    # light, squares (H, W, 4): sums of light and opacity, and of their squares. Light is composited
    # over the background, or over black.
    light: FloatArray
    squares: FloatArray
    covered: Float32Array  # (H, W): number of samples that show a surface
    counts: IntArray  # (H, W): number of samples

    @classmethod
    def empty(cls, height: int, width: int) -> PixelSums:
        """Return sums without any samples."""
        return cls(
            np.zeros((height, width, 4)),
            np.zeros((height, width, 4)),
            np.zeros((height, width), np.float32),
            np.zeros((height, width), np.int32),
        )

    @property
    def means(self) -> FloatArray:
        """(H, W, 4) float64 means; 0 where there is no sample."""
        return self.light / np.maximum(self.counts, 1)[..., None]

    @property
    def coverage(self) -> Float32Array:
        """(H, W) float32: share of the samples that show a surface."""
        return np.asarray(self.covered / np.maximum(self.counts, 1), np.float32)

    def add(self, pixels: IntArray, counts: Float32Array, light: Float32Array) -> None:
        """Add opaque fragments to their pixels, weighted by their numbers of samples."""
        core.add_fragments_squared(
            pixels, counts, light,
            self.light.reshape(-1, 4), self.squares.reshape(-1, 4), self.covered.reshape(-1),
        )  # fmt: skip

    def add_samples(
        self,
        light: Float32Array,
        passed: Float32Array,
        seen: npt.NDArray[np.bool_],
        behind: Float32Array,
        first_row: int,
        side: int,
    ) -> None:
        """Add the samples (h side, w side) of some rows of pixels, composited over `behind`.

        `behind` (H, W, 3) or (1, 1, 3) float32.
        """
        core.add_samples_squared(
            light, passed, seen, behind, first_row, side, self.light, self.squares, self.covered
        )

    def write_to(
        self,
        sums: PixelSums,
        corner: tuple[int, int],
        mask: npt.NDArray[np.bool_],
        behind: Float32Array | None,
        *,
        side: int,
        is_opaque: bool,
    ) -> None:
        """Write the masked pixels of a window to the sums of a whole picture.

        `behind` (h, w, 3) or (1, 1, 3) float32.
        """
        core.write_window(
            mask, *corner, side, _DARK if behind is None else behind, is_opaque, behind is not None,
            self.light, self.squares, self.covered, sums.light, sums.squares, sums.covered,
        )  # fmt: skip


_DARK = np.zeros((1, 1, 3), np.float32)
