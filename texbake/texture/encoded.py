"""Images that lie inside another file, as the bytes of an image file."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

from texbake.errors import FileError, FileFormatError
from texbake.texture.image import Image, read_image

_SUFFIXES = ((0, b"\x89PNG", ".png"), (8, b"WEBP", ".webp"), (0, b"II*\0", ".tif"),
             (0, b"MM\0*", ".tif"), (0, b"\x76\x2f\x31\x01", ".exr"), (0, b"#?", ".hdr"),
             (0, b"P6", ".ppm"), (0, b"\xff\xd8", ".jpg"))  # fmt: skip


def decode_image(data: bytes, name: str, *, color: bool, threads: int | None = None) -> Image:
    """Read an image from the bytes of a file; its first bytes tell the format.

    Parameters
    ----------
    name
        What messages call it, and the suffix where the bytes tell nothing.
    color, threads
        As of `read_image`.

    Raises
    ------
    FileFormatError
        It is not an image, or damaged.
    """
    suffix = Path(name).suffix or ".jpg"
    for start, magic, known in _SUFFIXES:
        if data[start : start + len(magic)] == magic:
            suffix = known
            break
    # OpenImageIO's Python interface reads files alone.
    with TemporaryDirectory(prefix="texbake-") as folder:
        path = Path(folder) / f"image{suffix}"
        path.write_bytes(data)
        try:
            image = read_image(path, color=color, threads=threads)
        except (FileError, FileFormatError) as error:
            raise FileFormatError(str(error).replace(str(path), name)) from error
    return Image(image.pixels, image.metadata, image.bits, image.is_float, name=name)
