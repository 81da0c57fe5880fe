"""Files that a mesh file names and that are read with it: buffers, materials, images."""

from __future__ import annotations

import json
import mmap
import re
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from urllib.parse import unquote

_LIBRARY = re.compile(rb"^[^\S\r\n]*mtllib[^\S\r\n]+([^\r\n]+)", re.MULTILINE)
_MAP = re.compile(rb"^[^\S\r\n]*(?:map_\w+|bump|disp|norm)[^\S\r\n]+([^\r\n]+)", re.MULTILINE)


SUFFIXES = (".gltf", ".obj", ".mtl")


def companions(path: Path) -> list[Path]:
    """Files that a .gltf, .obj or .mtl file names itself, in its order; none of another kind.

    What cannot be read names nothing here: whoever reads the file says what is wrong with it.
    """
    found: dict[Path, None] = {}
    readers = {".gltf": _of_gltf, ".obj": _of_obj, ".mtl": _of_mtl}
    with suppress(OSError, ValueError, AttributeError, TypeError, KeyError):
        found.update(dict.fromkeys(readers[path.suffix.lower()](path)))
    return list(found)


def _of_gltf(path: Path) -> Iterator[Path]:
    document = json.loads(path.read_bytes())
    for listed in ("buffers", "images"):
        for item in document.get(listed, ()):
            uri = item.get("uri", "")
            if uri and not uri.startswith("data:"):
                yield path.parent / unquote(uri)


def _of_obj(path: Path) -> Iterator[Path]:
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        names = [_text(name) for name in _LIBRARY.findall(data)]
    for name in names:
        yield path.parent / name


def _of_mtl(path: Path) -> Iterator[Path]:
    for value in _MAP.findall(path.read_bytes()):
        # Options stand before the name, which may have blanks of its own.
        words = _text(value).split(" ")
        tails = (path.parent / " ".join(words[i:]) for i in range(len(words)))
        yield next((tail for tail in tails if tail.is_file()), path.parent / words[-1])


def _text(name: bytes) -> str:
    return name.decode("utf-8", "surrogateescape").strip().replace("\\", "/")
