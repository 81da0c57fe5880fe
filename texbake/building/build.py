"""Builds everything that a pipeline file describes; only steps whose inputs changed run again."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from texbake import __version__
from texbake.building import progress
from texbake.building.assets import PipelineAsset, absolute, find_assets
from texbake.building.digests import Digests
from texbake.building.disk import LockError, locked
from texbake.building.file import Pipeline, read_pipeline
from texbake.building.graph import Id, plan_nodes
from texbake.building.locations import is_url
from texbake.building.memory import machine_memory
from texbake.building.options import BuildOptions
from texbake.building.progress import BuildEvent, BuildListener, noted
from texbake.building.report import (
    FINISHED,
    INSIDE,
    INTERRUPTED,
    REPORT,
    RUNNING,
    BuildResult,
    asset_results,
    write_build_report,
)
from texbake.building.resolve import LastKeys, Resolver, StepState
from texbake.building.schedule import Schedule, states_of
from texbake.building.store import Publisher, Store
from texbake.building.workers import Executor, LocalWorkers
from texbake.errors import OptionError, TexbakeError
from texbake.files import PathLike, check_name, make_folder, replacing
from texbake.jobs.outputs import check_page
from texbake.parallel import default_threads

_MEMORY_SHARE = 0.8


@dataclass(frozen=True)
class PlannedStep:
    """What a build would do with one step.

    Attributes
    ----------
    state : str
        `current`, `runs`, `may run` (a step before it runs) or `fails`.
    """

    asset: str
    step: str
    kind: str
    state: str
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
    listener = listener or _nobody
    check_page(html)
    pipeline = read_pipeline(path)
    site = Site(pipeline, options)
    site.make()
    try:
        with locked(site.inside / "lock", wait=options.wait, note=noted(listener)):
            result = _build(pipeline, site, options, listener, workers)
    except LockError:  # the folder may be read-only
        current = _current_result(pipeline, site, options, listener)
        if current is None:
            raise
        result = current
    if html is not None:
        from texbake.building.overview import write_overview

        write_overview(html, result, command=command)
    return result


def plan_build(path: PathLike, options: BuildOptions | None = None) -> list[PlannedStep]:
    """Return what `build` would do, and why; nothing is written."""
    options = options or BuildOptions()
    pipeline = read_pipeline(path)
    site = Site(pipeline, options)
    return _planned_steps(pipeline, site, find_assets(pipeline, options.only))[1]


def _planned_steps(
    pipeline: Pipeline, site: Site, assets: Sequence[PipelineAsset]
) -> tuple[dict[Id, StepState], list[PlannedStep]]:
    states = states_of(plan_nodes(pipeline, assets, site.outputs))
    resolver, publisher = site.resolver(states)
    return states, [_planned(state, states, resolver, publisher) for state in states.values()]


class Site:
    """The folders of a build.

    Attributes
    ----------
    inside : Path
        For the next build: the lock, digests, and the store unless it is elsewhere.
    outputs : str
        Folder or URL.
    """

    def __init__(self, pipeline: Pipeline, options: BuildOptions) -> None:
        self.folder = Path(options.folder or pipeline.folder).absolute()
        self.inside = self.folder / INSIDE
        self._verify = options.verify
        self.outputs = _place(pipeline, pipeline.outputs, self.folder)
        self.store = Store(_place(pipeline, pipeline.store, self.inside / "store"))
        for place in (str(self.folder), self.outputs, self.store.place):
            if not is_url(place):
                check_name(place)
        self.digests = Digests(self.inside / "digests.json", trusting=not options.verify)
        self.last = LastKeys(self.inside / "last.json")

    def make(self) -> None:
        """Make the folders."""
        make_folder(self.inside)
        ignore = self.inside / ".gitignore"
        if not ignore.exists():
            with replacing(ignore) as temporary:
                temporary.write_text("*\n", encoding="utf-8")

    def resolver(self, states: dict[Id, StepState]) -> tuple[Resolver, Publisher]:
        """Return what finds the state of steps, and what publishes outputs."""
        resolver = Resolver(states, self.store, self.digests, self.last)
        return resolver, Publisher(self.outputs, self.store, self.digests)


def _place(pipeline: Pipeline, given: str | None, default: Path) -> str:
    return str(default) if given is None else absolute(pipeline, given)


def _build(
    pipeline: Pipeline,
    site: Site,
    options: BuildOptions,
    listener: BuildListener,
    workers: Executor | None,
) -> BuildResult:
    started, start = _now()
    assets = find_assets(pipeline, options.only)
    states = states_of(plan_nodes(pipeline, assets, site.outputs))
    site.store.clean()
    resolver, publisher = site.resolver(states)
    begun: dict[str, Any] = {
        "texbake": __version__, "state": RUNNING, "pipeline": str(pipeline.path),
        "started": started, "assets": [],
    }  # fmt: skip
    write_build_report(site.folder / REPORT, begun)

    def result(state: str) -> BuildResult:
        return _result(pipeline, site, options, assets, states, state, (started, start))

    listener(BuildEvent(event="began", total=len(states)))
    state = INTERRUPTED
    try:
        _run(states, site, resolver, publisher, options, listener, workers)
        if options.prune:
            site.store.prune({step.key for step in states.values()})
        state = FINISHED
    finally:
        site.last.save(states)
        site.store.forget_others(site.last.all(), site.digests)
        site.digests.save()
        ended = result(state)
        write_build_report(site.folder / REPORT, ended.to_json())
    listener(BuildEvent(event="ended", done=len(states), total=len(states)))
    return ended


def _current_result(
    pipeline: Pipeline, site: Site, options: BuildOptions, listener: BuildListener
) -> BuildResult | None:
    """Return the result of a build with nothing to do, which writes nothing, or None."""
    begun = _now()
    assets = find_assets(pipeline, options.only)
    states, steps = _planned_steps(pipeline, site, assets)
    if any((step.state, step.why) != (progress.CURRENT, "") for step in steps):
        return None
    listener(BuildEvent(event="began", total=len(steps)))
    for done, step in enumerate(steps, start=1):
        listener(
            BuildEvent(
                event="step",
                asset=step.asset,
                step=step.step,
                state=step.state,
                done=done,
                total=len(steps),
            )
        )
    listener(BuildEvent(event="ended", done=len(steps), total=len(steps)))
    result = _result(pipeline, site, options, assets, states, FINISHED, begun)
    return replace(result, is_written=False)


def _now() -> tuple[str, float]:
    """Return the time of day, and a clock time to measure durations from."""
    return datetime.now(UTC).isoformat(timespec="seconds"), time.perf_counter()


def _result(
    pipeline: Pipeline,
    site: Site,
    options: BuildOptions,
    assets: Sequence[PipelineAsset],
    states: dict[Id, StepState],
    state: str,
    begun: tuple[str, float],
) -> BuildResult:
    started, start = begun
    return BuildResult(
        pipeline=str(pipeline.path),
        folder=site.folder,
        state=state,
        started=started,
        seconds=time.perf_counter() - start,
        options={**asdict(options), "folder": str(site.folder)},
        assets=asset_results([asset.name for asset in assets], states, site.outputs),
    )


def _run(
    states: dict[Id, StepState],
    site: Site,
    resolver: Resolver,
    publisher: Publisher,
    options: BuildOptions,
    listener: BuildListener,
    workers: Executor | None,
) -> None:
    memory = options.memory_bytes or int(_MEMORY_SHARE * machine_memory())
    with _crew(options, site, workers, noted(listener)) as executor:
        Schedule(
            states,
            resolver,
            site.store,
            publisher,
            executor,
            memory_bytes=None if options.scheduler else memory,
            listener=listener,
            slots=_slots(options, executor),
        ).run()


def _slots(options: BuildOptions, executor: Callable[[], Executor]) -> int:
    """Return how many steps run at once, without starting workers on this machine for it."""
    return default_jobs(options) if options.scheduler is None else executor().slots


def default_jobs(options: BuildOptions) -> int:
    """Return how many steps run at once on this machine."""
    return options.jobs or default_threads()


def local_workers(options: BuildOptions) -> LocalWorkers:
    """Return workers on this machine, as the options say."""
    jobs = default_jobs(options)
    return LocalWorkers(jobs, options.threads or max(1, default_threads() // jobs))


@contextmanager
def _crew(
    options: BuildOptions, site: Site, workers: Executor | None, note: Callable[[str], None]
) -> Iterator[Callable[[], Executor]]:
    """Yield a function that makes workers when they are first needed; end them afterwards."""
    made: list[Executor] = []

    def executor() -> Executor:
        if workers is not None:
            return workers
        if options.scheduler is None:
            made.append(local_workers(options))
        else:
            from texbake.building.dask_scheduler import DaskWorkers, check_shared

            for place in (site.store.place, site.outputs):
                check_shared(place)
            made.append(
                DaskWorkers(
                    options.scheduler,
                    site.store,
                    options.threads,
                    max_memory=options.memory_bytes,
                    note=note,
                )
            )
        return made[0]

    try:
        if options.scheduler is not None:
            if options.jobs is not None:
                raise OptionError(
                    "jobs, scheduler: a cluster sets the number itself; give one of them"
                )
            ready = executor()  # a missing scheduler is found before anything is begun
            yield lambda: ready
        else:
            yield executor
    finally:
        for crew in made:
            crew.close()


def _planned(
    state: StepState, states: dict[Id, StepState], resolver: Resolver, publisher: Publisher
) -> PlannedStep:
    asset, step = state.node.id

    def planned(what: str, why: str) -> PlannedStep:
        return PlannedStep(asset, step, state.node.table.kind.name, what, why)

    before = [step for step in state.node.waits_for if states[step].state != progress.CURRENT]
    if before:
        return planned("may run", f"{', '.join(name for _, name in before)} before it")
    try:
        if not resolver.look(state, repair=False):
            return planned("runs", "; ".join(state.reasons))
    except TexbakeError as error:
        return planned("fails", str(error))
    state.state = progress.CURRENT
    assert state.manifest is not None
    n_missing = len(publisher.missing(state.node, state.manifest))
    what = "restored" if resolver.is_as_before(state) else "written"
    return planned("current", f"{n_missing} outputs are {what}" if n_missing else "")


def _nobody(event: BuildEvent) -> None:
    """Ignore an event."""
