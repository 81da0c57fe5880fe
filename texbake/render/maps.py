"""Maps, from files, images or arrays, to what shading takes."""

from __future__ import annotations

import math
import os
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.errors import FileFormatError, OptionError
from texbake.files import PathLike
from texbake.metadata import CONVENTION, DISPLACEMENT_MID, DISPLACEMENT_SCALE, SPACE, Value
from texbake.render.surface import FloatImage
from texbake.texture.encoding import decode_heights, decode_normals
from texbake.texture.image import Image, read_image

MapSource = PathLike | Image | npt.NDArray[Any]

_CONVENTIONS = ("opengl", "directx")
_SPACES = ("tangent", "object", "world")


def normals_from(source: MapSource) -> tuple[FloatImage, str]:
    """Decoded normals of a map, and their space.

    Parameters
    ----------
    source
        An array holds unit vectors, in tangent space with +Y up. Of a file or image the metadata
        says which convention and space it has; where it does not, it is taken for the same.

    Returns
    -------
    normals : (H, W, 3) float32
    space : str
        "tangent", "object" or "world".
    """
    if isinstance(source, np.ndarray):
        return _channels(source, "normal map", 3), "tangent"
    image = _read(source, color=False)
    convention = _choice(image, CONVENTION, _CONVENTIONS)
    pixels = _channels(image.pixels, image.name, 3)
    return decode_normals(pixels, convention=convention), _choice(image, SPACE, _SPACES)


def heights_from(source: MapSource) -> FloatImage:
    """(H, W, 1) float32: heights of a displacement map in model units.

    An array holds them as they are. Of a file or image the metadata says the mid level and scale;
    without them its values are heights as they are.
    """
    if isinstance(source, np.ndarray):
        heights = _channels(source[..., None] if source.ndim == 2 else source, "displacement", 1)
        name = "displacement"
    else:
        image = _read(source, color=False)
        name = image.name
        heights = decode_heights(
            _channels(image.pixels, name, 1),
            mid=_number(image, DISPLACEMENT_MID, 0.0),
            scale=_number(image, DISPLACEMENT_SCALE, 1.0),
        )
    if not np.isfinite(heights).all():
        raise OptionError(f"{name}: a height is not finite; fill what was not baked first")
    return heights


def albedo_from(source: MapSource) -> FloatImage:
    """(H, W, 3) float32: linear colors of a texture; gray ones are spread over all channels."""
    if isinstance(source, np.ndarray):
        pixels, name = source, "albedo"
    else:
        image = _read(source, color=True)
        pixels, name = image.pixels, image.name
    if pixels.ndim == 3 and pixels.shape[2] in (1, 2):
        pixels = np.repeat(pixels[..., :1], 3, axis=2)
    return _channels(pixels, name, 3)


def _read(source: PathLike | Image, *, color: bool) -> Image:
    if isinstance(source, str | os.PathLike):
        return read_image(source, color=color)
    return source


def _channels(pixels: npt.NDArray[Any], name: str, n_channels: int) -> FloatImage:
    """Return the first channels of an image, as the kernels take them."""
    if pixels.ndim != 3 or pixels.size == 0 or pixels.shape[2] < n_channels:
        raise OptionError(
            f"{name}: the shape {pixels.shape} is not (height, width, {n_channels}); "
            "give another map"
        )
    return np.ascontiguousarray(pixels[..., :n_channels], dtype=np.float32)


def _choice(image: Image, key: str, choices: tuple[str, ...]) -> str:
    value = image.metadata.get(key, choices[0])
    if value not in choices:
        raise FileFormatError(f"{image.name}: its {key} {value!r} is not one of {choices}")
    return str(value)


def _number(image: Image, key: str, default: float) -> float:
    value: Value = image.metadata.get(key, default)
    if not isinstance(value, int | float) or not math.isfinite(value):
        raise FileFormatError(f"{image.name}: its {key} {value!r} is not a finite number")
    return float(value)
