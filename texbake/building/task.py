"""One step, as a worker runs it: fetch and check the inputs, run the job, store the outputs.

A task may run twice, or on two workers at once: the stored entry of its key appears whole or not at
all, and the second worker finds that of the first.
"""

from __future__ import annotations

import socket
import tempfile
import time
import traceback
from collections.abc import Sequence
from itertools import takewhile
from pathlib import Path
from typing import Any

from texbake import __version__
from texbake.building.digests import MISSING, checksum, file_digest, sidecar_changed
from texbake.building.locations import file_signature, is_url, location_of
from texbake.building.steps import STEP_KINDS
from texbake.building.store import DamagedError, Manifest, Store, StoredFile
from texbake.errors import FileError, TexbakeError, heard_warnings, is_out_of_memory
from texbake.files import scratch_folder
from texbake.jobs.outputs import plain_figures
from texbake.progress import peak_memory_bytes
from texbake.records import dataclass
from texbake.verbs.step import Job


@dataclass(frozen=True, kw_only=True)
class TaskInput:
    """An input of a task."""

    called: str  # its name, which appears in meshes and reports
    sha256: str  # checksum of the file, or of the list of files in a folder
    path: str | None = None  # path or URL of a file outside the store
    # files that are read with it, and their digests or `MISSING`
    sidecars: tuple[tuple[str, str], ...] = ()
    key: str | None = None  # key of the stored result that it belongs to
    files: tuple[StoredFile, ...] = ()  # files of that output; several if it is a folder


class DamagedInputError(Exception):
    """A stored input no longer matches its checksum."""

    def __init__(self, key: str, message: str) -> None:
        super().__init__(message)
        self.key = key


@dataclass(frozen=True, kw_only=True)
class Task:
    """A step for a worker to run."""

    asset: str  # for messages
    step: str
    kind: str
    settings: dict[str, Any]
    inputs: dict[str, tuple[TaskInput, ...]]
    outputs: dict[str, str]  # file name of each
    key: str
    ingredients: dict[str, Any]  # what the key is the checksum of
    store: str  # folder or URL of the store
    threads: int
    memory_bytes: int = 0  # estimate of the memory that it needs
    most_memory: int | None = None  # memory that all running steps together may use
    version: str = __version__  # of texbake; a worker must have the same


@dataclass(frozen=True, kw_only=True)
class TaskOutcome:
    """The outcome of a task."""

    # of the result, made now or found in the store; None if the task has failed
    manifest: Manifest | None = None
    error: str = ""  # one line
    trace: str = ""  # traceback of an error in texbake itself
    attempts: int = 1


def run_task(task: Task) -> TaskOutcome:
    """Run a task; the outcome reports whatever goes wrong."""
    if task.version != __version__:
        return TaskOutcome(
            error=f"the worker on {socket.gethostname()} has texbake {__version__}, this build "
            f"{task.version}; install the same there"
        )
    try:
        return TaskOutcome(manifest=_done(task))
    except DamagedInputError as damage:
        Store(task.store).remove(damage.key)  # the next build makes it again
        return TaskOutcome(error=f"a stored input is damaged: {damage}; build again")
    except TexbakeError as error:
        return TaskOutcome(error=_one_line(str(error)))
    except Exception as error:
        if is_out_of_memory(error):
            return TaskOutcome(error=f"out of memory; {memory_advice(task)}")
        message = _one_line(f"{type(error).__name__}: {error}")
        return TaskOutcome(error=f"texbake itself failed: {message}", trace=traceback.format_exc())


def _done(task: Task) -> Manifest:
    store = Store(task.store)
    try:
        there = store.find(task.key)
    except DamagedError:
        store.remove(task.key)
        there = None
    if there is not None:  # from a worker that was killed before it could answer
        return there
    kind = STEP_KINDS[task.kind]
    start = time.perf_counter()
    with store.folder() as folder, scratch_folder() as copies:
        inputs = {
            role: tuple(fetched(store, item, copies) for item in items)
            for role, items in task.inputs.items()
        }
        signatures = _signatures(task)
        warned: list[str] = []
        with heard_warnings(warned.append):
            figures = kind.run(
                Job(
                    settings=task.settings,
                    inputs=inputs,
                    outputs={name: folder / file for name, file in task.outputs.items()},
                    threads=task.threads,
                    most_memory=task.most_memory,
                    asset=task.asset,
                )
            )
        if warned:
            figures = {**figures, "notes": [*warned, *figures.get("notes", ())]}
        for path, signature in signatures.items():
            if file_signature(path) != signature:
                raise FileError(f"{path}: it changed while {task.step} read it; build again")
        more = {
            "figures": plain_figures(figures),
            "seconds": time.perf_counter() - start,
            "peak_memory_bytes": peak_memory_bytes(),
        }
        return store.commit(task.key, folder, task.outputs, task.ingredients, more)


def memory_advice(task: Task) -> str:
    """Return what a task may take, and what to do where that is too much, as the end of a line."""
    take = f"it is estimated to take up to {_gigabytes(task.memory_bytes)}"
    if task.most_memory is not None and task.memory_bytes > task.most_memory:
        return (
            f"{take}, of the {_gigabytes(task.most_memory)} that this build may use; "
            "give it a smaller mesh or smaller images, or build where there is more memory"
        )
    return f"{take}; run fewer jobs at once, or give it a smaller mesh or smaller images"


def _gigabytes(n_bytes: int) -> str:
    return f"{n_bytes / (1 << 30):.1f} GB"


def _signatures(task: Task) -> dict[str, Any]:
    inputs = [item for items in task.inputs.values() for item in items if item.path]
    paths = [str(item.path) for item in inputs]
    paths += [path for item in inputs for path, _ in item.sidecars]
    return {path: file_signature(path) for path in paths if not is_url(path)}


def _one_line(text: str) -> str:
    return " ".join(line.strip() for line in text.splitlines())


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
