"""Builds everything that a pipeline file describes; only steps whose inputs changed run again.

`watch` polls the files, which works on every disk and network.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import AbstractContextManager, closing, nullcontext
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from texbake import __version__
from texbake.building.digests import Digests, followed_files, sidecars
from texbake.building.file import Pipeline, read_pipeline
from texbake.building.graph import Id, absolute, find_assets, plan_nodes
from texbake.building.locations import file_signature, is_url, locked
from texbake.building.options import BuildOptions
from texbake.building.report import (
    FINISHED,
    INSIDE,
    INTERRUPTED,
    REPORT,
    RUNNING,
    BuildResult,
    asset_results,
    write_build_report,
    write_overview,
)
from texbake.building.resolve import CURRENT, Resolver, StepState, machine_memory
from texbake.building.schedule import BuildEvent, BuildListener, Schedule
from texbake.building.store import Publisher, Store
from texbake.building.workers import Executor, LocalWorkers
from texbake.errors import TexbakeError, counted
from texbake.files import PathLike, check_name, make_folder, replacing
from texbake.jobs.outputs import check_page
from texbake.parallel import default_threads
from texbake.records import dataclass

_MEMORY_SHARE = 0.8


@dataclass(frozen=True)
class PlannedStep:
    """What a build would do with one step."""

    asset: str
    step: str
    kind: str
    state: str  # `current`, `runs`, `may run` (a step before it runs) or `fails`
    why: str


def build(
    path: PathLike,
    options: BuildOptions | None = None,
    *,
    html: PathLike | None = None,
    command: str = "",
    listener: BuildListener | None = None,
    workers: Executor | None = None,
) -> BuildResult:
    """Build those assets of a pipeline file that are not up to date.

    Parameters
    ----------
    path
        The pipeline file.
    options
        None for `BuildOptions()`.
    html, command
        File for a page of all assets, and what the page shows as the command that made it.
    listener
        Receives every event of the build.
    workers
        Run the steps and outlive the build; None for workers that end with it.

    Returns
    -------
    BuildResult
        Also written as `build.json`. It lists assets that failed, which raise nothing. The outputs
        are the same, byte for byte, for any number of jobs and threads.

    Raises
    ------
    FileFormatError
        Something in the pipeline file is wrong.
    FileError
        The folder cannot be written, another build is running in it and `wait` is not set, or the
        scheduler does not answer or disappears.
    """
    options = options or BuildOptions()
    listener = listener or (lambda event: None)
    check_page(html)
    pipeline = read_pipeline(path)
    site = Site(pipeline, options)
    site.make()

    def note(message: str) -> None:
        listener(BuildEvent(event="note", message=message))

    with (
        locked(site.inside / "lock", wait=options.wait, note=note),
        _executor(options, site, workers, note) as executor,
    ):
        result = _build(pipeline, site, options, listener, executor)
    if html is not None:
        write_overview(html, result, command=command)
    return result


def plan_build(path: PathLike, options: BuildOptions | None = None) -> list[PlannedStep]:
    """Return what `build` would do, and why; nothing is written."""
    options = options or BuildOptions()
    pipeline = read_pipeline(path)
    site = Site(pipeline, options)
    nodes = plan_nodes(pipeline, find_assets(pipeline, options.only), site.outputs)
    states = {step: StepState(node) for step, node in nodes.items()}
    resolver = site.resolver(states)
    return [_planned(state, states, resolver, site.publisher) for state in states.values()]


class Site:
    """The folders of a build."""

    def __init__(self, pipeline: Pipeline, options: BuildOptions) -> None:
        self.folder = Path(options.folder or pipeline.folder).absolute()
        self.inside = self.folder / INSIDE
        self.outputs = _place(pipeline, pipeline.outputs, self.folder)  # a folder or a URL
        self.store = Store(_place(pipeline, pipeline.store, self.inside / "store"))
        for place in (str(self.folder), self.outputs, self.store.place):
            if not is_url(place):
                check_name(place)
        self.digests = Digests(self.inside / "digests.json", trusting=not options.verify)
        self.publisher = Publisher(self.outputs, self.store, self.digests)

    def make(self) -> None:
        """Make the folders."""
        make_folder(self.inside)
        ignore = self.inside / ".gitignore"
        if not ignore.exists():
            with replacing(ignore) as temporary:
                temporary.write_text("*\n", encoding="utf-8")

    def resolver(self, states: dict[Id, StepState]) -> Resolver:
        """Return what finds out which steps have results."""
        return Resolver(states, self.store, self.digests, self.inside / "last.json")


def _place(pipeline: Pipeline, place: str | None, default: Path) -> str:
    return str(default) if place is None else absolute(pipeline, place)


def _build(
    pipeline: Pipeline,
    site: Site,
    options: BuildOptions,
    listener: BuildListener,
    executor: Executor,
) -> BuildResult:
    started, start = datetime.now(UTC).isoformat(timespec="seconds"), time.perf_counter()
    assets = find_assets(pipeline, options.only)
    nodes = plan_nodes(pipeline, assets, site.outputs)
    states = {step: StepState(node) for step, node in nodes.items()}
    site.store.clean()
    begun = {
        "texbake": __version__, "state": RUNNING, "pipeline": str(pipeline.path),
        "started": started, "assets": [],
    }  # fmt: skip
    write_build_report(site.folder / REPORT, begun)
    listener(BuildEvent(event="began", total=len(states)))
    memory = options.memory_bytes or int(_MEMORY_SHARE * machine_memory())
    resolver = site.resolver(states)
    schedule = Schedule(
        states,
        resolver,
        site.publisher,
        executor,
        memory_bytes=None if options.scheduler else memory,
        listener=listener,
    )
    state = INTERRUPTED
    try:
        schedule.run()
        if options.prune:
            site.store.prune({step.key for step in states.values()})
        state = FINISHED
    finally:
        resolver.save()
        result = BuildResult(
            pipeline=str(pipeline.path),
            folder=site.folder,
            state=state,
            started=started,
            seconds=time.perf_counter() - start,
            options={**asdict(options), "folder": str(site.folder)},
            assets=asset_results([asset.name for asset in assets], states, site.outputs),
        )
        write_build_report(site.folder / REPORT, result.to_json())
    listener(BuildEvent(event="ended", done=len(states), total=len(states)))
    return result


def local_workers(options: BuildOptions) -> LocalWorkers:
    """Return workers on this machine, as the options say."""
    jobs = options.jobs or default_threads()
    return LocalWorkers(jobs, options.threads or max(1, default_threads() // jobs))


def _executor(
    options: BuildOptions, site: Site, workers: Executor | None, note: Callable[[str], None]
) -> AbstractContextManager[Executor]:
    """Return workers that end with the block, unless they are given."""
    if workers is not None:
        return nullcontext(workers)
    if options.scheduler is None:
        return closing(local_workers(options))
    from texbake.building.dask_scheduler import DaskWorkers, check_shared

    check_shared((site.store.place, site.outputs))
    return closing(
        DaskWorkers(
            options.scheduler,
            site.store,
            options.threads,
            max_memory=options.memory_bytes,
            note=note,
        )
    )


def _planned(
    state: StepState, states: dict[Id, StepState], resolver: Resolver, publisher: Publisher
) -> PlannedStep:
    asset, step = state.node.id

    def planned(what: str, why: str) -> PlannedStep:
        return PlannedStep(asset, step, state.node.table.kind.name, what, why)

    before = [step for step in state.node.waits_for if states[step].state != CURRENT]
    if before:
        return planned("may run", f"{', '.join(name for _, name in before)} before it")
    try:
        if not resolver.look(state, repair=False):
            return planned("runs", "; ".join(state.reasons))
    except TexbakeError as error:
        return planned("fails", str(error))
    state.state = CURRENT
    assert state.manifest is not None
    n_missing = len(publisher.missing(state.node, state.manifest))
    what = "restored" if resolver.is_as_before(state) else "written"
    missing = counted(n_missing, "output is", "outputs are")
    return planned("current", f"{missing} {what}" if n_missing else "")


_POLL_SECONDS = 0.25
# A build waits for at most this many polls: some programs save without a pause.
_MOST_POLLS = 40


def watch(
    path: PathLike,
    options: BuildOptions | None = None,
    *,
    listener: BuildListener | None = None,
    built: Callable[[BuildResult | TexbakeError], None],
    until: Callable[[], bool] = lambda: False,
    poll_seconds: float = _POLL_SECONDS,
) -> None:
    """Build a pipeline, and again, with warm workers, whenever one of its files has been saved."""
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
    before: dict[str, Any],
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


def _signatures(path: PathLike, options: BuildOptions) -> dict[str, Any]:
    """Return what changes when the pipeline file or any file that it reads is saved."""
    files = {str(path)}
    try:
        pipeline = read_pipeline(path)
        for node in plan_nodes(pipeline, find_assets(pipeline, options.only)).values():
            files.update(node.files)
    except TexbakeError:
        pass  # the build has reported it
    named: set[str] = set()
    for file in files:
        named.update(followed_files(file, lambda name: map(str, sidecars(Path(name)))))
    return {file: file_signature(Path(file)) for file in sorted(files | named)}
