"""Convert values to the integer codes of a file and back, with exact rounding.

A code is `floor(x + 1/2)` of the exact x, computed in float64, where the product of a float32 and a
16-bit factor is exact.

Based on: glTF 2.0, section 3.9.3, for n = 2x - 1 and +Y ("opengl"); IEC 61966-2-1 for sRGB.
Departs from plain rounding for flat normals: (0, 0, 1) has x and y halfway between two codes (127.5
or 32767.5), so the float32 noise of a transform to tangent space and back, about 1e-6, would
scatter it over both. A component of at most 4e-6 therefore counts as 0, which rounds up: flat is
exactly (128, 128, 255) or (32768, 32768, 65535) in both conventions. Half a 16-bit step is 15e-6,
so no other code changes.

Kernel of ranges and clipped values: `core/value_range.c`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial

import numpy as np
import numpy.typing as npt

from texbake.core import core, portable_math as pm
from texbake.errors import OptionError, require_known
from texbake.mesh.mesh import AnyArray, BoolArray, Float32Array, FloatArray, Int64Array
from texbake.parallel import run_bands

_CONVENTIONS = ("opengl", "directx")
_FLAT_NOISE = 4e-6
# Floats between the least linear value of a code and the exact one, at most; a power of two.
_SRGB_ERROR = 32

# Texels per band: a few milliseconds of work.
_BAND = 1 << 19


def _quantized(
    values: AnyArray,
    bits: int,
    factors: FloatArray,
    offsets: FloatArray,
    threads: int | None,
    *,
    lows: FloatArray | None = None,
    sizes: FloatArray | None = None,
    noise: float = 0.0,
) -> AnyArray:
    """Codes of values by a factor and an offset for 1 to 4 channels; `core/quantization.c`."""
    flat = np.require(values, np.float32, ["C", "A"]).reshape(-1, len(factors))
    codes = np.empty(flat.shape, code_type(bits))
    quantize = core.quantize_u8 if bits == 8 else core.quantize_u16
    work = partial(quantize, flat, factors, offsets, lows, sizes, codes, noise, max_code(bits))
    run_bands(work, len(flat), band=_BAND, threads=threads)
    return codes.reshape(values.shape)


def max_code(bits: int) -> int:
    """Return the greatest code of 8 or 16 bits; raise `OptionError` for other bits."""
    if bits not in (8, 16):
        raise OptionError(f"bits: integer codes have 8 or 16 bits, not {bits}")
    return (1 << bits) - 1


def code_type(bits: int) -> type[np.uint8] | type[np.uint16]:
    """Return the integer type of codes of 8 or 16 bits."""
    return np.uint8 if max_code(bits) == 255 else np.uint16


def quantize_unsigned(values: AnyArray, bits: int, *, threads: int | None = None) -> AnyArray:
    """Quantize values (..., C) in [0, 1] to the nearest codes; halves round up."""
    factors = np.full(1, float(max_code(bits)))
    return _quantized(np.atleast_1d(values), bits, factors, np.zeros(1), threads)


def quantize_srgb(
    linear: AnyArray, bits: int, *, n_colors: int | None = None, threads: int | None = None
) -> AnyArray:
    """Quantize linear values (..., C) as sRGB to the nearest codes; halves round up."""
    n_channels = linear.shape[-1]
    n_colors = n_channels if n_colors is None else n_colors
    flat = np.require(linear, np.float32, ["C", "A"]).reshape(-1, n_channels)
    codes = np.empty(flat.shape, code_type(bits))
    quantize = core.quantize_srgb_u8 if bits == 8 else core.quantize_srgb_u16
    work = partial(quantize, flat, *_srgb_thresholds(bits), codes, n_colors)
    run_bands(work, len(flat), band=_BAND, threads=threads)
    return codes.reshape(linear.shape)


@cache
def _srgb_thresholds(bits: int) -> tuple[Float32Array, npt.NDArray[np.uint16]]:
    """Least linear value of each sRGB code from 1 on, and the code where each half word begins.

    The codes are those of `encode_srgb`, so that the thresholds lie a few floats beside the exact
    ones. The second table, (16257,), has a row for each upper half of the bits of floats up to 1.
    """
    top = max_code(bits)
    middles = (np.arange(top) + 0.5) / top
    exact = decode_srgb(middles).astype(np.float32).view(np.uint32)
    below, reached = exact - np.uint32(_SRGB_ERROR), exact + np.uint32(_SRGB_ERROR)
    for _ in range(_SRGB_ERROR.bit_length()):  # halve 2 * _SRGB_ERROR floats down to 1
        between = below + (reached - below) // 2
        levels = encode_srgb(between.view(np.float32)).astype(np.float64)
        is_reached = levels * top >= middles * top
        below[~is_reached] = between[~is_reached]
        reached[is_reached] = between[is_reached]
    thresholds = reached.view(np.float32)
    halves = np.arange(1 + (np.float32(1.0).view(np.uint32) >> 16), dtype=np.uint32) << 16
    first_codes = np.searchsorted(thresholds, halves.view(np.float32), side="right")
    return thresholds, first_codes.astype(np.uint16)


def quantize_points(
    points: AnyArray, low: FloatArray, high: FloatArray, bits: int, *, threads: int | None = None
) -> AnyArray:
    """Codes of points (..., 3) between two corners; 0 along an axis without extent."""
    sizes = np.where(high > low, high - low, 1.0)
    factors = np.full(3, float(max_code(bits)))
    return _quantized(points, bits, factors, np.zeros(3), threads, lows=low, sizes=sizes)


def color_ids(ids: Float32Array, colors: AnyArray, *, threads: int | None = None) -> AnyArray:
    """Give each of the ids (H, W) its color, (n, 3) uint8 or uint16: (H, W, 3); NaN the first."""
    flat = np.ascontiguousarray(ids).reshape(-1)
    codes = np.empty((len(flat), 3), colors.dtype)

    def work(start: int, stop: int) -> None:
        rows = np.minimum(np.fmax(flat[start:stop], 0), len(colors) - 1).astype(np.intp)
        np.take(colors, rows, axis=0, out=codes[start:stop], mode="clip")

    run_bands(work, len(flat), band=_BAND, threads=threads)
    return codes.reshape(*ids.shape, 3)


def unit_normals(vectors: Float32Array) -> Float32Array:
    """Normalize mean normals (..., 3); (0, 0, 1) where they cancel out."""
    lengths = pm.norm(vectors, axis=-1, keepdims=True)
    lost = ~(lengths > 0)
    unit: Float32Array = np.where(
        lost, np.array([0, 0, 1], np.float32), vectors / np.where(lost, 1, lengths)
    )
    return unit


def encode_normals(
    normals: AnyArray, *, bits: int, convention: str = "opengl", threads: int | None = None
) -> AnyArray:
    """Encode unit vectors (..., 3) as the colors of a normal map, (n + 1) / 2."""
    signs = np.array([1.0, _green_sign(convention), 1.0])
    if bits == 32:
        return np.asarray(normals, np.float32) * (0.5 * signs).astype(np.float32) + np.float32(0.5)
    half = 0.5 * max_code(bits)
    offsets = np.full(3, half)
    return _quantized(normals, bits, half * signs, offsets, threads, noise=_FLAT_NOISE)


def decode_normals(
    pixels: AnyArray, *, convention: str = "opengl", threads: int | None = None
) -> Float32Array:
    """(..., 3) unit vectors 2x - 1 of the colors of a normal map; (0, 0, 1) without a direction.

    A flat 8-bit texel is 0.318 degrees off the axis, as in renderers: no integer code is exactly 0.
    """
    sign = _green_sign(convention)
    top = np.iinfo(pixels.dtype).max if pixels.dtype.kind == "u" else 1.0
    flat = pixels.reshape(-1, pixels.shape[-1])
    normals = np.empty((len(flat), 3), np.float32)

    def work(start: int, stop: int) -> None:
        vectors = flat[start:stop, :3] * (2.0 / top) - 1.0
        vectors[:, 1] *= sign
        lengths = np.sqrt(pm.vecdot(vectors, vectors))
        # 1e-12 is far below a 16-bit step, and above the rounding error of 2x - 1 at x = 1/2.
        lost = ~(lengths > 1e-12) | ~np.isfinite(lengths)
        vectors[lost] = (0.0, 0.0, 1.0)
        lengths[lost] = 1.0
        normals[start:stop] = vectors / lengths[:, None]

    run_bands(work, len(flat), band=_BAND, threads=threads)
    return normals.reshape(*pixels.shape[:-1], 3)


def encode_heights(
    heights: AnyArray, *, bits: int, mid: float, scale: float, threads: int | None = None
) -> AnyArray:
    """Encode distances d (...) in model units as h = d / scale + mid; integer codes are clipped."""
    if not (np.isfinite(scale) and np.isfinite(mid) and scale != 0.0):
        raise OptionError(f"scale: {scale} with the mid level {mid} maps no heights; give others")
    if bits == 32:
        return (np.asarray(heights, np.float64) / scale + mid).astype(np.float32)
    top = float(max_code(bits))
    values = heights[..., None]
    codes = _quantized(values, bits, np.array([top / scale]), np.array([top * mid]), threads)
    return codes[..., 0]


def decode_heights(pixels: AnyArray, *, mid: float, scale: float) -> Float32Array:
    """Decode codes or levels in [0, 1] to signed distances (h - mid) * scale in model units."""
    top = np.iinfo(pixels.dtype).max if pixels.dtype.kind == "u" else 1.0
    return ((np.asarray(pixels, np.float64) / top - mid) * scale).astype(np.float32)


def encode_srgb(linear: npt.ArrayLike) -> Float32Array:
    """Convert linear values to sRGB values in [0, 1]; values outside [0, 1] are clipped."""
    light = np.clip(np.asarray(linear, np.float32), 0.0, 1.0)
    return np.where(
        light <= 0.0031308,
        light * np.float32(12.92),
        np.float32(1.055) * pm.power(light, np.float32(1.0 / 2.4)) - np.float32(0.055),
    ).astype(np.float32)


decode_srgb = pm.decode_srgb


def _green_sign(convention: str) -> float:
    require_known("convention", convention, _CONVENTIONS)
    return 1.0 if convention == "opengl" else -1.0


def channel_ranges(
    values: AnyArray, covered: BoolArray, *, threads: int | None = None
) -> Float32Array:
    """(C, 2) least and greatest finite values of covered texels; (inf, -inf) without any."""
    rows, texels = _of_texels(values, covered)
    nothing = np.tile(np.array([np.inf, -np.inf], np.float32), (rows.shape[1], 1))
    found = [nothing]

    def work(start: int, stop: int) -> None:
        ranges = nothing.copy()
        core.measure_ranges(rows, texels, ranges, start, stop)
        found.append(ranges)

    run_bands(work, len(texels), band=_BAND, threads=threads)
    lows, highs = np.min(found, axis=0)[:, 0], np.max(found, axis=0)[:, 1]
    return np.stack([lows, highs], axis=1)


def height_range(
    heights: AnyArray,
    covered: BoolArray,
    *,
    bits: int = 16,
    mid: float | None = None,
    threads: int | None = None,
) -> tuple[float, float]:
    """Mid level and scale, in model units, for covered heights d = (h - mid) * scale in [0, 1]."""
    mid = (max_code(bits) + 1) / 2 / max_code(bits) if mid is None else mid
    if not 0.0 <= mid <= 1.0:
        raise OptionError(f"mid: {mid} is not a level between 0 and 1")
    ranges = channel_ranges(heights, covered, threads=threads)
    below, above = -float(ranges[:, 0].min(initial=0.0)), float(ranges[:, 1].max(initial=0.0))
    if (above > 0.0 and mid == 1.0) or (below > 0.0 and mid == 0.0):
        raise OptionError(
            f"mid: {mid} leaves no room for heights from {-below:.6g} to {above:.6g}; use 0.5"
        )
    scale = max(above / (1.0 - mid) if above else 0.0, below / mid if below else 0.0)
    return mid, scale if scale > 0.0 else 1.0


def count_clipped(
    heights: AnyArray, covered: BoolArray, *, mid: float, scale: float, threads: int | None = None
) -> int:
    """Count the covered heights that integer codes clip with this mid level and scale."""
    values, texels = _of_texels(heights, covered)
    counts: list[int] = []

    def work(start: int, stop: int) -> None:
        # The rounding error of scale and of the division, relative to the whole range.
        limits = -1e-9, 1.0 + 1e-9
        counts.append(core.count_outside(values, texels, scale, mid, *limits, start, stop))

    run_bands(work, len(texels), band=_BAND, threads=threads)
    return sum(counts)


def size_at_percentile(
    values: Float32Array, covered: BoolArray, percentile: float, *, threads: int | None = None
) -> float:
    """Size that a percentage of covered values do not exceed, interpolated; 0 without any."""
    rows, texels = _of_texels(values, covered)

    def counts_of(count: Callable[[Int64Array, int, int], None]) -> Int64Array:
        parts: list[Int64Array] = []

        def work(start: int, stop: int) -> None:
            part = np.zeros(1 << 16, np.int64)
            count(part, start, stop)
            parts.append(part)

        run_bands(work, len(texels), band=4 * _BAND, threads=threads)
        return np.sum(parts, axis=0, dtype=np.int64) if parts else np.zeros(1 << 16, np.int64)

    uppers = np.cumsum(counts_of(partial(core.count_upper_halves, rows, texels)))

    def size_at(rank: int) -> np.float32:
        upper = int(np.searchsorted(uppers, rank, side="right"))
        before = int(uppers[upper - 1]) if upper else 0
        lowers = np.cumsum(
            counts_of(lambda part, *band: core.count_lower_halves(rows, texels, part, upper, *band))
        )
        lower = int(np.searchsorted(lowers, rank - before, side="right"))
        return np.uint32(upper << 16 | lower).view(np.float32)

    n = int(uppers[-1])
    if n == 0:
        return 0.0
    place = (n - 1) * (percentile / 100.0)
    below = int(place)
    along = place - below
    low, high = size_at(below), size_at(min(below + 1, n - 1))
    # From the nearer of the two, as numpy does.
    if along >= 0.5:
        return float(high - (high - low) * np.float32(1.0 - along))
    return float(low + (high - low) * np.float32(along))


def _of_texels(values: AnyArray, covered: BoolArray) -> tuple[Float32Array, BoolArray]:
    """Return values (H, W) or (H, W, C) as (n, C), and which texels are covered as (n,)."""
    texels = np.require(covered, np.bool_, ["C", "A"]).reshape(-1)
    n_channels = values.size // max(len(texels), 1)
    rows = np.require(values, np.float32, ["C", "A"]).reshape(len(texels), n_channels)
    return rows, texels
