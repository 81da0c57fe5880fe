"""How similar two pictures are: peak signal-to-noise ratio and structural similarity.

Based on: Wang, Bovik, Sheikh, Simoncelli, "Image quality assessment: from error visibility to
structural similarity", IEEE TIP 13(4), 2004; with a square window of equal weights, and variances
of samples, as scikit-image has them by default.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float32]

# Shares of the range of values that keep the quotients stable where a window is dark or flat.
_DARK = 0.01
_FLAT = 0.03


def peak_signal_to_noise(first: Floats, second: Floats) -> float:
    """PSNR in dB of values from 0 to 1; infinite if they are equal."""
    error = float(np.mean((first - second) ** 2, dtype=np.float64))
    return float(10 * np.log10(1.0 / error)) if error > 0.0 else math.inf


def structural_similarity(first: Floats, second: Floats, window: int) -> Floats:
    """(H, W, C) float32: SSIM of each pixel and channel.

    Parameters
    ----------
    first, second : (H, W, C) float32
        Values from 0 to 1.
    window : int
        Odd side of the window in pixels; at most H and W. At borders the pictures are reflected.
    """
    n = window * window
    sampled = n / (n - 1)
    mean1, mean2 = window_means(first, window), window_means(second, window)
    variance1 = sampled * (window_means(first * first, window) - mean1 * mean1)
    variance2 = sampled * (window_means(second * second, window) - mean2 * mean2)
    covariance = sampled * (window_means(first * second, window) - mean1 * mean2)
    dark, flat = _DARK**2, _FLAT**2
    alike = (2 * mean1 * mean2 + dark) * (2 * covariance + flat)
    whole = (mean1**2 + mean2**2 + dark) * (variance1 + variance2 + flat)
    return np.asarray(alike / whole, np.float32)


def window_means(picture: Floats, window: int) -> Floats:
    """(H, W, C) float32: mean over the window around each pixel, from running sums."""
    reach = window // 2
    for axis in range(2):
        lines = np.moveaxis(picture, axis, 0).astype(np.float64)
        lines = np.pad(lines, ((reach, reach), (0, 0), (0, 0)), mode="symmetric")
        sums = np.empty((len(lines) - 2 * reach, *lines.shape[1:]))
        sums[0] = 0.0
        for line in lines[:window]:
            sums[0] += line
        sums[1:] = lines[window:] - lines[:-window]
        means = np.cumsum(sums, axis=0) / window
        picture = np.moveaxis(means, 0, axis).astype(np.float32)
    return picture
