"""Workers of a Dask cluster, which see the same folders or reach the same URLs.

Dask itself gives the task of a lost worker to another one. A key that is being made for one build
is not made again for another one that uses the same store.

Based on: Matthew Rocklin, "Dask: parallel computation with blocked algorithms and task scheduling",
Proceedings of the 14th Python in Science Conference, 2015.
"""

from __future__ import annotations

import asyncio
import logging
import os
import queue
import time
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import replace
from typing import Any

from texbake import __version__
from texbake.building.digests import checksum
from texbake.building.store import Store
from texbake.building.task import Task, TaskOutcome, memory_advice, run_task
from texbake.errors import FileError, OptionError, TexbakeError, require_library
from texbake.records import dataclass

_ANSWER_SECONDS = 10  # within which a scheduler must answer
_LOAD_SECONDS = 60  # within which workers must answer; they load texbake first
_LOOK_SECONDS = 5  # between looks at whether there are workers, while nothing else happens
_GONE_SECONDS = 60  # without any worker, before a build gives up
_LOUD = ("distributed", "distributed.client", "distributed.comm", "distributed.core")
_AHEAD = 2  # tasks submitted per thread, so that no thread waits for this process
# Share of its memory that the steps on a worker may take; Dask pauses a worker at 0.8.
_MEMORY_SHARE = 0.75


def look_around(place: str, mark: str) -> tuple[str, int, bool]:
    """Return a worker's texbake and processors, and whether it finds the mark of a build."""
    try:
        sees = Store(place).has(mark)
    except TexbakeError:
        sees = False
    return __version__, os.cpu_count() or 1, sees


def run_here(task: Task, max_memory: int | None) -> TaskOutcome:
    """Run a task on a worker, in up to `max_memory` bytes and in its share of the worker's."""
    from distributed import get_worker

    worker: Any = get_worker()
    limit = worker.memory_manager.memory_limit
    own = _task_bytes(limit, worker.state.nthreads) if limit else None
    limits = [most for most in (own, max_memory) if most is not None]
    outcome = run_task(replace(task, most_memory=min(limits, default=None)))
    if outcome.manifest is None:
        return replace(outcome, error=f"{outcome.error} (on {worker.address})")
    return outcome


class SchedulerLostError(FileError):
    """A scheduler, or all its workers, disappeared during a build."""


@dataclass
class _Submission:
    """A task that a scheduler has, and the workers that may run it; None for all."""

    task: Task
    future: Any
    workers: list[str] | None
    attempt: int


class DaskWorkers:
    """The workers of a Dask scheduler; each task may take `max_memory` bytes."""

    def __init__(
        self,
        address: str,
        store: Store,
        threads: int | None = None,
        *,
        max_memory: int | None = None,
        note: Callable[[str], None] = lambda message: None,
    ) -> None:
        self._address, self._note = address, note
        self._max_memory = max_memory
        self._client = _connected(address)
        self._outcomes: queue.SimpleQueue[tuple[int, TaskOutcome]] = queue.SimpleQueue()
        self._submissions: dict[int, _Submission] = {}
        self._looked = time.monotonic()
        self._gone: float | None = None  # since when there have been no workers
        try:
            workers = self._workers()
            if not workers:
                raise FileError(
                    f"{address}: it has no workers; start one with: dask worker {address}"
                )
            processors = self._processors(workers, store)
        except BaseException:
            self.close()
            raise
        n_threads: Counter[str] = Counter()  # of the workers of each machine
        for about in workers.values():
            n_threads[about["host"]] += about["nthreads"]
        self._memory = _memory_of_a_task(workers)  # on each worker
        self.slots = _AHEAD * n_threads.total()
        shares = (processors.get(host, 1) // n for host, n in n_threads.items())
        self.threads = threads or max(1, min(shares))

    def _workers(self) -> dict[str, Any]:
        """Return what the scheduler knows of each worker, by their addresses."""
        workers: dict[str, Any] = self._client.scheduler_info(n_workers=-1)["workers"]
        return workers

    def _processors(self, workers: dict[str, Any], store: Store) -> dict[str, int]:
        """Processors of each machine; raise if one lacks this version of texbake or the store."""
        client, processors = self._client, {}
        try:
            with store.marked() as mark:
                answers: dict[str, Any] = client.sync(
                    client._run, look_around, store.place, mark, workers=list(workers),
                    on_error="return", callback_timeout=_LOAD_SECONDS,
                )  # fmt: skip
        except TimeoutError as error:
            silent = min(workers, key=lambda worker: workers[worker].get("last_seen", 0.0))
            raise FileError(
                f"{self._address}: a worker does not answer, probably {silent}; "
                "end it, or build again when it does"
            ) from error
        for worker, answer in answers.items():
            who = f"{self._address}: the worker {worker}"
            if isinstance(answer, Exception):
                reason = " ".join(f"{type(answer).__name__}: {answer}".split())[:200]
                raise FileError(
                    f"{who} cannot load texbake ({reason}); install {__version__} there"
                )
            version, processors[workers[worker]["host"]], sees = answer
            if version != __version__:
                raise FileError(
                    f"{who} has texbake {version}, this is {__version__}; install the same there"
                )
            if not sees:
                raise FileError(
                    f"{who} does not see the store, {store.place}; share this folder with it, at "
                    "the same path, or give a URL that all workers reach as `store`"
                )
        return processors

    def submit(self, number: int, task: Task, attempt: int = 0) -> None:
        """Submit a task to the scheduler."""
        if self._client.status != "running":
            raise self._lost()
        # Two builds that make one key at the same time share its task.
        key = checksum([task.key, task.store])[:32]
        # With less memory, a bake reads its meshes in chunks, and other steps may crash their
        # worker.
        large = [name for name, most in self._memory.items() if most >= task.memory_bytes]
        workers = large if 0 < len(large) < len(self._memory) else None
        future = self._client.submit(
            run_here,
            task,
            self._max_memory,
            key=f"texbake-{task.step}-{key}-{attempt}",
            pure=False,
            workers=workers,
            # Where others may, each that is idle for a moment takes the task from a busy one.
            allow_other_workers=False,
        )
        self._submissions[number] = _Submission(task, future, workers, attempt)
        future.add_done_callback(lambda done: self._receive(number, done))

    def _receive(self, number: int, future: Any) -> None:
        """Receive the outcome of a task; called by one of Dask's threads."""
        submission = self._submissions.get(number)
        if submission is None or submission.future is not future:  # it was submitted again
            return
        try:
            outcome = self._result(future)
        except BaseException as error:
            outcome = TaskOutcome(error=" ".join(_ending(error, submission.task).split()))
        self._outcomes.put((number, outcome))

    def _result(self, future: Any) -> TaskOutcome:
        """Return the result of a task that is done, however long it takes to get it."""
        while True:
            try:
                outcome: TaskOutcome = future.result(timeout=_ANSWER_SECONDS)
                return outcome
            except TimeoutError:
                if future.status == "error" or self._client.status != "running":
                    raise

    def finished(self, timeout: float | None) -> list[tuple[int, TaskOutcome]]:
        """Wait for a finished task or the timeout; return the outcomes of finished tasks."""
        found = []
        with suppress(queue.Empty):
            found.append(self._outcomes.get(timeout=timeout))
            while True:
                found.append(self._outcomes.get_nowait())
        if self._client.status != "running":
            raise self._lost()
        if found:
            self._gone = None  # a worker was there
        elif time.monotonic() > self._looked + _LOOK_SECONDS:
            self._look_for_workers()
        return [item for item in found if self._submissions.pop(item[0], None) is not None]

    def _look_for_workers(self) -> None:
        """Raise if there have been none for too long; submit tasks again whose workers are gone."""
        self._looked = now = time.monotonic()
        with suppress(OSError):  # a scheduler that disappears just now is reported as such
            workers = self._workers()
            if workers:
                self._gone = None
                self._memory = _memory_of_a_task(workers)
                for number, old in list(self._submissions.items()):
                    if old.workers and workers.keys().isdisjoint(old.workers):  # none is left
                        self.submit(number, old.task, old.attempt + 1)
                        old.future.release()
                return
        start = f"start some with: dask worker {self._address}"
        if self._gone is None:
            self._gone = now
            self._note(f"{self._address}: it has no workers left; {start}")
        elif now > self._gone + _GONE_SECONDS:
            raise SchedulerLostError(
                f"{self._address}: all its workers have disappeared; {start}, and build again; "
                "finished steps are kept"
            )

    def close(self) -> None:
        """Cancel unfinished tasks, and disconnect from the scheduler."""
        with suppress(Exception):
            self._client.cancel([item.future for item in self._submissions.values()])
        with suppress(Exception):
            self._client.close(timeout=2)

    def _lost(self) -> SchedulerLostError:
        return SchedulerLostError(
            f"{self._address}: the scheduler has disappeared; build again, finished steps are kept"
        )


def _task_bytes(limit: int, n_threads: int) -> int:
    """Return the bytes that a task may take on a worker with this memory limit."""
    return int(_MEMORY_SHARE * limit / n_threads)


def _memory_of_a_task(workers: dict[str, Any]) -> dict[str, int]:
    """Return the bytes that a task may take on each worker that has a limit."""
    return {
        worker: _task_bytes(about["memory_limit"], about["nthreads"])
        for worker, about in workers.items()
        if about.get("memory_limit")
    }


def _connected(address: str) -> Any:
    """Return a client of a scheduler."""
    distributed = require_library("distributed", "scheduler", '"texbake[dask]"')
    for name in _LOUD:  # the build reports errors in one line instead
        logging.getLogger(name).setLevel(logging.CRITICAL)
    client: Any = distributed.Client
    try:
        # A client would wait forever for a server that is not a scheduler and never answers. In a
        # thread of its own, because a notebook has a running loop.
        with ThreadPoolExecutor(1) as thread:
            greeting = asyncio.wait_for(_greeted(address), _ANSWER_SECONDS)
            thread.submit(asyncio.run, greeting).result()
        return client(address, timeout=_ANSWER_SECONDS, set_as_default=False, name="texbake")
    except (OSError, ValueError, ImportError, TimeoutError) as error:
        raise FileError(
            f"{address}: no Dask scheduler answers there; start one with: dask scheduler"
        ) from error


async def _greeted(address: str) -> None:
    """Return when whatever listens at an address has answered as Dask does."""
    from distributed.comm import connect

    connection: Any = await connect(address, timeout=_ANSWER_SECONDS)
    connection.abort()


def _ending(error: BaseException, task: Task) -> str:
    """Return one line on a task that ended without an outcome."""
    from distributed import CancelledError, KilledWorker

    if isinstance(error, KilledWorker):
        return (
            f"{error.allowed_failures + 1} workers ended that were to run this step, the last one "
            f"{error.last_worker.address}; the system may have run out of memory: "
            f"{memory_advice(task)}"
        )
    if isinstance(error, CancelledError):
        return "it was cancelled on the scheduler; build again"
    return f"its worker ended: {type(error).__name__}: {str(error)[:200]}"


def check_shared(places: Sequence[str]) -> None:
    """Raise if a cluster cannot reach a place."""
    for place in places:
        if place.startswith("memory://"):
            raise OptionError(
                f"scheduler: {place} is in this process; give a place that all workers can reach"
            )
