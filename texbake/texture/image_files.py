"""Write sets of images together, normal and height maps, and layers of an EXR file; read volumes.

Channels of layers are named ``layer.channel``, as in Blender and Nuke: ``normal.R``,
``displacement.Y``. All are stored in one part; each layer has its own bits per channel.

Based on: Academy Software Foundation, "OpenEXR, Technical Introduction", section "Layers".
"""

from __future__ import annotations

import io
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from texbake.arrays import DAMAGE, read_array_file
from texbake.errors import FileFormatError, OptionError, one_line, quoted, require_library
from texbake.files import PathLike, appearing_together, make_folder, replacing, require_file
from texbake.mesh.mesh import AnyArray, ByteArray, Float32Array
from texbake.metadata import (
    CONVENTION,
    DISPLACEMENT_MID,
    DISPLACEMENT_SCALE,
    SPACE,
    Value,
    to_description,
)
from texbake.texture.encoding import encode_heights, encode_normals, height_range
from texbake.texture.image import GREATEST_HALF, Image, read_image, write_image, write_with_spec
from texbake.texture.image_formats import check_image_format, holds_floats
from texbake.texture.png_files import png_parts


def write_images(
    images: Mapping[Path, AnyArray],
    *,
    color: bool,
    bits: int | None = None,
    threads: int | None = None,
) -> None:
    """Write several images (H, W, C); if one of them cannot be written, none is."""
    for file, pixels in images.items():
        check_image_format(
            file, check_image_format(file, bits, color=color), channels=pixels.shape[2]
        )
    for folder in {file.parent for file in images}:
        make_folder(folder)
    with appearing_together():
        for file, pixels in images.items():
            write_image(pixels, file, color=color, bits=bits, threads=threads)


def suffix_like(source: Image) -> str:
    """Return a suffix for files that store the source without loss: its own, or .png.

    >>> suffix_like(Image(np.zeros((1, 1, 3), np.float32), name="sky.hdr"))
    '.hdr'
    """
    suffix = Path(source.name).suffix.lower()
    if source.is_float:
        return suffix if suffix in (".exr", ".hdr", ".tif", ".tiff") else ".exr"
    return suffix if suffix in (".tga", ".tif", ".tiff") else ".png"


def bits_for(path: PathLike, pixels: Float32Array, source: Image) -> int | None:
    """Bits per channel that keep the precision of a source; None for the default of the format."""
    wanted = 32 if source.is_float else source.bits
    if Path(path).suffix.lower() == ".exr":
        return 32 if np.abs(pixels).max() > GREATEST_HALF else None
    try:
        return None if wanted == 8 else check_image_format(path, wanted)
    except OptionError:
        return None


def clipped_share(path: PathLike, pixels: Float32Array, bits: int | None) -> float:
    """Return the share of the values that an integer format clips to [0, 1]."""
    if holds_floats(path, check_image_format(path, bits, color=True)):
        return 0.0
    return float(np.mean((pixels < 0.0) | (pixels > 1.0)))


def write_normals(
    normals: AnyArray,
    path: PathLike,
    *,
    convention: str = "opengl",
    bits: int | None = None,
    threads: int | None = None,
) -> None:
    """Write tangent-space unit vectors (H, W, 3), y up, as a normal map."""
    bits = check_image_format(path, bits, channels=3, lossless=True)
    code_bits = 32 if holds_floats(path, bits) else bits
    pixels = encode_normals(normals, bits=code_bits, convention=convention, threads=threads)
    metadata = {SPACE: "tangent", CONVENTION: convention}
    write_image(pixels, path, bits=bits, metadata=metadata, threads=threads)


def write_heights(
    heights: AnyArray, path: PathLike, *, bits: int | None = None, threads: int | None = None
) -> tuple[float, float]:
    """Write heights (H, W) in model units as a map; return its mid level and its scale."""
    bits = check_image_format(path, bits, channels=1, lossless=True)
    mid, scale = 0.0, 1.0
    code_bits = 32 if holds_floats(path, bits) else bits
    if code_bits != 32:
        mid, scale = height_range(heights, np.ones(heights.shape, np.bool_), bits=bits)
    pixels = encode_heights(heights, bits=code_bits, mid=mid, scale=scale, threads=threads)
    metadata = {DISPLACEMENT_MID: mid, DISPLACEMENT_SCALE: scale}
    write_image(pixels, path, bits=bits, metadata=metadata, threads=threads)
    return mid, scale


# Names of the channels of a layer, by the number of channels.
_CHANNELS = {1: "Y", 2: "YA", 3: "RGB", 4: "RGBA"}


def write_layers(layers: Mapping[str, Image], path: PathLike) -> None:
    """Write images of one size as the layers of an EXR file."""
    oiio = require_library("OpenImageIO", path)

    if Path(path).suffix.lower() != ".exr":
        raise FileFormatError(f"{path}: only EXR files store layers; give a .exr file")
    _check_layers(layers, path)
    names, types, columns = [], [], []
    metadata: dict[str, Value] = {}
    for layer, image in layers.items():
        kind = "float" if image.bits == 32 else "half"
        n_channels = image.pixels.shape[2]
        names += [f"{layer}.{channel}" for channel in _CHANNELS[n_channels]]
        types += [kind] * n_channels
        columns.append(image.pixels)
        metadata |= {f"{layer}.{key}": value for key, value in image.metadata.items()}
    pixels = np.concatenate(columns, axis=2)
    height, width, n_channels = pixels.shape
    spec = oiio.ImageSpec(width, height, n_channels, "float")
    spec.channelnames = tuple(names)
    spec.channelformats = tuple(oiio.TypeDesc(kind) for kind in types)
    spec.attribute("DateTime", "")  # otherwise the time of writing
    spec.attribute("compression", "zip")
    if metadata:
        spec.attribute("ImageDescription", to_description(metadata))
    with replacing(path) as temporary:
        write_with_spec(pixels.astype(np.float32, copy=False), spec, temporary, path)


def _check_layers(layers: Mapping[str, Image], path: PathLike) -> None:
    if not layers:
        raise OptionError(f"{path}: there is no layer to write; give at least one image")
    sizes = {image.pixels.shape[:2] for image in layers.values()}
    if len(sizes) > 1:
        words = ", ".join(f"{width} x {height}" for height, width in sorted(sizes))
        raise OptionError(f"{path}: its layers differ in size ({words}); bake them at one size")
    for layer, image in layers.items():
        if not layer or "." in layer:
            raise OptionError(f"{path}: {quoted(layer)} is not a layer name; use one without dots")
        if image.pixels.shape[2] not in _CHANNELS:
            raise OptionError(f"{path}: the layer {quoted(layer)} has more than four channels")
        if image.bits != 32 and np.abs(image.pixels).max() > GREATEST_HALF:
            raise OptionError(
                f"{path}: the layer {quoted(layer)} is beyond half floats; give it 32 bits"
            )


# Names of the formats, with the suffixes of their files.
ENCODINGS = {"webp": ".webp", "jpeg": ".jpg", "png": ".png"}
# How long WebP looks for fewer bytes: from 4 on, twice the time saves less than a tenth.
_WEBP_METHOD = 4
# Effort of lossless WebP, and the most bytes of a quick attempt, as a multiple of the bytes below
# which the result must stay: it had up to 1.4 times the bytes of the result in images of models.
_WEBP_EFFORT, _MOST_OF_QUICK = 75, 1.5


def encode_image(
    codes: ByteArray,
    encoding: str,
    *,
    quality: int = 90,
    is_color: bool = False,
    threads: int | None = 1,
) -> bytes:
    """Bytes of an image file of codes (H, W, 3 or 4); `is_color` marks a PNG as sRGB."""
    if encoding not in ENCODINGS:
        raise OptionError(f"encoding: {quoted(encoding)} is not known; use {', '.join(ENCODINGS)}")
    encoding = encoding_of(codes, encoding)
    if encoding == "png":
        return b"".join(png_parts(codes, srgb=is_color, threads=threads))
    if encoding == "webp":
        return _encoded(codes, encoding, quality=quality, method=_WEBP_METHOD, exact=True)
    return _encoded(codes, encoding, quality=quality, subsampling="4:4:4")


def lossless_webp(codes: ByteArray, n_bytes: int) -> bytes | None:
    """Bytes of a lossless WebP file of codes (H, W, 3 or 4) if it has fewer than `n_bytes`.

    A quick attempt tells whether that is likely.
    """
    lossless = {"lossless": True, "exact": True}
    quick = _encoded(codes, "webp", quality=0, method=1, **lossless)
    if len(quick) >= _MOST_OF_QUICK * n_bytes:
        return None
    data = _encoded(codes, "webp", quality=_WEBP_EFFORT, method=_WEBP_METHOD, **lossless)
    return data if len(data) < n_bytes else None


def _encoded(codes: ByteArray, encoding: str, **options: Any) -> bytes:
    Image = require_library("PIL.Image", f"{encoding} images")
    buffer = io.BytesIO()
    Image.fromarray(codes).save(buffer, encoding.upper(), **options)
    return buffer.getvalue()


def encoding_of(codes: ByteArray, encoding: str) -> str:
    """Return the encoding that an image gets: PNG in place of JPEG where it has alpha."""
    return "png" if encoding == "jpeg" and codes.shape[2] == 4 else encoding


def read_volume(source: PathLike | Sequence[PathLike]) -> Float32Array:
    """Read a volume (D, H, W, 1 or 3) float32."""
    if not isinstance(source, str | os.PathLike):
        slices = [read_image(path, color=False).pixels[:, :, :1] for path in source]
        for path, layer in zip(source, slices, strict=True):
            if layer.shape != slices[0].shape:
                height, width = slices[0].shape[:2]
                raise FileFormatError(
                    f"{path}: it is {layer.shape[1]} x {layer.shape[0]} texels, and the first "
                    f"slice {width} x {height}"
                )
        return np.stack(slices).astype(np.float32)
    require_file(source)
    try:
        array = read_array_file(source)
    except (OSError, *DAMAGE) as error:
        raise FileFormatError(f"{source}: it is not a .npy file: {one_line(error, 120)}") from error
    if array.dtype.kind not in "uif":
        raise FileFormatError(f"{source}: it is not one array of numbers")
    if array.ndim == 3:
        array = array[..., None]
    if array.ndim != 4 or array.shape[3] not in (1, 3) or array.size == 0:
        raise FileFormatError(
            f"{source}: the shape {array.shape} is not (depth, height, width), nor that with 3 "
            "channels"
        )
    divisor = np.iinfo(array.dtype).max if array.dtype.kind in "ui" else 1
    volume: Float32Array = (array / divisor).astype(np.float32)
    if not np.isfinite(volume).all():
        raise FileFormatError(f"{source}: a value is not finite")
    return volume
