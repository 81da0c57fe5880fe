"""Checksums of values, of unchanged files, which are remembered, and of their sidecars.

A file counts as unchanged while its size, times and inode are the same. One that was changed within
one step of the file system's clock before it was read is read again the next time.

Sidecars are files that a mesh file names and that are read with it. They follow from its content
alone, and not from which files exist, so that they can be remembered as long as that is the same. A
line that can be read as several names gives all of them. `is_followed` says which are read.
"""

from __future__ import annotations

import hashlib
import json
import os
import posixpath
import re
import struct
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import unquote

from texbake.building.locations import file_signature, is_url, location_of
from texbake.errors import FileError, TexbakeError
from texbake.files import read_bytes, replacing, require_file, scratch_folder
from texbake.limits import allows_outside, is_within
from texbake.mesh.files.fbx_materials import image_names
from texbake.mesh.files.fbx_scene import read_scene
from texbake.mesh.files.mtl import map_name
from texbake.mesh.files.obj_write import uv_sets_path
from texbake.mesh.files.reader_process import read_in_child
from texbake.mesh.files.source import decode_name

_TICK_NS = 50_000_000
MISSING = "missing"  # in place of the digest of a missing file


def canonical(value: Any) -> bytes:
    """Return JSON in which each value is written in one way only: keys sorted, no blanks, UTF-8."""
    text = json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    return text.encode("utf-8", "surrogateescape")


def checksum(value: Any) -> str:
    """Return the SHA-256 of the canonical JSON of a value."""
    return hashlib.sha256(canonical(value)).hexdigest()


def file_digest(path: str | os.PathLike[str]) -> str:
    """Return the SHA-256 of a file."""
    require_file(path)
    try:
        with Path(path).open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise FileError(f"{path}: cannot be read: {error.strerror or error}") from error


class Digests:
    """Digests of files, kept in a file of their own."""

    def __init__(self, path: Path, *, trusting: bool = True) -> None:
        self._path = path
        self._known: dict[str, list[Any]] = {}
        if trusting:
            with suppress(OSError, ValueError, AttributeError, TypeError, KeyError, RecursionError):
                kept = json.loads(path.read_bytes())
                if checksum(kept["files"]) == kept["checksum"]:
                    # Of any shape, where others may write to the folder.
                    self._known = {
                        file: [signature, str(digest), *map(list, names)]
                        for file, (signature, digest, *names) in kept["files"].items()
                    }
        self._changed = False

    def digest(self, path: str) -> str:
        """Return the SHA-256 of a file, or of the file behind a URL."""
        signature = _signature(path)
        if signature is None:
            if is_url(path):
                raise FileError(f"{path}: there is no such file; check its name")
            require_file(path)  # raises what the path is instead
        known = self._known.get(path)
        if known is not None and known[0] == signature:
            return str(known[1])
        digest = _remote_digest(path) if is_url(path) else file_digest(path)
        if _signature(path) != signature:
            raise FileError(f"{path}: it changed while it was read; build again when it is done")
        if signature is not None and (is_url(path) or signature[2] + _TICK_NS < time.time_ns()):
            self.remember(path, signature, digest)
        return digest

    def sidecars(self, path: str) -> list[tuple[str, str]]:
        """Return the files that are read with a file, and their digests or `MISSING`."""
        found = []
        for name in followed_files(path, self._named):
            digest = MISSING  # the reader of the file reports it
            with suppress(FileError):
                digest = self.digest(name)
            found.append((name, digest))
        return found

    def _named(self, path: str) -> list[str]:
        if not path.lower().endswith(tuple(_READERS)):
            return []
        known = self._known.get(path)
        if known is not None and len(known) > 2 and known[0] == _signature(path):
            return [str(name) for name in known[2]]
        names = _named_at(path) if is_url(path) else [str(name) for name in sidecars(Path(path))]
        if known is not None and len(known) == 2 and known[0] == _signature(path):
            known.append(names)
            self._changed = True
        return names

    def is_known(self, path: str, digest: str) -> bool:
        """Whether a file has this digest; it is read only if it may have changed."""
        try:
            return self.digest(path) == digest
        except FileError:
            return False

    def remember(self, path: str, signature: Any, digest: str) -> None:
        """Remember that a file with this signature has this digest."""
        self._known[path] = [list(signature), digest]
        self._changed = True

    def forget(self, is_stale: Callable[[str], bool]) -> None:
        """Forget the digests of files that nobody is likely to ask for again."""
        stale = [path for path in self._known if is_stale(path)]
        for path in stale:
            del self._known[path]
        self._changed |= bool(stale)

    def save(self) -> None:
        """Write the remembered digests; the file appears whole or not at all."""
        if self._changed:
            with replacing(self._path) as temporary:
                kept = {"checksum": checksum(self._known), "files": self._known}
                temporary.write_text(json.dumps(kept), encoding="utf-8")
            self._changed = False


def _signature(path: str) -> list[Any] | None:
    if is_url(path):
        folder, name = path.rsplit("/", 1)
        found = location_of(folder).signature(name)
    else:
        found = file_signature(path)
    return None if found is None else list(found)


def _remote_digest(path: str) -> str:
    folder, name = path.rsplit("/", 1)
    content = location_of(folder).read(name)
    if content is None:
        raise FileError(f"{path}: there is no such file; check its name")
    return hashlib.sha256(content).hexdigest()


def _named_at(url: str) -> list[str]:
    """Return the URLs that the file behind a URL names; none if it cannot be read."""
    folder, name = url.rsplit("/", 1)
    scheme, _, root = folder.partition("://")
    with scratch_folder() as copies, suppress(FileError):
        copy = location_of(folder).fetch(name, copies)
        below = [os.path.relpath(found, copy.parent) for found in sidecars(copy)]
        return [f"{scheme}://{posixpath.normpath(posixpath.join(root, path))}" for path in below]
    return []


def sidecar_changed(path: str, digest: str) -> bool:
    """Whether a file that is read with another one has changed since the build looked at it."""
    try:
        return file_digest(path) != digest
    except FileError:
        return digest != MISSING


_LIBRARY = re.compile(rb"^[^\S\r\n]*mtllib[^\S\r\n]+([^\r\n]+)", re.MULTILINE)
_MAP = re.compile(
    rb"^[^\S\r\n]*(?:map_\w+|bump|disp|norm)[^\S\r\n]+([^\r\n]+)", re.MULTILINE | re.IGNORECASE
)


def sidecars(path: Path) -> list[Path]:
    """Files that a mesh or .mtl file names, in its order; of a USD file all that it is made of."""
    found: dict[str, None] = {}
    with suppress(
        OSError, ValueError, AttributeError, TypeError, KeyError, RecursionError, struct.error,
        TexbakeError,
    ):  # fmt: skip
        found.update(dict.fromkeys(_READERS[path.suffix.lower()](path)))
    return [path.parent / name for name in found if "\0" not in name]


def is_followed(path: str, name: str) -> bool:
    """Whether a build reads the file that another one names, by the rules that readers follow."""
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
    for item in read_scene(path).objects.values():
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
