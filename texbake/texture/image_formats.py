"""Image formats: those that are read, and what each can hold: bits, floats, channels, metadata."""

from __future__ import annotations

from pathlib import Path

from texbake.errors import FileFormatError, OptionError, quoted
from texbake.files import PathLike
from texbake.records import dataclass


@dataclass(frozen=True)
class ImageFormat:
    """Capabilities of a file format. `float_bits` lists those of its `bits` that are floats."""

    name: str
    bits: tuple[int, ...]
    float_bits: tuple[int, ...]
    color_bits: int
    data_bits: int
    channels: tuple[int, ...] | None
    description_limit: int
    compression: str


PNG = ImageFormat("PNG", (8, 16), (), 8, 16, (1, 2, 3, 4), 1 << 20, "")
# LZW: every program reads it, and it writes twice as fast as deflate for a quarter more bytes.
TIFF = ImageFormat("TIFF", (8, 16, 32), (32,), 8, 32, None, 1 << 20, "lzw")
JPEG = ImageFormat("JPEG", (8,), (), 8, 8, (1, 3), 1 << 15, "jpeg:95")
_FORMATS = {
    ".png": PNG,
    ".exr": ImageFormat("EXR", (16, 32), (16, 32), 16, 32, None, 1 << 20, "zip"),
    ".tif": TIFF,
    ".tiff": TIFF,
    ".tga": ImageFormat("TGA", (8,), (), 8, 8, (1, 3, 4), 324, "rle"),
    ".hdr": ImageFormat("HDR", (32,), (32,), 32, 32, (3,), 0, ""),
    ".jpg": JPEG,
    ".jpeg": JPEG,
    ".ppm": ImageFormat("PPM", (8, 16), (), 8, 16, (1, 3), 0, ""),
}

# How files of the formats that are read begin: a place, bytes there, and a suffix. OpenImageIO
# reads more, by code that no test of texbake has met.
_BEGINNINGS = (
    (0, b"\x89PNG", ".png"), (8, b"WEBP", ".webp"), (0, b"II*\0", ".tif"), (0, b"MM\0*", ".tif"),
    (0, b"II+\0", ".tif"), (0, b"MM\0+", ".tif"), (0, b"\x76\x2f\x31\x01", ".exr"),
    (0, b"#?", ".hdr"), (0, b"\xff\xd8", ".jpg"), (0, b"DDS ", ".dds"), (0, b"BM", ".bmp"),
    *((0, b"P%d" % kind, ".ppm") for kind in range(1, 7)),
)  # fmt: skip
_READ_BY = ("png", "webp", "tiff", "openexr", "hdr", "jpeg", "dds", "bmp", "pnm", "targa")
_HEAD = 18  # bytes; the header of a TGA file, which begins with nothing of its own


def suffix_of_content(data: bytes) -> str | None:
    """Return the suffix of an image file by its first bytes; None if no such format is read.

    >>> suffix_of_content(b"BM and more"), suffix_of_content(b"GIF89a")
    ('.bmp', None)
    """
    for start, known, suffix in _BEGINNINGS:
        if data[start : start + len(known)] == known:
            return suffix
    return ".tga" if _is_tga(data) else None


def _is_tga(data: bytes) -> bool:
    """Whether bytes may be the header of a TGA file: kinds of palette and image, and bits."""
    if len(data) < _HEAD:
        return False
    palette, kind, bits = data[1], data[2], data[16]
    known = kind in (2, 3, 10, 11) or (kind in (1, 9) and palette == 1)
    return palette in (0, 1) and known and bits in (8, 15, 16, 24, 32)


def require_read_format(path: PathLike, reader: str = "") -> None:
    """Raise `FileFormatError` if a file is not of an image format that is read."""
    if reader:
        is_read = reader in _READ_BY
    else:
        with Path(path).open("rb") as file:
            is_read = suffix_of_content(file.read(_HEAD)) is not None
    if not is_read:
        raise FileFormatError(
            f"{path}: it is not an image that is read; save it as PNG, EXR, "
            "TIFF, TGA, HDR, JPEG, WebP, BMP, DDS or PPM"
        )


def check_image_format(
    path: PathLike,
    bits: int | None = None,
    *,
    color: bool = False,
    channels: int | None = None,
    lossless: bool = False,
) -> int:
    """Check before a long job that a format can be written; return its bits per channel."""
    kind = format_of(path)
    if lossless and kind is JPEG:
        raise OptionError(f"{path}: JPEG changes what it is given; use png, exr, tif or tga")
    if bits is None:
        return kind.color_bits if color else kind.data_bits
    if bits not in kind.bits:
        raise OptionError(
            f"{path}: {kind.name} holds {_alternatives(kind.bits)} bits per channel, not {bits}; "
            f"{_advice(bits)}"
        )
    if channels is not None and kind.channels is not None and channels not in kind.channels:
        raise OptionError(
            f"{path}: {kind.name} holds {_alternatives(kind.channels)} channels, not {channels}; "
            "use EXR or TIFF"
        )
    return bits


def holds_floats(path: PathLike, bits: int) -> bool:
    """Whether a file with this suffix and these bits per channel stores floats unchanged."""
    return bits in format_of(path).float_bits


def format_of(path: PathLike) -> ImageFormat:
    """Return the format of a file's suffix; raise `FileFormatError` if it is unknown."""
    suffix = Path(path).suffix.lower()
    if suffix not in _FORMATS:
        known = ", ".join(name[1:] for name in _FORMATS)
        raise FileFormatError(
            f"{path}: the image format {quoted(suffix)} is not known; use {known}"
        )
    return _FORMATS[suffix]


def _alternatives(numbers: tuple[int, ...]) -> str:
    return " or ".join(map(str, numbers))


def _advice(bits: int) -> str:
    fitting = {kind.name: None for kind in _FORMATS.values() if bits in kind.bits}
    return f"use {' or '.join(fitting)}" if fitting else "use 8, 16 or 32"
