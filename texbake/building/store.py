"""The store of results by their keys, with a checksum of every file, and their publication.

An entry is a folder with the files and `manifest.json`. It is made elsewhere and renamed into
place, so that it appears whole or not at all; behind a URL the manifest is written last. Entries
are never changed. Published outputs are copies, which may be changed or lost.
"""

from __future__ import annotations

import json
import secrets
import shutil
import time
from collections.abc import Container, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from texbake.building.digests import Digests, checksum, file_digest
from texbake.building.graph import Node
from texbake.building.locations import LocalFolder, file_errors, file_signature, location_of
from texbake.errors import FileError, TexbakeError
from texbake.files import appearing_together, make_folder, scratch_folder
from texbake.records import dataclass
from texbake.unfinished import clear_once, unfinished_name

MANIFEST = "manifest.json"
_TEMPORARY = "tmp"  # never the beginning of a key
_LEFT_SECONDS = 7 * 86_400  # after which nobody works in a temporary folder any more
Manifest = dict[str, Any]
Ingredients = dict[str, Any]  # what a key is the checksum of


class DamagedError(TexbakeError):
    """A stored result no longer matches its checksums."""


@dataclass(frozen=True)
class StoredFile:
    """One file of an entry."""

    name: str  # path below the store
    path: str  # path below the output; empty for an output that is a file
    sha256: str
    size: int


class Store:
    """Stored results in a folder or behind a URL."""

    def __init__(self, place: str) -> None:
        self.place = place
        self._location = location_of(place)
        self.is_local = isinstance(self._location, LocalFolder)

    def find(self, key: str) -> Manifest | None:
        """Return the manifest of an entry, None without one."""
        name = f"{entry_name(key)}/{MANIFEST}"
        content = self._location.read(name)
        if content is None:
            return None
        path = self._location.path(name)
        try:
            manifest = json.loads(content)
            said = manifest.pop("checksum")
            known = checksum(manifest), manifest["key"], checksum(manifest["ingredients"])
            if known != (said, key, key):
                raise DamagedError(f"{path} does not have its checksum")
            _require_plain_names(manifest, path)
        except (ValueError, KeyError, AttributeError, TypeError, RecursionError) as error:
            raise DamagedError(f"{path} is damaged") from error
        return dict(manifest)

    def check(self, manifest: Manifest, digests: Digests, outputs: Iterable[str]) -> None:
        """Raise `DamagedError` if an output or a file is missing, or a checksum does not match."""
        stored = stored_files(manifest)
        missing = set(outputs).difference(stored)
        if missing:
            place = self._location.path(entry_name(manifest["key"]))
            raise DamagedError(f"{place} has no {min(missing)}")
        for files in stored.values():
            for file in files:
                path = self._location.path(file.name)
                if not digests.is_known(path, file.sha256):
                    raise DamagedError(f"{path} does not have its checksum")

    def remember(self, manifest: Manifest, digests: Digests) -> None:
        """Remember the digests of the files of a new entry, which were just written."""
        for files in stored_files(manifest).values():
            for file in files:
                signature = self._location.signature(file.name)
                if signature is not None:
                    digests.remember(self._location.path(file.name), signature, file.sha256)

    def forget_others(self, keys: Container[str], digests: Digests) -> None:
        """Forget the digests of all entries but those of some keys, which `watch` would keep."""
        root = self._location.path("")

        def is_stale(path: str) -> bool:
            _, _, name = path.partition(root)
            return path.startswith(root) and name[3:].partition("/")[0] not in keys

        digests.forget(is_stale)

    def fetch(self, file: StoredFile, folder: Path) -> Path:
        """Return a local file with the content of a stored one; it may be a copy in `folder`."""
        return self._location.fetch(file.name, folder)

    @contextmanager
    def folder(self) -> Iterator[Path]:
        """Make an empty folder for an entry, to be committed within the block."""
        if not self.is_local:
            with scratch_folder() as folder:
                yield folder
            return
        parent = make_folder(Path(self.place) / _TEMPORARY)
        with file_errors(parent):
            folder = parent / unfinished_name(parent)
            folder.mkdir()
        try:
            yield folder
        finally:
            shutil.rmtree(folder, ignore_errors=True)

    def commit(
        self,
        key: str,
        folder: Path,
        outputs: dict[str, str],
        ingredients: Ingredients,
        more: dict[str, Any],
    ) -> Manifest:
        """Store a folder of results as an entry."""
        manifest = {
            "key": key,
            "ingredients": ingredients,
            "outputs": {name: _listed(folder, file) for name, file in outputs.items()},
            **more,
        }
        text = json.dumps({**manifest, "checksum": checksum(manifest)}, indent=1)
        try:
            (folder / MANIFEST).write_text(text, encoding="utf-8")
        except OSError as error:
            raise FileError(f"{folder}: cannot be written: {error.strerror}") from error
        self._location.put_folder(folder, entry_name(key), MANIFEST)
        return manifest

    @contextmanager
    def marked(self) -> Iterator[str]:
        """Keep a file in the store within the block; yield its name, for `has` elsewhere."""
        folder = f"{_TEMPORARY}/{secrets.token_hex(8)}"
        with scratch_folder() as scratch:
            source = scratch / "mark.txt"
            source.write_text(folder, encoding="utf-8")
            self._location.put(source, f"{folder}/{source.name}")
        try:
            yield f"{folder}/{source.name}"
        finally:
            self._location.remove(folder)

    def has(self, name: str) -> bool:
        """Whether a file of this name is in the store."""
        return self._location.read(name) is not None

    def remove(self, key: str) -> None:
        """Remove an entry."""
        self._location.remove(entry_name(key))

    def prune(self, keys: set[str]) -> int:
        """Remove all entries but those of some keys; return how many. A URL is left unchanged."""
        if not self.is_local:
            return 0
        doomed = [
            entry.name
            for entry in Path(self.place).glob("??/*")
            if entry.name not in keys and "." not in entry.name
        ]
        for name in doomed:
            self.remove(name)
        return len(doomed)

    def clean(self) -> None:
        """Remove what killed builds of this machine left, and of other machines after a week."""
        if not self.is_local:
            return
        for doomed in Path(self.place).glob("??/*.*"):  # entries that were being removed
            shutil.rmtree(doomed, ignore_errors=True)
        temporary = Path(self.place) / _TEMPORARY
        if temporary.is_dir():
            clear_once(temporary)
            for folder in temporary.iterdir():
                with suppress(OSError):
                    if folder.stat().st_mtime < time.time() - _LEFT_SECONDS:
                        shutil.rmtree(folder)


def entry_name(key: str) -> str:
    """Return the folder of an entry below the store."""
    return f"{key[:2]}/{key}"


def stored_files(manifest: Manifest) -> dict[str, list[StoredFile]]:
    """Return the files of each output of an entry."""
    root = entry_name(manifest["key"])
    found = {}
    for output, listed in manifest["outputs"].items():
        base = f"{root}/{listed['file']}"
        found[output] = [
            StoredFile(
                f"{base}/{item['path']}" if item["path"] else base,
                item["path"],
                item["sha256"],
                item["size"],
            )
            for item in listed["files"]
        ]
    return found


def _require_plain_names(manifest: Manifest, path: str) -> None:
    """Raise `DamagedError` if a manifest, which others may have written, names files elsewhere."""
    files = [file for found in stored_files(manifest).values() for file in found]
    names = [listed["file"] for listed in manifest["outputs"].values()]
    if not all(map(_is_plain, (*names, *(file.name for file in files)))):
        raise DamagedError(f"{path} names files outside its folder")
    if not all(type(file.size) is int and isinstance(file.sha256, str) for file in files):
        raise TypeError("a size or a checksum is of another type")


def _is_plain(name: str) -> bool:
    """Whether a name stays below its folder on every system."""
    parts = name.replace("\\", "/").split("/")
    return "\0" not in name and not any(part in ("", ".", "..") or ":" in part for part in parts)


def output_digest(manifest: Manifest, output: str) -> str:
    """Return the SHA-256 of an output: of its file, or of the list of files in its folder."""
    files = manifest["outputs"][output]["files"]
    if len(files) == 1 and not files[0]["path"]:
        return str(files[0]["sha256"])
    return checksum(files)


def _listed(folder: Path, name: str) -> dict[str, Any]:
    """Return the checksums of an output, which is a file or a folder of files."""
    path = folder / name
    if path.is_dir():
        files = sorted(file for file in path.rglob("*") if file.is_file())
        names = [file.relative_to(path).as_posix() for file in files]
    elif path.is_file():
        files, names = [path], [""]
    else:
        raise FileError(f"{name}: the step did not write it; its result was discarded")
    return {
        "file": name,
        "files": [
            {"path": inner, "sha256": file_digest(file), "size": (file_signature(file) or (0,))[0]}
            for file, inner in zip(files, names, strict=True)
        ],
    }


class Publisher:
    """Copies outputs to the folder of outputs if they are missing there."""

    def __init__(self, place: str, store: Store, digests: Digests) -> None:
        self.place = place
        self._location = location_of(place)
        self._store, self._digests = store, digests

    def missing(self, node: Node, manifest: Manifest) -> list[tuple[str, StoredFile]]:
        """Return outputs that are missing or changed: their names and stored files."""
        stored = stored_files(manifest)
        return [
            (name, file)
            for output, base in node.published.items()
            for file in stored[output]
            for name in (f"{base}/{file.path}" if file.path else base,)
            if not self._digests.is_known(self._location.path(name), file.sha256)
        ]

    def publish(self, node: Node, manifest: Manifest) -> int:
        """Publish the outputs that are missing or changed; return how many files."""
        missing = self.missing(node, manifest)
        if not missing:
            return 0
        with scratch_folder() as copies:
            with appearing_together():
                for name, file in missing:
                    self._location.put(self._store.fetch(file, copies), name)
            for name, file in missing:
                signature = self._location.signature(name)
                if signature is not None:  # it may be gone already
                    self._digests.remember(self._location.path(name), signature, file.sha256)
        return len(missing)
