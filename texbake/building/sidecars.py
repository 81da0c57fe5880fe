"""Files that a mesh file names and that are read with it: buffers, materials, images, layers.

They follow from the content of the file alone, and not from which files exist, so that they can be
remembered as long as the content is the same. A line that can be read as several names gives all
of them. Which of them are read is another question: `is_followed`.
"""

from __future__ import annotations

import json
import posixpath
import re
import struct
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from pathlib import Path, PurePosixPath
from urllib.parse import unquote

from texbake.building.locations import is_url
from texbake.errors import TexbakeError
from texbake.files import read_bytes, require_file
from texbake.limits import allows_outside, is_within
from texbake.mesh.files.fbx_materials import image_names
from texbake.mesh.files.fbx_scene import read_scene
from texbake.mesh.files.mtl import map_name
from texbake.mesh.files.obj_write import uv_sets_path
from texbake.mesh.files.reader_process import read_in_child
from texbake.mesh.files.source import decode_name

_LIBRARY = re.compile(rb"^[^\S\r\n]*mtllib[^\S\r\n]+([^\r\n]+)", re.MULTILINE)
_MAP = re.compile(
    rb"^[^\S\r\n]*(?:map_\w+|bump|disp|norm)[^\S\r\n]+([^\r\n]+)", re.MULTILINE | re.IGNORECASE
)


def sidecars(path: Path) -> list[Path]:
    """Return the files that a mesh or .mtl file names, in its order; none for other files.

    For a USD file these are all files that it is composed of, if usd-core is installed, and the
    existing tiles of its images. A file that cannot be read names nothing here; the step that reads
    it reports the error.
    """
    found: dict[str, None] = {}
    with suppress(
        OSError, ValueError, AttributeError, TypeError, KeyError, RecursionError, struct.error,
        TexbakeError,
    ):  # fmt: skip
        found.update(dict.fromkeys(_READERS[path.suffix.lower()](path)))
    return [path.parent / name for name in found if "\0" not in name]


def is_followed(path: str, name: str) -> bool:
    """Whether a build reads the file that another one names, by their paths or URLs.

    Readers of meshes follow no name out of the folder of a file, unless that is allowed. A build
    must not either: the name could be that of a secret, and of another machine behind a URL, which
    is never asked.
    """
    if not is_url(path):
        return allows_outside() or is_within(Path(path).parent, name)
    place, named = (
        PurePosixPath(posixpath.normpath(url.partition("://")[2])) for url in (path, name)
    )
    return named.is_relative_to(place.parts[0] if allows_outside() else place.parent)


def followed_files(path: str, named: Callable[[str], Iterable[str]]) -> list[str]:
    """Return the files that are read with a file: those that it names, those that they name ..."""
    found: dict[str, None] = {}
    pending = [path]
    while pending:
        file = pending.pop()
        for name in named(file):
            if name not in found and name != path and is_followed(file, name):
                pending.append(name)
                found[name] = None
    return list(found)


def _of_gltf(path: Path) -> Iterator[str]:
    return _of_document(read_bytes(path))


def _of_glb(path: Path) -> Iterator[str]:
    require_file(path)
    with path.open("rb") as file:
        magic, length = struct.unpack("<4s8xI4x", file.read(20))
        if magic != b"glTF":
            raise ValueError("not a binary glTF file")
        return _of_document(file.read(length))  # the first chunk


def _of_document(content: bytes) -> Iterator[str]:
    document = json.loads(content)
    for listed in ("buffers", "images"):
        for item in document.get(listed, ()):
            uri = item.get("uri", "")
            if uri and not uri.startswith("data:"):
                name = unquote(uri)
                yield from dict.fromkeys([name, name.replace("\\", "/")])


def _of_obj(path: Path) -> Iterator[str]:
    names: dict[str, None] = {}
    for library in _LIBRARY.findall(read_bytes(path)):
        name = _text(library)
        # One name with blanks in it, or several without.
        names.update(dict.fromkeys([name, *name.split()]))
    yield from names
    yield uv_sets_path(path).name


def _of_mtl(path: Path) -> Iterator[str]:
    for value in _MAP.findall(read_bytes(path)):
        name = map_name(_text(value))[0]
        yield from dict.fromkeys([name, PurePosixPath(name).name])


def _of_fbx(path: Path) -> Iterator[str]:
    scene = read_scene(path)
    for item in scene.objects.values():
        if item.node.name in ("Texture", "Video"):
            yield from image_names(item)


def _text(name: bytes) -> str:
    return decode_name(name).strip().replace("\\", "/")


def _of_usd(path: Path) -> Iterator[str]:
    yield from map(str, read_in_child(path, "files", {}))


_READERS = {
    ".gltf": _of_gltf, ".glb": _of_glb, ".obj": _of_obj, ".mtl": _of_mtl, ".fbx": _of_fbx,
    ".usd": _of_usd, ".usda": _of_usd, ".usdc": _of_usd,
}  # fmt: skip
SUFFIXES = tuple(_READERS)
