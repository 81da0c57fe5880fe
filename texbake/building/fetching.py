"""Inputs of a step, as local files of the worker, verified against their checksums."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path

from texbake.building.digests import MISSING, checksum, file_digest, sidecar_changed
from texbake.building.locations import is_url, location_of
from texbake.building.store import Store, StoredFile
from texbake.errors import FileError


@dataclass(frozen=True, kw_only=True)
class TaskInput:
    """An input of a task."""

    called: str  # its name, which appears in meshes and reports
    path: str | None = None  # path or URL of a file outside the store
    sha256: str | None = None  # checksum of that file
    # files that are read with it, and their digests or `MISSING`
    sidecars: tuple[tuple[str, str], ...] = ()
    key: str | None = None  # key of the stored result that it belongs to
    files: tuple[StoredFile, ...] = ()  # files of that output; several if it is a folder


class DamagedInputError(Exception):
    """A stored input no longer matches its checksum."""

    def __init__(self, key: str, message: str) -> None:
        super().__init__(message)
        self.key = key


def fetched(store: Store, item: TaskInput, copies: Path) -> Path:
    """Return a local file or folder with an input, verified."""
    if item.path is None:
        return _stored(store, item, copies)
    path = Path(item.path)
    places = {name: Path(name) for name, _ in item.sidecars}
    if is_url(item.path):
        there = [name for name, digest in item.sidecars if digest != MISSING]
        places = _downloaded([item.path, *there], copies)
        path = places[item.path]
    if file_digest(path) != item.sha256:
        raise _changed(item.path)
    for name, digest in item.sidecars:
        if name in places and sidecar_changed(str(places[name]), digest):
            raise _changed(name)
    return path


def _changed(path: str) -> FileError:
    return FileError(f"{path}: it changed since the build looked at it; build again")


def _downloaded(urls: Sequence[str], copies: Path) -> dict[str, Path]:
    """Return copies of files behind URLs, in the same relative folders."""
    parts = {url: [part for part in url.split("/") if part] for url in urls}
    folders = zip(*(found[:-1] for found in parts.values()), strict=False)
    common = len(list(takewhile(lambda names: len(set(names)) == 1, folders)))
    whole = Path(tempfile.mkdtemp(dir=copies))
    placed = {}
    for url, found in parts.items():
        folder, name = url.rsplit("/", 1)
        placed[url] = whole.joinpath(*found[common:])
        placed[url].parent.mkdir(parents=True, exist_ok=True)
        location_of(folder).fetch(name, copies).rename(placed[url])
    return placed


def _stored(store: Store, item: TaskInput, copies: Path) -> Path:
    assert item.key is not None
    paths = []
    for file in item.files:
        try:
            path = store.fetch(file, copies)
            good = file_digest(path) == file.sha256
        except FileError as error:
            raise DamagedInputError(item.key, str(error)) from error
        if not good:
            raise DamagedInputError(item.key, f"{file.name} does not have its checksum")
        paths.append(path)
    if len(item.files) == 1 and not item.files[0].path:
        return paths[0]
    # A folder; copied files are assembled again.
    if store.is_local:
        depth = item.files[0].path.count("/") + 1
        return paths[0].parents[depth - 1]
    whole = copies / checksum([file.sha256 for file in item.files])[:16]
    for path, file in zip(paths, item.files, strict=True):
        target = whole / file.path
        target.parent.mkdir(parents=True, exist_ok=True)
        path.rename(target)
    return whole
