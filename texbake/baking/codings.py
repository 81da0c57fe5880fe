"""Encoding of the values of each kind of map for files, with the metadata to decode them.

Integer files hold codes; float files hold the values themselves, in the units of the map.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import field
from typing import TYPE_CHECKING

import numpy as np

from texbake.errors import OptionError
from texbake.mesh.mesh import AnyArray, ByteArray, FloatArray
from texbake.mesh.oklch import linear_from_oklch
from texbake.metadata import (
    CONVENTION,
    CURVATURE_MID,
    CURVATURE_SCALE,
    DISPLACEMENT_MID,
    DISPLACEMENT_SCALE,
    ID,
    POSITION_MAX,
    POSITION_MIN,
    SPACE,
    THICKNESS_SCALE,
    Value,
)
from texbake.records import dataclass
from texbake.texture.encoding import (
    channel_ranges,
    color_ids,
    count_clipped,
    encode_heights,
    encode_normals,
    encode_srgb,
    height_range,
    max_code,
    quantize_points,
    quantize_unsigned,
    size_at_percentile,
)
from texbake.texture.image_formats import check_image_format, format_of, holds_floats

if TYPE_CHECKING:
    from texbake.baking.maps import MapKind
    from texbake.baking.result import BakedMap
    from texbake.files import PathLike

FLOAT = 32  # bits per channel of files that hold plain values
# If white were the greatest curvature, creases and noise would leave everything else gray.
_CURVATURE_PERCENTILE = 99.0
_EXACT_IN_HALF = 2048  # half floats hold all integers up to it
# Colors of ids differ in hue by the golden angle, so that neighboring ids look different.
_GOLDEN_ANGLE_DEG = 180.0 * (3.0 - math.sqrt(5.0))
_LIGHTNESSES = (0.70, 0.52, 0.86)
_CHROMA = 0.15
_MOST_READABLE = 1024  # ids whose colors a person can tell apart; beyond it only programs can
# Odd, so that products with different numbers below 2^24 differ modulo 2^24.
_MIXER = 0x9E3779


@dataclass(frozen=True, eq=False)
class EncodedMap:
    """A map encoded for a file."""

    # (H, W, C) uint8, uint16 or float32; codes, or floats that `write_image` converts.
    pixels: AnyArray
    metadata: dict[str, Value] = field(default_factory=dict)
    n_clipped: int = 0  # values out of range of the given mid level and scale


def file_bits(kind: MapKind, path: PathLike, bits: int | None, n_ids: int = 0) -> int:
    """Bits per channel of the file of a map."""
    codes = not holds_floats(path, bits or format_of(path).data_bits)
    is_color = kind.coding == "color" or (kind.coding == "id" and codes)
    channels = 3 if kind.coding == "id" and codes else kind.channels
    bits = check_image_format(path, bits, color=is_color, channels=channels, lossless=True)
    if n_ids > _EXACT_IN_HALF and bits == 16 and not codes:
        raise OptionError(
            f"{path}: half floats cannot hold {n_ids:,} ids; use `bits=32` or a png file"
        )
    return bits


def encode_map(baked: BakedMap, bits: int) -> EncodedMap:
    """Encode a map as its kind requires; `bits`: 8 or 16 for codes, `FLOAT` for plain values."""
    return _CODINGS[baked.kind.coding](baked, bits)


def _normals(baked: BakedMap, bits: int) -> EncodedMap:
    convention = baked.options.convention
    pixels = encode_normals(
        baked.values, bits=bits, convention=convention, threads=baked.options.threads
    )
    return EncodedMap(pixels, {SPACE: baked.options.space, CONVENTION: convention})


def _lengths(baked: BakedMap, bits: int) -> EncodedMap:
    options = baked.options
    mid, scale = options.mid, options.scale
    if bits == FLOAT:
        mid, scale = mid or 0.0, 1.0 if scale is None else scale
    elif mid is None or scale is None:
        mid, measured = height_range(
            baked.values, baked.has_data, bits=bits, mid=mid, threads=options.threads
        )
        scale = measured if scale is None else scale
    pixels = encode_heights(
        baked.values, bits=bits, mid=mid, scale=scale, threads=baked.options.threads
    )
    metadata: dict[str, Value] = {DISPLACEMENT_MID: mid, DISPLACEMENT_SCALE: scale}
    if baked.kind.coding == "vector":
        metadata[SPACE] = baked.options.space
    n_clipped = 0
    if bits != FLOAT:
        n_clipped = count_clipped(
            baked.values, baked.has_data, mid=mid, scale=scale, threads=baked.options.threads
        )
    return EncodedMap(pixels, metadata, n_clipped)


def _positions(baked: BakedMap, bits: int) -> EncodedMap:
    is_world = baked.kind.name.startswith("world") or baked.options.space == "world"
    metadata: dict[str, Value] = {SPACE: "world" if is_world else "object"}
    if bits == FLOAT:
        return EncodedMap(baked.values, metadata)
    assert baked.bounds is not None
    low, high = baked.bounds
    metadata |= {POSITION_MIN: _numbers(low), POSITION_MAX: _numbers(high)}
    threads = baked.options.threads
    return EncodedMap(quantize_points(baked.values, low, high, bits, threads=threads), metadata)


def _numbers(point: FloatArray) -> str:
    return " ".join(map(repr, point.tolist()))


def _curvatures(baked: BakedMap, bits: int) -> EncodedMap:
    mid, scale = 0.0, 1.0
    if bits != FLOAT:
        top = max_code(bits)
        # No code is exactly 1/2; a flat surface gets the one just above it.
        mid = (top + 1) / 2 / top if baked.kind.mid == 0.5 else baked.kind.mid
        white = baked.options.curvature_scale or usual_curvature(baked)
        scale = white / (1.0 - mid)
    pixels = encode_heights(
        baked.values, bits=bits, mid=mid, scale=scale, threads=baked.options.threads
    )
    return EncodedMap(pixels, {CURVATURE_MID: mid, CURVATURE_SCALE: scale})


def _thicknesses(baked: BakedMap, bits: int) -> EncodedMap:
    scale = 1.0
    if bits != FLOAT:
        ranges = channel_ranges(baked.values, baked.has_data, threads=baked.options.threads)
        greatest = float(ranges[:, 1].max(initial=0.0))
        scale = baked.options.thickness_distance or greatest or 1.0
    pixels = encode_heights(
        baked.values, bits=bits, mid=0.0, scale=scale, threads=baked.options.threads
    )
    return EncodedMap(pixels, {THICKNESS_SCALE: scale})


def usual_curvature(baked: BakedMap) -> float:
    """Absolute curvature that only a few texels exceed; 1 if nothing is curved."""

    def size_at(percentile: float) -> float:
        return size_at_percentile(
            baked.values, baked.has_data, percentile, threads=baked.options.threads
        )

    # If very little is curved, the percentile may be 0.
    greatest = size_at(_CURVATURE_PERCENTILE) or size_at(100.0)
    return greatest if greatest > 0.0 else 1.0


def _colors(baked: BakedMap, bits: int) -> EncodedMap:
    return EncodedMap(baked.values)


def _masks(baked: BakedMap, bits: int) -> EncodedMap:
    if bits == FLOAT:
        return EncodedMap(baked.values)
    return EncodedMap(quantize_unsigned(baked.values, bits, threads=baked.options.threads))


def _ids(baked: BakedMap, bits: int) -> EncodedMap:
    names = baked.legend
    if bits == FLOAT:
        return EncodedMap(baked.values, {f"{ID}{i}": name for i, name in enumerate(names, start=1)})
    colors = id_colors(len(names))
    words = [f"#{red:02x}{green:02x}{blue:02x}" for red, green, blue in colors.tolist()]
    metadata: dict[str, Value] = {
        f"{ID}{word}": name for word, name in zip(words[1:], names, strict=True)
    }
    codes = colors if bits == 8 else colors.astype(np.uint16) * 257
    pixels = color_ids(baked.values[:, :, 0], codes, threads=baked.options.threads)
    return EncodedMap(pixels, metadata)


def id_colors(n: int) -> ByteArray:
    """(n + 1, 3) sRGB codes of ids from 1, after black, all different; fixed up to 1,024 ids."""
    colors = np.zeros((n + 1, 3), dtype=np.uint8)
    if n > _MOST_READABLE:
        mixed = (np.arange(n + 1, dtype=np.int64) * _MIXER) & 0xFFFFFF
        return np.stack([mixed >> 16, (mixed >> 8) & 255, mixed & 255], axis=1).astype(np.uint8)
    # More than n, because some colors come out alike once they are rounded.
    i = np.arange(4 * (n + 1))
    lightness = np.array(_LIGHTNESSES)[i % len(_LIGHTNESSES)]
    linear = linear_from_oklch(lightness, _CHROMA, i * _GOLDEN_ANGLE_DEG)
    codes = np.floor(encode_srgb(linear) * 255.0 + 0.5).astype(np.uint8)
    _, firsts = np.unique(codes, axis=0, return_index=True)
    colors[1:] = codes[np.sort(firsts)[:n]]
    return colors


_CODINGS: dict[str, Callable[[BakedMap, int], EncodedMap]] = {
    "normal": _normals,
    "height": _lengths,
    "vector": _lengths,
    "position": _positions,
    "curvature": _curvatures,
    "thickness": _thicknesses,
    "color": _colors,
    "mask": _masks,
    "id": _ids,
}
