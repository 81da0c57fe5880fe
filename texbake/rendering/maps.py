"""Reading maps for shading from files, images or arrays."""

from __future__ import annotations

import math
import os

import numpy as np

from texbake.core import portable_math as pm
from texbake.errors import FileFormatError, OptionError, quoted
from texbake.files import PathLike
from texbake.mesh.mesh import AnyArray
from texbake.metadata import CONVENTION, DISPLACEMENT_MID, DISPLACEMENT_SCALE, SPACE, Value
from texbake.texture.cube_map import without_gaps
from texbake.texture.encoding import decode_heights, decode_normals
from texbake.texture.image import FloatImage, Image, read_header, read_image

MapSource = PathLike | Image | AnyArray
_CONVENTIONS = ("opengl", "directx")
_SPACES = ("tangent", "object", "world")
# Number of channels of gray with opacity, and of color with opacity.
_WITH_OPACITY = (2, 4)
_NO_PIXELS = np.empty((0, 0, 1), np.float32)


def normals_from(
    source: MapSource, *, convention: str | None = None, space: str | None = None
) -> tuple[FloatImage, str]:
    """Normals (H, W, 3) of a map, and their space: `tangent`, `object` or `world`."""
    if isinstance(source, np.ndarray):
        return _channels(source, "normal map", 3), space or "tangent"
    image = _read(source, color=False)
    convention = convention or _choice(image, CONVENTION, _CONVENTIONS)
    pixels = _channels(image.pixels, image.name, 3)
    return decode_normals(pixels, convention=convention), space or _choice(image, SPACE, _SPACES)


def normal_space(source: MapSource) -> str:
    """Return the space given in a normal map's metadata; "tangent" if there is none."""
    if isinstance(source, np.ndarray):
        return "tangent"
    if isinstance(source, str | os.PathLike):
        return _choice(
            Image(_NO_PIXELS, read_header(source).metadata, name=str(source)), SPACE, _SPACES
        )
    return _choice(source, SPACE, _SPACES)


# More than this share of normals below the surface is no tangent-space map. Baked ones have none,
# but for a few at borders; in object space, a closed mesh has about one half.
_BELOW_SURFACE = 0.1


def space_warnings(normal_map: PathLike | None, space: str | None) -> list[str]:
    """Warn of a map that names no space, and cannot be in tangent space by its unit vectors."""
    if normal_map is None or space is not None:
        return []
    image = _read(normal_map, color=False)
    if SPACE in image.metadata or image.pixels.ndim != 3 or image.pixels.shape[2] < 3:
        return []
    vectors = 2.0 * image.pixels[..., :3] - 1.0
    is_unit = np.abs(pm.norm(vectors, axis=2) - 1.0) < 0.2
    n_below = np.count_nonzero(is_unit & (vectors[..., 2] < 0.0))
    if n_below <= _BELOW_SURFACE * np.count_nonzero(is_unit):
        return []
    return [
        f"{normal_map}: its normals point in all directions, so it is in object space and not in "
        "tangent space; draw it with `space=object`"
    ]


def has_opacity(source: MapSource) -> bool:
    """Whether a texture has an opacity channel (two or four channels); reads no pixels."""
    if isinstance(source, np.ndarray):
        return source.ndim == 3 and source.shape[2] in _WITH_OPACITY
    if isinstance(source, str | os.PathLike):
        return read_header(source).n_channels in _WITH_OPACITY
    return source.pixels.ndim == 3 and source.pixels.shape[2] in _WITH_OPACITY


def heights_from(
    source: MapSource,
    *,
    mid: float | None = None,
    scale: float | None = None,
    channel: int | None = None,
    n_channels: int = 1,
) -> FloatImage:
    """(H, W, n_channels) heights (value - mid) * scale in model units, by metadata if None."""
    if isinstance(source, np.ndarray):
        image = Image(source[..., None] if source.ndim == 2 else source, name="displacement")
    else:
        image = _read(source, color=False)
    pixels = image.pixels
    if channel is not None and pixels.ndim == 3:
        first = min(channel, pixels.shape[2] - 1)
        pixels = pixels[..., first : first + 1]
    heights = _channels(pixels, image.name, n_channels)
    middle = _number(image, DISPLACEMENT_MID, 0.0) if mid is None else mid
    span = _number(image, DISPLACEMENT_SCALE, 1.0) if scale is None else scale
    if (middle, span) != (0.0, 1.0):
        heights = decode_heights(heights, mid=middle, scale=span)
    if not np.isfinite(heights).all():
        raise OptionError(f"{image.name}: a height is not finite; fill what was not baked first")
    return heights


def colors_from(source: MapSource, *, color: bool = True) -> FloatImage:
    """(H, W, 3): linear colors of a texture; `color` says whether its integers are sRGB."""
    pixels, name = _pixels_of(source, color=color)
    if pixels.ndim == 3 and pixels.shape[2] in (1, 2):
        pixels = np.repeat(pixels[..., :1], 3, axis=2)
    return without_gaps(_channels(pixels, name, 3))


def channel_of(source: MapSource, channel: int, *, color: bool = False) -> FloatImage:
    """(H, W, 1) float32: one channel of a map, the last if it has fewer; 0 for NaN and inf."""
    pixels, name = _pixels_of(source, color=color)
    image = _channels(pixels, name, 1, cut=False)
    channel = min(channel, image.shape[2] - 1)
    return without_gaps(np.ascontiguousarray(image[..., channel : channel + 1]))


def colors_and_opacity_from(
    source: MapSource, *, color: bool = True
) -> tuple[FloatImage, FloatImage | None]:
    """Linear colors (H, W, 3) and opacity (H, W, 1), the last of two or four channels."""
    pixels, _ = _pixels_of(source, color=color)
    colors = colors_from(pixels)
    if pixels.shape[2] not in _WITH_OPACITY:
        return colors, None
    return colors, without_gaps(np.ascontiguousarray(pixels[..., -1:], np.float32))


def _pixels_of(source: MapSource, *, color: bool) -> tuple[AnyArray, str]:
    if isinstance(source, np.ndarray):
        return (source[..., None] if source.ndim == 2 else source), "texture"
    image = _read(source, color=color)
    return image.pixels, image.name


def _read(source: PathLike | Image, *, color: bool) -> Image:
    if isinstance(source, str | os.PathLike):
        return read_image(source, color=color)
    return source


def _channels(pixels: AnyArray, name: str, n_channels: int, *, cut: bool = True) -> FloatImage:
    """Return the first channels of an image (or all, with `cut=False`) for use in kernels."""
    if pixels.ndim != 3 or pixels.size == 0 or pixels.shape[2] < n_channels:
        raise OptionError(
            f"{name}: the shape {pixels.shape} is not (height, width, {n_channels}); "
            "give another map"
        )
    return np.ascontiguousarray(pixels[..., :n_channels] if cut else pixels, dtype=np.float32)


def _choice(image: Image, key: str, choices: tuple[str, ...]) -> str:
    value = image.metadata.get(key, choices[0])
    if value not in choices:
        raise FileFormatError(f"{image.name}: its {key} {quoted(value)} is not one of {choices}")
    return str(value)


def _number(image: Image, key: str, default: float) -> float:
    value: Value = image.metadata.get(key, default)
    if not isinstance(value, int | float) or not math.isfinite(value):
        raise FileFormatError(f"{image.name}: its {key} {quoted(value)} is not a finite number")
    return float(value)
