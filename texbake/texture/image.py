"""Read image files as linear arrays and write them, with the metadata of baked maps.

Pixels are `(H, W, C) float32`, linear, row 0 at the top. Integer formats store color as sRGB and
data as is. Files contain no date, so the same pixels always give the same bytes. The metadata of a
map (`texbake.metadata`) is stored in the image description of PNG, TIFF, EXR, TGA and JPEG files.
It is left out of HDR and PPM files, and of TGA files if it is longer than 324 characters.

OpenImageIO reads all formats and writes all but PNG, which `png_files` writes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from dataclasses import field, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.errors import FileError, FileFormatError, OptionError, quoted, require_library
from texbake.files import PathLike, replacing, require_file, scratch_folder
from texbake.limits import require_image_size
from texbake.mesh.mesh import AnyArray, Float32Array
from texbake.metadata import Value, from_description, is_png, png_description, to_description
from texbake.parallel import run_bands
from texbake.records import dataclass
from texbake.texture.encoding import (
    code_type,
    decode_srgb,
    max_code,
    quantize_srgb,
    quantize_unsigned,
)
from texbake.texture.image_formats import (
    PNG,
    check_image_format,
    format_of,
    holds_floats,
    require_read_format,
    suffix_of_content,
)
from texbake.texture.png_files import picture_png, write_png

FloatImage = Float32Array  # (H, W) or (H, W, C), row 0 at the top

# Texels per band: a few milliseconds of work.
_BAND = 1 << 19
GREATEST_HALF = 65504.0


@dataclass(frozen=True, repr=False)
class Image:
    """Pixels of an image file, for `np.asarray` and notebooks as well, with metadata and format."""

    # (H, W, C) float32: linear values. Integer codes are scaled to [0, 1].
    pixels: Float32Array
    # metadata of the map; empty for other images
    metadata: dict[str, Value] = field(default_factory=dict)
    bits: int = 32  # bits per channel in the file: 8, 16 or 32
    # whether the file stores floats (half or single) instead of integer codes
    is_float: bool = True
    name: str = "image"  # file name, for messages
    is_color: bool = False  # whether it was read as a color image

    def __repr__(self) -> str:
        height, width, n_channels = self.pixels.shape
        kind = f"{self.bits}-bit {'floats' if self.is_float else 'codes'}"
        return f"<Image {self.name}: {width} x {height}, {n_channels} channels, {kind}>"

    def __array__(self, dtype: npt.DTypeLike | None = None, copy: bool | None = None) -> AnyArray:
        return np.array(self.pixels, dtype) if copy else np.asarray(self.pixels, dtype)

    def _repr_png_(self) -> bytes:
        return picture_png(self.pixels, is_color=self.is_color or self.is_float)


@dataclass(frozen=True)
class ImageHeader:
    """Size of an image file in pixels, its channels, and the metadata of the map in it."""

    width: int
    height: int
    n_channels: int
    metadata: dict[str, Value]
    is_premultiplied: bool  # colors are stored times the alpha, as in EXR files


# numpy's name of each type, and OpenImageIO's.
_OIIO_TYPES = {"uint8": "uint8", "uint16": "uint16", "float16": "half", "float32": "float"}


def write_image(
    pixels: AnyArray,
    path: PathLike,
    *,
    color: bool = False,
    bits: int | None = None,
    metadata: Mapping[str, Value] | None = None,
    threads: int | None = None,
) -> None:
    """Write an image file. If writing fails, no partial file is left behind.

    Parameters
    ----------
    pixels : (H, W) or (H, W, C), uint8, uint16 or float
        Row 0 at the top. Integer codes are written unchanged. Floats are linear: integer formats
        clip them to [0, 1] and round them to the nearest code. Colors written as half floats are
        clipped to 65,504.
    path
        The suffix selects the format: png, exr, tif, tiff, tga, hdr, jpg, jpeg or ppm.
    color
        Whether the image is a color image. Integer formats then store floats as sRGB, except for
        alpha, and a PNG file is marked as sRGB.
    bits
        8, 16 or 32 bits per channel (16 is half float in EXR). None: the size of integer codes, or
        the default of `check_image_format`.
    metadata
        Written if the format supports it.

    Raises
    ------
    FileFormatError
        The suffix is unknown.
    OptionError
        The format does not support that many bits or channels, or `bits` differs from the size of
        the integer codes.
    FileError
        The file cannot be written.
    """
    pixels = np.asarray(pixels)
    pixels = pixels[..., None] if pixels.ndim == 2 else pixels
    if pixels.ndim != 3 or pixels.size == 0:
        raise OptionError(f"{path}: the shape {pixels.shape} is not that of an image, (H, W, C)")
    if bits is None and pixels.dtype.kind == "u":
        bits = 8 * pixels.itemsize
    bits = check_image_format(path, bits, color=color)
    check_image_format(path, bits, channels=pixels.shape[2])
    stored = _stored(pixels, path, bits, color, threads)
    description = to_description(metadata or {})
    with replacing(path) as temporary:
        if format_of(path) is PNG:
            write_png(temporary, stored, srgb=color, description=description, threads=threads)
        else:
            _write_with_openimageio(stored, path, temporary, color, description)


def read_image(path: PathLike, *, color: bool, threads: int | None = None) -> Image:
    """Read an image file as linear values.

    Parameters
    ----------
    path
        PNG, EXR, TIFF, TGA, HDR, JPEG, WebP, BMP, DDS or PPM, whatever its suffix.
    color
        Whether integer codes are sRGB colors, which are converted to linear (except for alpha), or
        data.

    Raises
    ------
    OptionError
        `color` is neither true nor false, such as "data", which would count as true.
    FileError
        The file does not exist or cannot be opened.
    FileFormatError
        The file is not an image, or it is damaged.
    """
    if not isinstance(color, bool | np.bool_):
        raise OptionError(f"color: {quoted(color)} is neither True (sRGB) nor False (data)")
    codes, description = _read_with_openimageio(path)
    return _image_of(codes, from_description(description), path, color, threads)


def image_as_read(
    pixels: AnyArray,
    path: PathLike,
    *,
    color: bool,
    bits: int,
    metadata: Mapping[str, Value],
    threads: int | None = None,
) -> Image:
    """Return what `read_image` reads, as data, from a file that `write_image` has written."""
    stored = _stored(pixels, path, bits, color, threads)
    return _image_of(stored, dict(metadata), path, False, threads)


def _image_of(
    codes: AnyArray, metadata: dict[str, Value], path: PathLike, color: bool, threads: int | None
) -> Image:
    is_float = codes.dtype.kind == "f"
    pixels = codes.astype(np.float32, copy=False) if is_float else _linear(codes, color, threads)
    name = Path(path).name
    return Image(pixels, metadata, 8 * codes.itemsize, is_float, name, is_color=bool(color))


def read_header(path: PathLike) -> ImageHeader:
    """Read the header of an image file, without its pixels."""
    source, description = _opened(path)
    spec = source.spec()
    description = description or _description(spec)
    source.close()
    size = spec.width, spec.height, spec.nchannels
    is_apart = bool(spec.get_int_attribute("oiio:UnassociatedAlpha"))
    has_product = spec.alpha_channel >= 0 and not is_apart
    return ImageHeader(*size, from_description(description), has_product)


def _stored(
    pixels: AnyArray, path: PathLike, bits: int, color: bool, threads: int | None
) -> AnyArray:
    """Return the pixels as the file stores them: codes, halves or floats."""
    if holds_floats(path, bits):
        if pixels.dtype.kind != "f":
            raise OptionError(f"{path}: it holds floats, not {pixels.dtype} codes; pass floats")
        if bits == 16 and color:  # colors too bright for a half are clipped
            pixels = np.clip(pixels, -GREATEST_HALF, GREATEST_HALF)
        return pixels.astype(np.float16 if bits == 16 else np.float32, copy=False)
    if pixels.dtype.kind == "f":
        if color:
            n_colors = _n_color_channels(pixels.shape[2])
            return quantize_srgb(pixels, bits, n_colors=n_colors, threads=threads)
        return quantize_unsigned(pixels, bits, threads=threads)
    if pixels.dtype != code_type(bits):
        raise OptionError(f"{path}: {pixels.dtype} codes are not of {bits} bits; pass floats")
    return pixels


def _n_color_channels(n_channels: int) -> int:
    """Return the number of channels without alpha, which is the last of two or four."""
    return n_channels - 1 if n_channels in (2, 4) else n_channels


def _linear(codes: AnyArray, color: bool, threads: int | None) -> Float32Array:
    """Return the linear values of codes, from a table of all codes."""
    levels = np.arange(max_code(8 * codes.itemsize) + 1) / max_code(8 * codes.itemsize)
    n_colors = _n_color_channels(codes.shape[2]) if color else 0
    flat = codes.reshape(-1, codes.shape[2])
    linear = np.empty(flat.shape, np.float32)
    data_table = levels.astype(np.float32)
    color_table = decode_srgb(levels).astype(np.float32)

    def work(start: int, stop: int) -> None:
        linear[start:stop, :n_colors] = color_table[flat[start:stop, :n_colors]]
        linear[start:stop, n_colors:] = data_table[flat[start:stop, n_colors:]]

    run_bands(work, len(flat), band=_BAND, threads=threads)
    return linear.reshape(codes.shape)


def _write_with_openimageio(
    stored: AnyArray, path: PathLike, temporary: Path, color: bool, description: str
) -> None:
    oiio = require_library("OpenImageIO", path)

    kind = format_of(path)
    height, width, n_channels = stored.shape
    spec = oiio.ImageSpec(width, height, n_channels, _OIIO_TYPES[stored.dtype.name])
    spec.attribute("DateTime", "")  # otherwise TIFF and EXR contain the time of writing
    spec.attribute("oiio:UnassociatedAlpha", 1)
    spec.attribute("jpeg:subsampling", "4:4:4")
    if kind.compression:
        spec.attribute("compression", kind.compression)
    if color and not kind.float_bits:
        spec.attribute("oiio:ColorSpace", "sRGB")
    if description and len(description) <= kind.description_limit:
        spec.attribute("ImageDescription", description)
    write_with_spec(stored, spec, temporary, path)


def write_with_spec(pixels: AnyArray, spec: Any, temporary: Path, path: PathLike) -> None:
    """Write pixels to `temporary` with OpenImageIO; errors name `path`."""
    oiio = require_library("OpenImageIO", path)

    output = oiio.ImageOutput.create(str(temporary))
    written = (
        output is not None
        and output.open(str(temporary), spec)
        and output.write_image(np.ascontiguousarray(pixels))
        and output.close()
    )
    if not written:
        reason = _complaint(output.geterror if output is not None else oiio.geterror)
        raise FileError(f"{path}: cannot be written: {_one_line(reason, temporary, path)}")


def _opened(path: PathLike) -> tuple[Any, str]:
    """Open an image file; return it with the description that a PNG file contains."""
    oiio = require_library("OpenImageIO", path)

    require_file(path)
    try:
        require_read_format(path)
        # Checked before libpng sees it, which would print its complaints.
        description = png_description(path) if is_png(path) else ""
    except FileFormatError:
        raise
    except OSError as error:
        raise FileError(f"{path}: cannot be read: {error.strerror or error}") from error
    wishes = oiio.ImageSpec()
    wishes.attribute("oiio:UnassociatedAlpha", 1)
    source = oiio.ImageInput.open(str(path), wishes)
    if source is None:
        raise FileFormatError(f"{path}: it is not an image: {_one_line(_complaint(oiio.geterror))}")
    require_read_format(path, source.format_name())
    spec = source.spec()
    # A tile is decoded whole, however small the part of it in the image.
    width, height = max(spec.width, spec.tile_width), max(spec.height, spec.tile_height)
    require_image_size(path, width, height, spec.nchannels)
    return source, description


def _read_with_openimageio(path: PathLike) -> tuple[AnyArray, str]:
    """Return codes (uint8, uint16) or floats (float16, float32), and the image description."""
    oiio = require_library("OpenImageIO", path)

    source, description = _opened(path)
    spec = source.spec()
    if (spec.x, spec.y, spec.width, spec.height) != (
        spec.full_x,
        spec.full_y,
        spec.full_width,
        spec.full_height,
    ):
        raise FileFormatError(f"{path}: only a window of the image is in it; save it uncropped")
    # Other types, such as 32-bit integers, are read as floats.
    stored = str(spec.format) if str(spec.format) in _OIIO_TYPES.values() else "float"
    pixels = source.read_image(0, 0, 0, spec.nchannels, oiio.TypeDesc(stored))
    reason = _complaint(source.geterror)
    source.close()
    if pixels is None or reason:
        raise FileFormatError(f"{path}: the image is damaged: {_one_line(reason)}")
    return pixels, description or _description(spec)


def _complaint(error: Callable[[], str]) -> str:
    """Return OpenImageIO's message, which may quote bytes of the file that are not text."""
    try:
        return error()
    except UnicodeDecodeError:
        return "something in it is not text"


def _description(spec: Any) -> str:
    try:
        return str(spec.get_string_attribute("ImageDescription"))
    except UnicodeDecodeError:
        return ""


def _one_line(reason: str, temporary: Path | None = None, path: PathLike = "") -> str:
    """Return the first line of OpenImageIO's message, with the path that the user gave."""
    line = (reason.strip() or "no reason was given").splitlines()[0]
    return line.replace(str(temporary), str(path)) if temporary is not None else line


def decode_image(data: bytes, name: str, *, color: bool, threads: int | None = None) -> Image:
    """Read an image from the bytes of a file; the first bytes identify the format."""
    with _as_file(data, name) as path:
        image = read_image(path, color=color, threads=threads)
    return replace(image, name=name)


def require_whole(image: PathLike | bytes, name: str = "") -> None:
    """Raise `FileFormatError` if an image is damaged: PNG by its checksums, others by decoding."""
    with _as_file(image, name) if isinstance(image, bytes) else nullcontext(image) as path:
        _opened(path)[0].close()
        if not is_png(path):
            _read_with_openimageio(path)


def image_shape(data: bytes, name: str) -> tuple[int, int, int]:
    """Width, height and number of channels of an image in the bytes of a file, not decoded."""
    with _as_file(data, name) as path:
        source, _ = _opened(path)
        spec = source.spec()
        source.close()
    return spec.width, spec.height, spec.nchannels


@contextmanager
def _as_file(data: bytes, name: str) -> Iterator[Path]:
    """Write bytes to a file, which is all that OpenImageIO's Python interface reads."""
    suffix = suffix_of_content(data) or Path(name).suffix
    with scratch_folder() as folder:
        path = folder / f"image{suffix}"
        path.write_bytes(data)
        try:
            yield path
        except (FileError, FileFormatError) as error:
            raise FileFormatError(str(error).replace(str(path), name)) from error
