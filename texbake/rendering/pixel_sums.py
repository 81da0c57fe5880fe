"""What pixels have gathered over their samples, with squares, which tell how they differ."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.kernels import kernel
from texbake.mesh.mesh import FloatArray, IntArray

Float32Array = npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class PixelSums:
    """What pixels have gathered over their samples.

    Attributes
    ----------
    light, squares : (H, W, 4) float64
        Sums of light and opacity, and of their squares, over the samples. Light is that over what
        shows behind surfaces, or over black.
    covered : (H, W) float32
        How many of them see a surface.
    counts : (H, W) int32
        How many there are.
    """

    light: FloatArray
    squares: FloatArray
    covered: Float32Array
    counts: IntArray

    @classmethod
    def empty(cls, height: int, width: int) -> PixelSums:
        """Return sums of no samples."""
        return cls(
            np.zeros((height, width, 4)),
            np.zeros((height, width, 4)),
            np.zeros((height, width), np.float32),
            np.zeros((height, width), np.int32),
        )

    @property
    def means(self) -> FloatArray:
        """(H, W, 4) float64: 0 where there is no sample."""
        return self.light / np.maximum(self.counts, 1)[..., None]

    @property
    def coverage(self) -> Float32Array:
        """(H, W) float32: share of the samples that see a surface."""
        return np.asarray(self.covered / np.maximum(self.counts, 1), np.float32)

    def add(self, pixels: IntArray, counts: Float32Array, light: Float32Array) -> None:
        """Add opaque fragments to their pixels, each as many times as it has samples."""
        _add_kernel(
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
        """Add samples, (h side, w side), of some rows of pixels, over what shows behind them.

        Parameters
        ----------
        light, passed, seen
            Light of each sample, the share of what lies behind that it lets through, and whether it
            sees a surface.
        behind : (H, W, 3) or (1, 1, 3) float32
        """
        _add_samples_kernel(
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
        """Write those pixels of a window that a mask has to the sums of a whole picture.

        Parameters
        ----------
        corner
            Row and column of the window's first pixel.
        behind : (h, w, 3) or (1, 1, 3) float32, optional
            Light at samples that see no surface; None where the sums have it.
        side
            Samples of a pixel along one side.
        is_opaque
            Whether all samples count as opaque, because something shows behind all surfaces.
        """
        _write_kernel(
            mask, *corner, side, _DARK if behind is None else behind, is_opaque, behind is not None,
            self.light, self.squares, self.covered, sums.light, sums.squares, sums.covered,
        )  # fmt: skip


_DARK = np.zeros((1, 1, 3), np.float32)


@kernel
def _add_kernel(pixels, counts, light, sums, squares, covered):  # type: ignore[no-untyped-def]
    for i in range(len(pixels)):
        pixel, count = pixels[i], np.float64(counts[i])
        for k in range(3):
            value = np.float64(light[i, k])
            sums[pixel, k] += count * value
            squares[pixel, k] += count * value * value
        sums[pixel, 3] += count
        squares[pixel, 3] += count
        covered[pixel] += counts[i]


@kernel
def _add_samples_kernel(  # type: ignore[no-untyped-def]
    light, passed, seen, behind, first_row, side, sums, squares, covered
):
    for j in range(light.shape[0]):
        row = first_row + j // side
        for i in range(light.shape[1]):
            column = i // side
            y = row if behind.shape[0] > 1 else 0
            x = column if behind.shape[1] > 1 else 0
            through = np.float64(passed[j, i])
            for k in range(4):
                value = 1.0 - through
                if k < 3:
                    value = light[j, i, k] + through * behind[y, x, k]
                sums[row, column, k] += value
                squares[row, column, k] += value * value
            if seen[j, i]:
                covered[row, column] += np.float32(1.0)


@kernel
def _write_kernel(  # type: ignore[no-untyped-def]
    mask, top, left, side, behind, is_opaque, shows_behind, light, squares, covered,
    light_out, squares_out, covered_out,
):  # fmt: skip
    """Write sums of masked pixels; samples of opaque surfaces see these or what is behind."""
    n = np.float64(side * side)
    for row in range(mask.shape[0]):
        for column in range(mask.shape[1]):
            if not mask[row, column]:
                continue
            j, i = top + row, left + column
            y = row if behind.shape[0] > 1 else 0
            x = column if behind.shape[1] > 1 else 0
            passed = n - light[row, column, 3] if shows_behind else 0.0
            for k in range(4):
                back = np.float64(behind[y, x, k]) if k < 3 else 0.0
                light_out[j, i, k] = light[row, column, k] + passed * back
                squares_out[j, i, k] = squares[row, column, k] + passed * back * back
            if is_opaque:
                light_out[j, i, 3] = squares_out[j, i, 3] = n
            covered_out[j, i] = covered[row, column]
