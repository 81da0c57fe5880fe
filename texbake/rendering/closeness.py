"""How close a picture of one mesh comes to that of another: angles, PSNR, SSIM, outlines, depths.

Based on: Wang, Bovik, Sheikh, Simoncelli, "Image quality assessment: from error visibility to
structural similarity", IEEE TIP 13(4), 2004, for SSIM.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.rendering.resolve import Frame
from texbake.texture.image import FloatImage


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


def view_errors(high: Frame, low: Frame, depth_tolerance: float) -> ViewErrors:
    """Angles between the normals of two frames; NaN where different parts are seen."""
    either, both = (
        combine(high.coverage > 0, low.coverage > 0) for combine in (np.logical_or, np.logical_and)
    )
    same = both.copy()
    same[both] = np.abs(high.depths[both] - low.depths[both]) <= depth_tolerance
    first, second = high.normals[same].astype(np.float64), low.normals[same].astype(np.float64)
    # From the chord length, which is accurate for small angles where the arc cosine is not.
    apart = pm.norm(first - second, axis=1)
    angles = np.full(same.shape, np.nan, np.float32)
    angles[same] = np.degrees(2.0 * pm.arctan2(apart, pm.norm(first + second, axis=1)))
    return ViewErrors(angles, int(np.count_nonzero(either)), int(np.count_nonzero(both)))


# A picture (H, W, 3), sRGB-coded, and the pixels (H, W) that its mesh touches.
Picture = tuple[FloatImage, npt.NDArray[np.bool_]]


def measure_closeness(
    errors: Sequence[ViewErrors], high: Picture, low: Picture, *, ssim: bool
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
        ssim=_similarity(high_color, low_color, seen) if ssim else None,
        outline_mismatch=sum(error.n_either - error.n_both for error in errors) / n_either,
        depth_mismatch=(n_both - len(angles)) / n_either,
        n_pixels=len(angles),
    )


def _similarity(first: FloatImage, second: FloatImage, seen: npt.NDArray[np.bool_]) -> float:
    """Mean SSIM over the pixels that either mesh touches; NaN for pictures that are too small."""
    if np.array_equal(first[seen], second[seen]):
        return 1.0
    window = min(7, *(side - 1 + side % 2 for side in seen.shape))
    if window < 3:
        return math.nan
    return float(structural_similarities(first, second, window)[seen].mean())


# The constants of the paper for values from 0 to 1.
_C1, _C2 = 0.01**2, 0.03**2


def structural_similarities(first: FloatImage, second: FloatImage, window: int) -> FloatImage:
    """SSIM (H, W, C) of the windows around each pixel of two pictures (H, W, C), of 0 to 1.

    `window` is odd, in pixels. Variances are those of samples.
    """
    found = []
    for x, y in zip(np.moveaxis(first, 2, 0), np.moveaxis(second, 2, 0), strict=True):
        products = (x, y, x * x, y * y, x * y)
        mean_x, mean_y, xx, yy, xy = (_window_means(values, window) for values in products)
        unbiased = window**2 / (window**2 - 1)
        variances = unbiased * (xx - mean_x * mean_x) + unbiased * (yy - mean_y * mean_y)
        covariance = unbiased * (xy - mean_x * mean_y)
        alike = (2 * mean_x * mean_y + _C1) * (2 * covariance + _C2)
        found.append(alike / ((mean_x**2 + mean_y**2 + _C1) * (variances + _C2)))
    return np.stack(found, axis=2)


def _window_means(values: FloatImage, window: int) -> FloatImage:
    """Means over windows around the pixels of (H, W); pixels beyond an edge mirror those inside."""
    means = np.pad(values, window // 2, "symmetric")
    for _ in range(2):
        wide = means.astype(np.float64)
        sums = np.zeros_like(wide[window - 1 :])
        for i in range(window):
            sums += wide[i : i + len(sums)]
        means = (sums / window).astype(np.float32).T
    return means
