"""Results of steps, kept by their keys, with a checksum of every file.

An entry is a folder with the files and `manifest.json`. It is made elsewhere and comes to its place
by a rename, so that it is there whole or not at all; behind a URL the manifest comes last. Entries
are never changed.
"""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from texbake.building.digests import Digests, checksum, file_digest
from texbake.building.disk import clear, owned_folder
from texbake.building.graph import Node
from texbake.building.locations import LocalFolder, file_signature, location_of
from texbake.errors import FileError, TexbakeError

MANIFEST = "manifest.json"
_TEMPORARY = "tmp"  # which is no beginning of a key
Manifest = dict[str, Any]
Ingredients = dict[str, Any]  # what a key is the checksum of


class DamagedError(TexbakeError):
    """A stored result is not what was stored."""


@dataclass(frozen=True)
class StoredFile:
    """One file of an entry.

    Attributes
    ----------
    name : str
        Below the store.
    path : str
        Below the output, empty for an output that is a file.
    sha256 : str
    size : int
    """

    name: str
    path: str
    sha256: str
    size: int


class Store:
    """A folder of results, or a place for them behind a URL."""

    def __init__(self, place: str) -> None:
        self.place = place
        self._location = location_of(place)
        self.is_local = isinstance(self._location, LocalFolder)

    def find(self, key: str) -> Manifest | None:
        """Manifest of an entry, None where there is none.

        Raises
        ------
        DamagedError
            It is not what was written.
        """
        name = f"{entry_name(key)}/{MANIFEST}"
        content = self._location.read(name)
        if content is None:
            return None
        try:
            manifest = json.loads(content)
            said = manifest.pop("checksum")
        except (ValueError, KeyError, AttributeError, TypeError) as error:
            raise DamagedError(f"{self._location.path(name)} is damaged") from error
        if checksum(manifest) != said or manifest["key"] != key:
            raise DamagedError(f"{self._location.path(name)} does not have its checksum")
        return dict(manifest)

    def check(self, manifest: Manifest, digests: Digests) -> None:
        """Raise `DamagedError` where a file of an entry is missing or is not what was stored."""
        for files in stored_files(manifest).values():
            for file in files:
                path = self._location.path(file.name)
                if not digests.is_known(path, file.sha256):
                    raise DamagedError(f"{path} does not have its checksum")

    def remember(self, manifest: Manifest, digests: Digests) -> None:
        """Believe that the files of a new entry are what was just stored."""
        for files in stored_files(manifest).values():
            for file in files:
                signature = self._location.signature(file.name)
                if signature is not None:
                    digests.remember(self._location.path(file.name), signature, file.sha256)

    def fetch(self, file: StoredFile, folder: Path) -> Path:
        """Return a local file with the content of a stored one, maybe a copy in a folder."""
        return self._location.fetch(file.name, folder)

    @contextmanager
    def folder(self) -> Iterator[Path]:
        """Make an empty folder, from which an entry can be put into its place within the block."""
        if self.is_local:
            with owned_folder(Path(self.place) / _TEMPORARY) as folder:
                yield folder
            return
        with tempfile.TemporaryDirectory(prefix="texbake-", ignore_cleanup_errors=True) as name:
            yield Path(name)

    def commit(
        self,
        key: str,
        folder: Path,
        outputs: dict[str, str],
        ingredients: Ingredients,
        more: dict[str, Any],
    ) -> Manifest:
        """Put a folder of results into its place.

        Parameters
        ----------
        key
        folder
            Holds the outputs; it is gone afterwards.
        outputs
            File name of each.
        ingredients
            What the key is made of, kept to tell later what changed.
        more
            Further entries of the manifest: figures, times.

        Raises
        ------
        FileError
            An output is missing, or there is no space left.
        """
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

    def remove(self, key: str) -> None:
        """Remove an entry."""
        self._location.remove(entry_name(key))

    def prune(self, keys: set[str]) -> int:
        """Remove all entries but some; return how many were removed. A URL is left as it is."""
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
        """Remove what builds that were ended left behind; nothing of others that run."""
        if self.is_local:
            clear(Path(self.place) / _TEMPORARY)
            for doomed in Path(self.place).glob("??/*.*"):  # entries on their way out
                shutil.rmtree(doomed, ignore_errors=True)


def entry_name(key: str) -> str:
    """Folder of an entry below the store."""
    return f"{key[:2]}/{key}"


def stored_files(manifest: Manifest) -> dict[str, list[StoredFile]]:
    """Files of each output of an entry."""
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


def output_digest(manifest: Manifest, output: str) -> str:
    """SHA-256 that stands for an output: of its file, or of the list of those in its folder."""
    files = manifest["outputs"][output]["files"]
    if len(files) == 1 and not files[0]["path"]:
        return str(files[0]["sha256"])
    return checksum(files)


def _listed(folder: Path, name: str) -> dict[str, Any]:
    """Checksums of an output, which is a file or a folder of files."""
    path = folder / name
    if path.is_dir():
        files = sorted(file for file in path.rglob("*") if file.is_file())
        names = [file.relative_to(path).as_posix() for file in files]
    elif path.is_file():
        files, names = [path], [""]
    else:
        raise FileError(f"{name}: the step did not write it; nothing was kept of it")
    return {
        "file": name,
        "files": [
            {
                "path": inner,
                "sha256": file_digest(file),
                "size": (file_signature(file) or (0,))[0],
            }
            for file, inner in zip(files, names, strict=True)
        ],
    }


class Publisher:
    """Copies outputs to the folder of outputs, where they are not there yet."""

    def __init__(self, place: str, store: Store, digests: Digests) -> None:
        self.place = place
        self._location = location_of(place)
        self._store, self._digests = store, digests

    def missing(self, node: Node, manifest: Manifest) -> list[tuple[str, StoredFile]]:
        """Outputs that are not there, or are not what was stored: their names and stored files."""
        stored = stored_files(manifest)
        return [
            (name, file)
            for output, base in node.published.items()
            for file in stored[output]
            for name in (f"{base}/{file.path}" if file.path else base,)
            if not self._digests.is_known(self._location.path(name), file.sha256)
        ]

    def publish(self, node: Node, manifest: Manifest) -> int:
        """Put out what is missing; return how many files.

        Raises
        ------
        FileError
            A file cannot be written.
        """
        missing = self.missing(node, manifest)
        if not missing:
            return 0
        with tempfile.TemporaryDirectory(prefix="texbake-") as copies:
            for name, file in missing:
                self._location.put(self._store.fetch(file, Path(copies)), name)
                signature = self._location.signature(name)
                if signature is not None:  # nobody has taken it away at once
                    self._digests.remember(self._location.path(name), signature, file.sha256)
        return len(missing)
