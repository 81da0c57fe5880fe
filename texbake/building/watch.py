"""Builds again whenever a file is saved; polls files, which works on every disk and network."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from texbake.building.assets import find_assets
from texbake.building.build import build, local_workers
from texbake.building.file import read_pipeline
from texbake.building.graph import FileSource, plan_nodes
from texbake.building.locations import file_signature
from texbake.building.options import BuildOptions
from texbake.building.progress import BuildListener
from texbake.building.report import BuildResult
from texbake.building.sidecars import followed_files, sidecars
from texbake.errors import TexbakeError
from texbake.files import PathLike

_POLL_SECONDS = 0.25
# A build waits for at most this many polls: some programs save without a pause.
_MOST_POLLS = 40

Signatures = dict[str, Any]


def watch(
    path: PathLike,
    options: BuildOptions | None = None,
    *,
    listener: BuildListener | None = None,
    built: Callable[[BuildResult | TexbakeError], None],
    until: Callable[[], bool] = lambda: False,
    poll_seconds: float = _POLL_SECONDS,
) -> None:
    """Build a pipeline, and again whenever the pipeline file or a file that it reads is saved.

    A build starts once nothing changes any more, for programs that save in several steps, and at
    the latest 40 polls after the first change. Workers stay warm between builds.
    """
    options = options or BuildOptions()
    workers = None if options.scheduler is not None else local_workers(options)
    try:
        while not until():
            before = _signatures(path, options)
            try:
                built(build(path, options, listener=listener, workers=workers))
            except TexbakeError as error:
                built(error)
            _wait(path, options, before, until, poll_seconds)
    finally:
        if workers is not None:
            workers.close()


def _wait(
    path: PathLike,
    options: BuildOptions,
    before: Signatures,
    until: Callable[[], bool],
    poll_seconds: float,
) -> None:
    """Wait until something is saved, and then until nothing changes between two polls."""
    now = before
    n_polls = 0  # since the first change
    while not until():
        last, now = now, _signatures(path, options)
        n_polls += now != before
        if n_polls and (now == last or n_polls == _MOST_POLLS):
            return
        time.sleep(poll_seconds)


def _signatures(path: PathLike, options: BuildOptions) -> Signatures:
    """Return what changes when the pipeline file or any file that it reads is saved."""
    files = {str(path)}
    try:
        pipeline = read_pipeline(path)
        assets = find_assets(pipeline, options.only)
        files |= {
            source.path
            for node in plan_nodes(pipeline, assets).values()
            for sources in node.inputs.values()
            for source in sources
            if isinstance(source, FileSource)
        }
    except TexbakeError:
        pass  # the build has reported it
    for file in list(files):
        files.update(followed_files(file, lambda name: map(str, sidecars(Path(name)))))
    return {file: file_signature(Path(file)) for file in sorted(files)}
