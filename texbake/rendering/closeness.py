"""How close a picture of one mesh comes to that of another: angles, PSNR, SSIM, outlines, depths.

Kernel, which names the source of SSIM: `core/picture_closeness.c`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial

import numpy as np

from texbake.core import core, portable_math as pm
from texbake.mesh.mesh import BoolArray
from texbake.parallel import run_bands
from texbake.records import dataclass
from texbake.rendering.resolve import Frame
from texbake.texture.image import FloatImage

# Rows of pixels per band.
_BAND = 16


@dataclass(frozen=True, kw_only=True)
class Closeness:
    """How close one mesh comes to the high-poly mesh."""

    # Angles in degrees between the shading normals, over the pixels of all views whose center sees
    # the same part of both meshes (depths within 2 % of the diagonal of the joint bounding box).
    # NaN if there are no such pixels.
    mean_deg: float
    median_deg: float
    p95_deg: float
    # PSNR of the shaded, sRGB-coded picture of the view in the options, over the pixels that either
    # mesh touches; infinite for equal pictures
    psnr_db: float
    # mean structural similarity over the same pixels; None if it was not measured
    ssim: float | None
    # Among the pixel centers that see either mesh, the share that sees only one of them, and the
    # share that sees different parts. Of the other values, only PSNR and SSIM include these pixels.
    outline_mismatch: float
    depth_mismatch: float
    n_pixels: int  # number of pixels in the angle statistics

    def __str__(self) -> str:
        similar = "" if self.ssim is None else f"SSIM {self.ssim:.3f}, "
        return (
            f"normals {self.mean_deg:.2f}° off (median {self.median_deg:.2f}°, 95 % below "
            f"{self.p95_deg:.2f}°), PSNR {self.psnr_db:.1f} dB, {similar}"
            f"outline {100 * self.outline_mismatch:.2f} % off, "
            f"depth {100 * self.depth_mismatch:.2f} %"
        )


@dataclass(frozen=True, eq=False)
class ViewErrors:
    """Angles in degrees in one view (H, W), and how many pixels see either mesh, and both."""

    angles: FloatImage
    n_either: int
    n_both: int


def view_errors(
    high: Frame, low: Frame, depth_tolerance: float, *, threads: int | None = None
) -> ViewErrors:
    """Angles between the normals of two frames; NaN where different parts are seen."""
    angles = np.empty(high.coverage.shape, np.float32)
    counts = np.empty((high.height, 2), np.int64)
    kernel = partial(
        core.measure_angles, high.normals, low.normals, high.depths, low.depths, high.coverage,
        low.coverage, depth_tolerance, angles, counts,
    )  # fmt: skip
    run_bands(kernel, high.height, band=_BAND, threads=threads)
    n_either, n_both = counts.sum(axis=0).tolist()
    return ViewErrors(angles, n_either, n_both)


# A picture (H, W, 3), sRGB-coded, and the pixels (H, W) that its mesh touches.
Picture = tuple[FloatImage, BoolArray]


def measure_closeness(
    errors: Sequence[ViewErrors],
    high: Picture,
    low: Picture,
    *,
    ssim: bool,
    threads: int | None = None,
) -> Closeness:
    """Sum up the errors of all views, and compare the two pictures of one of them."""
    found = [error.angles[np.isfinite(error.angles)] for error in errors]
    angles = np.concatenate(found).astype(np.float64)
    n_either = max(sum(error.n_either for error in errors), 1)
    n_both = sum(error.n_both for error in errors)
    if len(angles):
        mean, (median, p95) = float(angles.mean()), np.percentile(angles, (50, 95))
    else:
        mean = median = p95 = math.nan
    (high_color, high_covered), (low_color, low_covered) = high, low
    seen = high_covered | low_covered
    squares = (high_color[seen] - low_color[seen]) ** 2
    square = float(squares.mean(dtype=np.float64)) if seen.any() else 0.0
    return Closeness(
        mean_deg=mean,
        median_deg=float(median),
        p95_deg=float(p95),
        psnr_db=-10.0 * pm.log10(square) if square else math.inf,
        ssim=_similarity(high_color, low_color, seen, threads) if ssim else None,
        outline_mismatch=sum(error.n_either - error.n_both for error in errors) / n_either,
        depth_mismatch=(n_both - len(angles)) / n_either,
        n_pixels=len(angles),
    )


def _similarity(
    first: FloatImage, second: FloatImage, seen: BoolArray, threads: int | None
) -> float:
    """Mean SSIM over the pixels that either mesh touches; NaN for pictures that are too small."""
    if np.array_equal(first[seen], second[seen]):
        return 1.0
    window = min(7, *(side - 1 + side % 2 for side in seen.shape))
    if window < 3:
        return math.nan
    return float(structural_similarities(first, second, window, threads=threads)[seen].mean())


# The constants of the paper for values from 0 to 1.
_C1, _C2 = 0.01**2, 0.03**2


def structural_similarities(
    first: FloatImage, second: FloatImage, window: int, *, threads: int | None = None
) -> FloatImage:
    """SSIM (H, W, C), 0 to 1, of the odd `window` around each pixel of two pictures."""
    similar = np.empty(first.shape, np.float32)
    kernel = partial(
        core.compare_structures, first, second, window, window**2 / (window**2 - 1), _C1, _C2,
        similar,
    )  # fmt: skip
    run_bands(kernel, len(first), band=_BAND, threads=threads)
    return similar
