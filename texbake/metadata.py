"""What image files say: the metadata of maps, and the chunks of PNG files before their pixels.

A line of text is all that PNG, TIFF, EXR, JPEG and TGA files can all store. The metadata of a map
is a flat JSON object there, the same in every format, so that numbers are preserved exactly. PNG
files are checked before they are decoded.

Based on: Portable Network Graphics (PNG) Specification, third edition, W3C, 2025.
"""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path

from texbake.errors import FileFormatError
from texbake.files import PathLike

Value = float | int | str

# "opengl" (+Y) or "directx" (-Y): the green channel of a tangent-space normal map.
CONVENTION = "texbake:convention"
# "tangent", "object" or "world": the space of a map's vectors.
SPACE = "texbake:space"
# A stored value h is the displacement (h - mid) * scale, in model units.
DISPLACEMENT_MID = "texbake:displacement_mid"
DISPLACEMENT_SCALE = "texbake:displacement_scale"
# A stored value h is the mean curvature (h - mid) * scale, in 1 / model units.
CURVATURE_MID = "texbake:curvature_mid"
CURVATURE_SCALE = "texbake:curvature_scale"
# A stored value h is the thickness h * scale, in model units.
THICKNESS_SCALE = "texbake:thickness_scale"
# A stored value h is the coordinate min + h (max - min); three numbers separated by spaces.
POSITION_MIN = "texbake:position_min"
POSITION_MAX = "texbake:position_max"
# Followed by a value in the map, a number or a color such as #e0a030: the name of its object.
ID = "texbake:id:"


def to_description(metadata: Mapping[str, Value]) -> str:
    """Return metadata as one line of ASCII with sorted keys; "" if it is empty.

    >>> to_description({"texbake:space": "tangent", "texbake:displacement_mid": 0.5})
    '{"texbake:displacement_mid":0.5,"texbake:space":"tangent"}'
    """
    if not metadata:
        return ""
    return json.dumps(dict(metadata), sort_keys=True, separators=(",", ":"))


def from_description(description: str) -> dict[str, Value]:
    """Return the metadata in a description; empty if `to_description` did not write it.

    >>> from_description("a photograph of gravel")
    {}
    """
    try:
        # TGA breaks its comment into lines of 80 characters; JSON strings have no raw line break.
        facts = json.loads(description.replace("\n", ""))
    except (ValueError, RecursionError):
        return {}
    if not isinstance(facts, dict):
        return {}
    return {key: value for key, value in facts.items() if isinstance(value, float | int | str)}


SIGNATURE = b"\x89PNG\r\n\x1a\n"

_PALETTE = 3
_BITS = {0: (1, 2, 4, 8, 16), 2: (8, 16), _PALETTE: (1, 2, 4, 8), 4: (8, 16), 6: (8, 16)}
_LONGEST_SIDE = 1_000_000  # of libpng


def png_description(path: PathLike) -> str:
    """Check a PNG file; return the text under the keyword "Description", or "" if there is none."""
    description = ""
    needs_palette: bool | None = None
    for kind, data in _chunks(path):
        if needs_palette is None:
            needs_palette = _color_type(path, kind, data) == _PALETTE
        needs_palette &= kind != b"PLTE"
        if kind == b"IDAT" and needs_palette:
            raise FileFormatError(f"{path}: the PNG file lacks its palette; get it again")
        if kind == b"tEXt" and data.startswith(b"Description\0"):
            description = data.split(b"\0", 1)[1].decode("latin-1")
    return description


def _color_type(path: PathLike, kind: bytes, header: bytes) -> int:
    """Check the first chunk, of which libpng would complain in a line of its own."""
    if kind != b"IHDR" or len(header) != 13:
        raise FileFormatError(f"{path}: the PNG file has no header; get it again")
    width, height, bits, color, *methods = struct.unpack(">IIBBBBB", header)
    if bits not in _BITS.get(color, ()) or methods not in ([0, 0, 0], [0, 0, 1]):
        raise FileFormatError(f"{path}: the header of the PNG file is damaged; get it again")
    if not 0 < min(width, height) <= max(width, height) <= _LONGEST_SIDE:
        raise FileFormatError(
            f"{path}: it has {width} x {height} pixels; the sides of a PNG file have 1 to "
            f"{_LONGEST_SIDE:,}"
        )
    return int(color)


def is_png(path: PathLike) -> bool:
    """Whether a file begins with the PNG signature."""
    with Path(path).open("rb") as file:
        return file.read(len(SIGNATURE)) == SIGNATURE


def _chunks(path: PathLike) -> Iterator[tuple[bytes, bytes]]:
    """Yield the kind and data of each chunk up to the end of the image; b"" for the pixels."""
    with Path(path).open("rb") as file:
        if file.read(len(SIGNATURE)) != SIGNATURE:
            raise FileFormatError(f"{path}: it is not a PNG file; save it as one")
        left = Path(path).stat().st_size - len(SIGNATURE)
        kind = b""
        while kind != b"IEND":
            head = file.read(8)
            n_bytes, kind = struct.unpack(">I4s", head) if len(head) == 8 else (left, b"")
            # 12 bytes: length, kind and checksum of the chunk. Checked before memory is allocated.
            left -= n_bytes + 12
            if left < 0:
                raise FileFormatError(f"{path}: the PNG file is cut short; get it again")
            data = file.read(n_bytes)
            if zlib.crc32(data, zlib.crc32(kind)) != int.from_bytes(file.read(4), "big"):
                raise FileFormatError(f"{path}: a checksum of the PNG file is wrong; get it again")
            yield kind, b"" if kind == b"IDAT" else data
