"""How the values of each kind of map become the numbers of a file, and what the file says of them.

Integer files hold codes; float files hold values as they are, in the units of the map.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from texbake.baking.id_colors import id_colors
from texbake.errors import OptionError
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
from texbake.texture.encoding import (
    count_clipped,
    encode_heights,
    encode_normals,
    height_range,
    max_code,
    quantize_unsigned,
)
from texbake.texture.image_formats import check_image_format, format_of, holds_floats

if TYPE_CHECKING:
    from texbake.baking.baked_map import BakedMap
    from texbake.baking.maps.kind import MapKind
    from texbake.files import PathLike

FLOAT = 32  # bits of values that stay as they are
# Curvatures beyond it, at creases and in noise, would leave all others gray.
_CURVATURE_PERCENTILE = 99.0
_EXACT_IN_HALF = 2048  # whole numbers up to it


@dataclass(frozen=True, eq=False)
class Coded:
    """A map as what a file holds.

    Attributes
    ----------
    pixels : (H, W, C) uint8, uint16 or float32
        Codes, or floats for `write_image` to code.
    metadata : dict
    n_clipped : int
        Values that the codes asked for cannot hold.
    """

    pixels: npt.NDArray[Any]
    metadata: dict[str, Value] = field(default_factory=dict)
    n_clipped: int = 0


@dataclass(frozen=True)
class Request:
    """What is asked of a file; None as the options of the bake say.

    Attributes
    ----------
    bits : int
        8 or 16 for codes, `FLOAT` for values as they are.
    convention : str, optional
    mid, scale : float, optional
    """

    bits: int
    convention: str | None = None
    mid: float | None = None
    scale: float | None = None


def file_bits(kind: MapKind, path: PathLike, bits: int | None, n_ids: int = 0) -> int:
    """Bits a channel of a map's file: those asked for, else what suits the map and the format.

    Colors have 8 (16 in EXR, as half floats), numbers of things 8 or 32, all else the most that the
    format holds.

    Raises
    ------
    OptionError
        The format does not hold the map so.
    FileFormatError
        The suffix is not known.
    """
    codes = not holds_floats(path, bits or format_of(path).data_bits)
    is_color = kind.coding == "color" or (kind.coding == "id" and codes)
    channels = 3 if kind.coding == "id" and codes else kind.channels
    bits = check_image_format(path, bits, color=is_color, channels=channels, lossless=True)
    if n_ids > _EXACT_IN_HALF and bits == 16 and not codes:
        raise OptionError(
            f"{path}: half floats do not hold {n_ids:,} numbers; use --bits 32 or a png file"
        )
    return bits


def code(baked: BakedMap, request: Request) -> Coded:
    """Code a map as its kind says."""
    return _CODINGS[baked.kind.coding](baked, request)


def _normals(baked: BakedMap, request: Request) -> Coded:
    convention = request.convention or baked.options.convention
    pixels = encode_normals(
        baked.values, bits=request.bits, convention=convention, threads=baked.options.threads
    )
    return Coded(pixels, {SPACE: baked.options.space, CONVENTION: convention})


def _lengths(baked: BakedMap, request: Request) -> Coded:
    mid, scale = _height_levels(baked, request)
    pixels = encode_heights(
        baked.values, bits=request.bits, mid=mid, scale=scale, threads=baked.options.threads
    )
    metadata: dict[str, Value] = {DISPLACEMENT_MID: mid, DISPLACEMENT_SCALE: scale}
    if baked.kind.coding == "vector":
        metadata[SPACE] = baked.options.space
    n_clipped = 0
    if request.bits != FLOAT:
        n_clipped = count_clipped(baked.values, baked.covered, mid=mid, scale=scale)
    return Coded(pixels, metadata, n_clipped)


def _height_levels(baked: BakedMap, request: Request) -> tuple[float, float]:
    """Mid level and scale of a file: what was asked for, the rest measured."""
    options = baked.options
    mid = options.mid if request.mid is None else request.mid
    scale = options.scale if request.scale is None else request.scale
    if request.bits == FLOAT:
        return mid or 0.0, 1.0 if scale is None else scale
    if mid is None or scale is None:
        measured = height_range(baked.values, baked.covered, bits=request.bits, mid=mid)
        return measured[0], measured[1] if scale is None else scale
    return mid, scale


def _positions(baked: BakedMap, request: Request) -> Coded:
    is_world = baked.kind.name.startswith("world") or baked.options.space == "world"
    metadata: dict[str, Value] = {SPACE: "world" if is_world else "object"}
    if request.bits == FLOAT:
        return Coded(baked.values, metadata)
    assert baked.bounds is not None
    low, high = baked.bounds
    # An axis along which nothing extends is 0 and decodes to its one coordinate.
    sizes = np.where(high > low, high - low, 1.0)
    shares = ((baked.values - low) / sizes).astype(np.float32)
    metadata |= {POSITION_MIN: _numbers(low), POSITION_MAX: _numbers(high)}
    return Coded(quantize_unsigned(shares, request.bits, threads=baked.options.threads), metadata)


def _numbers(point: npt.NDArray[np.float64]) -> str:
    return " ".join(map(repr, point.tolist()))


def _curvatures(baked: BakedMap, request: Request) -> Coded:
    mid, scale = 0.0, 1.0
    if request.bits != FLOAT:
        top = max_code(request.bits)
        # 1/2 is no code: that of a flat surface is the one just over it.
        mid = (top + 1) / 2 / top if baked.kind.mid == 0.5 else baked.kind.mid
        white = baked.options.curvature_scale or usual_curvature(baked)
        scale = white / (1.0 - mid)
    pixels = encode_heights(
        baked.values, bits=request.bits, mid=mid, scale=scale, threads=baked.options.threads
    )
    return Coded(pixels, {CURVATURE_MID: mid, CURVATURE_SCALE: scale})


def _thicknesses(baked: BakedMap, request: Request) -> Coded:
    scale = 1.0
    if request.bits != FLOAT:
        greatest = float(baked.values[baked.covered].max(initial=0.0))
        scale = baked.options.thickness_distance or greatest or 1.0
    pixels = encode_heights(
        baked.values, bits=request.bits, mid=0.0, scale=scale, threads=baked.options.threads
    )
    return Coded(pixels, {THICKNESS_SCALE: scale})


def usual_curvature(baked: BakedMap) -> float:
    """Size of curvature that all but a few texels keep to; 1 where nothing is bent."""
    sizes = np.abs(baked.values[baked.covered])
    greatest = float(np.percentile(sizes, _CURVATURE_PERCENTILE)) if sizes.size else 0.0
    # What little is bent may be less than what the percentile leaves out.
    greatest = greatest or float(sizes.max(initial=0.0))
    return greatest if greatest > 0.0 else 1.0


def _colors(baked: BakedMap, request: Request) -> Coded:
    return Coded(baked.values)


def _masks(baked: BakedMap, request: Request) -> Coded:
    if request.bits == FLOAT:
        return Coded(baked.values)
    return Coded(quantize_unsigned(baked.values, request.bits, threads=baked.options.threads))


def _ids(baked: BakedMap, request: Request) -> Coded:
    names = baked.legend
    if request.bits == FLOAT:
        return Coded(baked.values, {f"{ID}{i}": name for i, name in enumerate(names, start=1)})
    colors = id_colors(len(names))
    words = [f"#{red:02x}{green:02x}{blue:02x}" for red, green, blue in colors.tolist()]
    metadata: dict[str, Value] = {
        f"{ID}{word}": name for word, name in zip(words[1:], names, strict=True)
    }
    codes = colors if request.bits == 8 else colors.astype(np.uint16) * 257
    return Coded(codes[baked.values[:, :, 0].astype(np.intp)], metadata)


_CODINGS: dict[str, Callable[[BakedMap, Request], Coded]] = {
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
