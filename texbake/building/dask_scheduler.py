"""Workers of a Dask cluster, which see the same folders or reach the same URLs.

Dask itself gives the task of a lost worker to another one. A key that is being made for one build
is not made again for another one that uses the same store.

Based on: Matthew Rocklin, "Dask: parallel computation with blocked algorithms and task scheduling",
Proceedings of the 14th Python in Science Conference, 2015.
"""

from __future__ import annotations

import asyncio
import logging
import queue
import time
from collections import defaultdict
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, suppress
from typing import Any

from texbake import __version__
from texbake.building.dask_task import processors_here, run_here, sees, version_here
from texbake.building.digests import checksum
from texbake.building.store import Store
from texbake.building.task import FAILED, LOST, Task, TaskOutcome, memory_advice
from texbake.errors import DependencyError, FileError, OptionError

_ANSWER_SECONDS = 10  # within which a scheduler must answer
_LOAD_SECONDS = 60  # within which its workers must answer, who load texbake first
_LOOK_SECONDS = 5  # between looks at whether there are workers, while nothing else happens
_GONE_SECONDS = 60  # without any worker, before a build gives up
_LOUD = ("distributed", "distributed.client", "distributed.comm", "distributed.core")
_AHEAD = 2  # tasks submitted per thread, so that no thread waits for this process
_MOST_REFUSALS = 5  # of one task, by workers that joined later


class SchedulerLostError(FileError):
    """A scheduler, or all its workers, disappeared during a build."""


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
        self._address, self._place, self._tell = address, store.place, note
        self._max_memory = max_memory
        self._client = _connected(address)
        self._outcomes: queue.SimpleQueue[tuple[int, TaskOutcome]] = queue.SimpleQueue()
        self._futures: dict[int, Any] = {}
        self._tasks: dict[int, Task] = {}
        self._limited_to: dict[int, list[str]] = {}  # workers that may run a task, if not all
        self._times: dict[str, int] = defaultdict(int)  # that a key was submitted
        self._refusals: dict[int, int] = defaultdict(int)
        self._unfit: set[str] = set()
        self._memory: dict[str, int] = {}  # for one task on each worker
        self._looked = time.monotonic()
        self._gone: float | None = None  # since when there have been no workers
        self._stack = ExitStack()
        try:
            self._mark = self._stack.enter_context(store.marked())
            shared = self._inspected()
        except BaseException:
            self.close()
            raise
        self.threads = threads or shared

    def _inspected(self) -> int:
        """Set the slots; return the threads of each task."""
        workers = self._client.scheduler_info(n_workers=-1)["workers"]
        if not workers:
            raise FileError(
                f"{self._address}: it has no workers; start one with: dask worker {self._address}"
            )
        for worker, fault in self._faults(workers).items():
            raise FileError(f"{self._address}: the worker {worker} {fault}")
        processors: dict[str, int] = {}
        taken: dict[str, int] = defaultdict(int)
        counts = self._asked(workers, processors_here)
        for worker, about in workers.items():
            processors[about["host"]] = counts.get(worker) or 1
            taken[about["host"]] += about["nthreads"]
        self._memory = _memory_of_a_task(workers)
        self.slots = _AHEAD * sum(taken.values())
        return max(1, min(processors[host] // taken[host] for host in taken))

    def _faults(self, workers: dict[str, Any]) -> dict[str, str]:
        """Return what is wrong with workers that cannot run tasks of this build."""
        faults = {}
        for worker, version in self._asked(workers, version_here).items():
            if isinstance(version, Exception):
                said = " ".join(f"{type(version).__name__}: {version}".split())[:200]
                faults[worker] = f"does not load texbake ({said}); install {__version__} there"
            elif version != __version__:
                faults[worker] = (
                    f"has texbake {version}, this is {__version__}; install the same there"
                )
        good = {worker: about for worker, about in workers.items() if worker not in faults}
        for worker, seen in self._asked(good, sees, self._place, self._mark).items():
            if seen is not True:
                faults[worker] = (
                    f"does not see the store, {self._place}; share this folder with it, at the "
                    "same path, or give a URL that all workers reach as `store`"
                )
        return faults

    def _asked(self, workers: dict[str, Any], function: Any, *arguments: Any) -> dict[str, Any]:
        """Return the answers of workers, busy or not; errors in place of those that have none."""
        if not workers:
            return {}
        client = self._client
        try:
            answers: dict[str, Any] = client.sync(
                client._run, function, *arguments, workers=list(workers), on_error="return",
                callback_timeout=_LOAD_SECONDS,
            )  # fmt: skip
        except TimeoutError as error:
            silent = min(workers, key=lambda worker: workers[worker].get("last_seen", 0.0))
            raise FileError(
                f"{self._address}: a worker does not answer, probably {silent}; "
                "end it, or build again when it does"
            ) from error
        return answers

    def submit(self, number: int, task: Task) -> None:
        """Submit a task to the scheduler."""
        if self._client.status != "running":
            raise self._lost()
        # Two builds that make one key at the same time share its task. A task that is submitted
        # again is another one: what Dask remembers may have been removed from the store.
        key = checksum([task.key, task.store])[:32]
        time_of_key, self._times[key] = self._times[key], self._times[key] + 1
        suited = self._suited(task)
        future = self._client.submit(
            run_here,
            task.to_json(),
            self._max_memory,
            self._mark,
            key=f"texbake-{task.step}-{key}-{time_of_key}",
            pure=False,
            workers=suited,
            # Where others may, each that is idle for a moment takes the task from a busy one.
            allow_other_workers=False,
        )
        self._tasks[number], self._futures[number] = task, future
        self._limited_to[number] = suited or []
        future.add_done_callback(lambda done: self._note(number, done))

    def _suited(self, task: Task) -> list[str] | None:
        """Return the workers that may run a task; None for all of them.

        Those with enough memory, if others have less; a bake that has less goes through its meshes
        in chunks, and other steps may end their worker.
        """
        known = [worker for worker in self._memory if worker not in self._unfit]
        large = [worker for worker in known if self._memory[worker] >= task.memory_bytes]
        if self._unfit:
            return large or known or None
        return large if 0 < len(large) < len(known) else None

    def _note(self, number: int, future: Any) -> None:
        """Receive the outcome of a task; called by one of Dask's threads."""
        if self._futures.get(number) is not future:  # the task was submitted again
            return
        try:
            outcome = TaskOutcome(**self._result(future))
        except (ImportError, AttributeError, TypeError) as error:  # another texbake, or none
            outcome = TaskOutcome(status=LOST, error=f"{type(error).__name__}: {error}")
        except BaseException as error:
            message = _ending(error, self._tasks[number])
            outcome = TaskOutcome(status=FAILED, error=" ".join(message.split()))
        self._outcomes.put((number, outcome))

    def _result(self, future: Any) -> Any:
        """Return the result of a task that is done.

        It may have to come from a worker that has gone since, and then the task runs again; or this
        process may have been stopped while it waited. So a long wait is no fault of the task.
        """
        while True:
            try:
                return future.result(timeout=_ANSWER_SECONDS)
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
        return [
            (number, ended)
            for number, ended in found
            if number in self._tasks and not self._tried_again(number, ended)
        ]

    def _tried_again(self, number: int, outcome: TaskOutcome) -> bool:
        """Forget a task that has ended; submit it again if its worker could not run it."""
        task = self._tasks.pop(number)
        self._futures.pop(number, None)
        self._limited_to.pop(number, None)
        if outcome.status != LOST:
            return False
        self._refusals[number] += 1
        if self._refusals[number] > _MOST_REFUSALS:
            raise FileError(f"{self._address}: no worker can run {task.step}: {outcome.error}")
        workers = self._client.scheduler_info(n_workers=-1)["workers"]
        for worker, fault in self._faults(workers).items():
            if worker not in self._unfit:
                self._tell(f"{self._address}: the worker {worker} gets no steps: it {fault}")
                self._unfit.add(worker)
        self.submit(number, task)
        return True

    def _look_for_workers(self) -> None:
        """Raise if there have been no workers for too long."""
        self._looked = now = time.monotonic()
        with suppress(OSError):  # a scheduler that disappears just now is reported as such
            workers = self._client.scheduler_info(n_workers=-1)["workers"]
            if workers:
                self._gone = None
                self._memory = _memory_of_a_task(workers)
                self._submit_to_others(set(workers))
                return
        start = f"start some with: dask worker {self._address}"
        if self._gone is None:
            self._gone = now
            self._tell(f"{self._address}: it has no workers left; {start}")
        elif now > self._gone + _GONE_SECONDS:
            raise SchedulerLostError(
                f"{self._address}: all its workers have disappeared; {start}, and build again; "
                "finished steps are kept"
            )

    def _submit_to_others(self, workers: set[str]) -> None:
        """Submit tasks again of which all workers that may run them have disappeared."""
        for number, limited_to in list(self._limited_to.items()):
            if limited_to and workers.isdisjoint(limited_to) and number in self._tasks:
                future = self._futures[number]
                self.submit(number, self._tasks[number])
                future.release()

    def close(self) -> None:
        """Cancel unfinished tasks, and disconnect from the scheduler."""
        with suppress(Exception):
            self._client.cancel(list(self._futures.values()))
        with suppress(Exception):
            self._client.close(timeout=2)
        self._stack.close()

    def _lost(self) -> SchedulerLostError:
        return SchedulerLostError(
            f"{self._address}: the scheduler has disappeared; build again, finished steps are kept"
        )


def _memory_of_a_task(workers: dict[str, Any]) -> dict[str, int]:
    """Return the bytes that a task may take on each worker that has a limit."""
    return {
        worker: about["memory_limit"] // about["nthreads"]
        for worker, about in workers.items()
        if about.get("memory_limit")
    }


def _connected(address: str) -> Any:
    """Return a client of a scheduler."""
    try:
        import distributed
    except ImportError as error:
        raise DependencyError(
            'scheduler: dask is missing; install it with: pip install "texbake[dask]"'
        ) from error
    for name in _LOUD:  # the build reports errors in one line instead
        logging.getLogger(name).setLevel(logging.CRITICAL)
    client: Any = distributed.Client
    try:
        # A client would wait forever for a server that is no scheduler and says nothing. In a
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

    made: Any = await connect(address, timeout=_ANSWER_SECONDS)
    made.abort()


def _ending(error: BaseException, task: Task) -> str:
    """Return one line on a task that ended without an outcome."""
    from distributed import CancelledError, KilledWorker

    if isinstance(error, KilledWorker):
        return (
            f"{error.allowed_failures + 1} workers ended while they ran it, the last one "
            f"{error.last_worker.address}; the system may have run out of memory: "
            f"{memory_advice(task)}"
        )
    if isinstance(error, CancelledError):
        return "it was cancelled on the scheduler; build again"
    return f"its worker ended: {type(error).__name__}: {str(error)[:200]}"


def check_shared(place: str) -> None:
    """Raise if a cluster cannot reach a place."""
    if place.startswith("memory://"):
        raise OptionError(
            f"scheduler: {place} is in this process; give a place that all workers can reach"
        )
