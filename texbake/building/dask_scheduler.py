"""Workers of a Dask cluster, which see the same folders or reach the same URLs.

Dask itself gives the task of a lost worker to another one.

Based on: Matthew Rocklin, "Dask: parallel computation with blocked algorithms and task scheduling",
Proceedings of the 14th Python in Science Conference, 2015.
"""

from __future__ import annotations

import logging
import os
import queue
import uuid
from collections import defaultdict
from contextlib import suppress
from typing import Any

from texbake import __version__
from texbake.building.task import (
    FAILED,
    Task,
    TaskOutcome,
    run_task,
)
from texbake.errors import DependencyError, FileError, OptionError

_ANSWER_SECONDS = 10  # within which a scheduler must answer
_LOUD = ("distributed", "distributed.client", "distributed.comm", "distributed.core")
_AHEAD = 2  # tasks submitted per thread, so that no thread waits for this process


class SchedulerLostError(FileError):
    """A scheduler disappeared during a build."""


class DaskWorkers:
    """The workers of a Dask scheduler.

    Parameters
    ----------
    address
        Such as `tcp://host:8786`.
    threads
        Threads of each task; None divides the processors of each machine among the worker threads
        there.

    Raises
    ------
    DependencyError
        Dask is not installed.
    FileError
        No scheduler answers, it has no workers, or a worker has another version of texbake.
    """

    def __init__(self, address: str, threads: int | None = None) -> None:
        try:
            import distributed
        except ImportError as error:
            raise DependencyError(
                'scheduler: dask is missing; install it with: pip install "texbake[dask]"'
            ) from error
        self._address = address
        for name in _LOUD:  # the build reports errors in one line instead
            logging.getLogger(name).setLevel(logging.CRITICAL)
        try:
            client: Any = distributed.Client
            self._client = client(
                address, timeout=_ANSWER_SECONDS, set_as_default=False, name="texbake"
            )
        except (OSError, ValueError, ImportError) as error:
            raise FileError(
                f"{address}: no Dask scheduler answers there; start one with: dask scheduler"
            ) from error
        try:
            shared = self._inspected()
        except BaseException:
            self.close()
            raise
        self.threads = threads or shared
        self._outcomes: queue.SimpleQueue[tuple[int, TaskOutcome]] = queue.SimpleQueue()
        self._futures: dict[int, Any] = {}

    def _inspected(self) -> int:
        """Set the slots; return the threads of each task."""
        workers = self._client.scheduler_info(n_workers=-1)["workers"]
        if not workers:
            raise FileError(
                f"{self._address}: it has no workers; start one with: dask worker {self._address}"
            )
        try:
            versions = self._client.run(_version)
        except Exception as error:  # of any type, raised by a worker without texbake
            raise FileError(
                f"{self._address}: texbake does not load on a worker: {error}; "
                f"install texbake {__version__} there"
            ) from error
        for worker, version in versions.items():
            if version != __version__:
                raise FileError(
                    f"{self._address}: the worker {worker} has texbake {version}, this is "
                    f"{__version__}; install the same there"
                )
        processors: dict[str, int] = {}
        taken: dict[str, int] = defaultdict(int)
        counts = self._client.run(os.cpu_count)
        for worker, about in workers.items():
            processors[about["host"]] = counts.get(worker) or 1
            taken[about["host"]] += about["nthreads"]
        self.slots = _AHEAD * sum(taken.values())
        return max(1, min(processors[host] // taken[host] for host in taken))

    def submit(self, number: int, task: Task) -> None:
        """Submit a task to the scheduler."""
        if self._client.status != "running":
            raise self._lost()
        # A unique key: the store knows what has been made before, not Dask.
        future = self._client.submit(
            run_task, task.to_json(), key=f"texbake-{task.step}-{uuid.uuid4().hex}", pure=False
        )
        self._futures[number] = future
        future.add_done_callback(lambda done: self._note(number, done))

    def _note(self, number: int, future: Any) -> None:
        """Receive the outcome of a task; called by one of Dask's threads."""
        try:
            outcome = TaskOutcome(**future.result(timeout=_ANSWER_SECONDS))
        except BaseException as error:
            message = f"its worker ended: {type(error).__name__}: {str(error)[:200]}"
            outcome = TaskOutcome(status=FAILED, error=" ".join(message.split()))
        self._outcomes.put((number, outcome))

    def finished(self, timeout: float | None) -> list[tuple[int, TaskOutcome]]:
        """Wait until a task is done or the timeout is over; return the outcomes of finished tasks.

        Raises
        ------
        SchedulerLostError
            The scheduler has disappeared.
        """
        found = []
        with suppress(queue.Empty):
            found.append(self._outcomes.get(timeout=timeout))
            while True:
                found.append(self._outcomes.get_nowait())
        if self._client.status != "running":
            raise self._lost()
        for number, _ in found:
            self._futures.pop(number, None)
        return found

    def close(self) -> None:
        """Cancel unfinished tasks, and disconnect from the scheduler."""
        with suppress(Exception):
            self._client.cancel(list(self._futures.values()))
        with suppress(Exception):
            self._client.close(timeout=2)

    def _lost(self) -> SchedulerLostError:
        return SchedulerLostError(
            f"{self._address}: the scheduler has disappeared; build again, finished steps are kept"
        )


def _version() -> str:
    """Return the version of texbake on a worker."""
    from texbake import __version__ as version

    return version


def check_shared(place: str) -> None:
    """Raise if a cluster cannot reach a place.

    Raises
    ------
    OptionError
        It is in the memory of this process.
    """
    if place.startswith("memory://"):
        raise OptionError(
            f"scheduler: {place} is in this process; give a place that all workers can reach"
        )
