"""Files that a mesh file names and that are read with it: buffers, materials, images, layers.

They follow from the content of the file alone, and not from which files exist, so that they can be
remembered as long as the content is the same. A line that can be read as several names gives all
of them.
"""

from __future__ import annotations

import json
import re
import struct
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import IO
from urllib.parse import unquote

from texbake.errors import TexbakeError
from texbake.files import read_bytes
from texbake.mesh.files.usd_process import ask_usd

_LIBRARY = re.compile(rb"^[^\S\r\n]*mtllib[^\S\r\n]+([^\r\n]+)", re.MULTILINE)
_MAP = re.compile(rb"^[^\S\r\n]*(?:map_\w+|bump|disp|norm)[^\S\r\n]+([^\r\n]+)", re.MULTILINE)
_WORD = re.compile(r"(?<!\S)\S")  # where one begins


def companions(path: Path) -> list[Path]:
    """Return the files that a mesh or .mtl file names, in its order; none for other files.

    For a USD file these are all files that it is composed of, if usd-core is installed, and the
    existing tiles of its images. A file that cannot be read names nothing here; the step that reads
    it reports the error.
    """
    found: dict[Path, None] = {}
    with suppress(
        OSError, ValueError, AttributeError, TypeError, KeyError, struct.error, TexbakeError
    ):
        found.update(dict.fromkeys(_READERS[path.suffix.lower()](path)))
    return [name for name in found if "\0" not in str(name)]


def _of_gltf(path: Path) -> Iterator[Path]:
    yield from _of_document(path, path.read_bytes())


def _of_glb(path: Path) -> Iterator[Path]:
    with path.open("rb") as file:
        yield from _of_document(path, _json_chunk(file))


def _json_chunk(file: IO[bytes]) -> bytes:
    """First chunk of a binary glTF file."""
    magic, length = struct.unpack("<4s8xI4x", file.read(20))
    if magic != b"glTF":
        raise ValueError("not a binary glTF file")
    return file.read(length)


def _of_document(path: Path, content: bytes) -> Iterator[Path]:
    document = json.loads(content)
    for listed in ("buffers", "images"):
        for item in document.get(listed, ()):
            uri = item.get("uri", "")
            if uri and not uri.startswith("data:"):
                yield path.parent / unquote(uri)


def _of_obj(path: Path) -> Iterator[Path]:
    names = [_text(name) for name in _LIBRARY.findall(read_bytes(path))]
    for name in names:
        # One name with blanks in it, or several without.
        for library in dict.fromkeys([name, *name.split()]):
            yield path.parent / library


def _of_mtl(path: Path) -> Iterator[Path]:
    for value in _MAP.findall(path.read_bytes()):
        # Options stand before the name, which may have blanks of its own.
        text = _text(value)
        for word in _WORD.finditer(text):
            yield path.parent / text[word.start() :]


def _text(name: bytes) -> str:
    return name.decode("utf-8", "surrogateescape").strip().replace("\\", "/")


def _of_usd(path: Path) -> Iterator[Path]:
    for name in ask_usd(path, "files", {}):
        yield path.parent / name


_READERS = {
    ".gltf": _of_gltf, ".glb": _of_glb, ".obj": _of_obj, ".mtl": _of_mtl,
    ".usd": _of_usd, ".usda": _of_usd, ".usdc": _of_usd,
}  # fmt: skip
SUFFIXES = tuple(_READERS)
