"""Workers on this machine: processes that stay warm between steps, and are replaced if they end.

A worker that is killed loses only the step it was running. A new worker tries the step once more;
if that is killed as well, the step has failed.

Run as a program (`python -m texbake.building.workers`), this module is one worker.
"""

from __future__ import annotations

import pickle
import queue
import threading
from contextlib import suppress
from dataclasses import asdict, replace
from typing import Protocol

from texbake.building.task import Task, TaskOutcome, memory_advice, run_task
from texbake.child import Child, ChildError, serve

_PATIENCE = 2.0  # seconds for threads to notice the end of their processes


class Executor(Protocol):
    """Runs tasks, several at once."""

    slots: int
    threads: int

    def submit(self, number: int, task: Task) -> None:
        """Start a task; there may be more tasks than slots."""

    def finished(self, timeout: float | None) -> list[tuple[int, TaskOutcome]]:
        """Wait until a task is done or the timeout is over; return outcomes of finished tasks."""

    def close(self) -> None:
        """End all workers, busy or not."""


class LocalWorkers:
    """Worker processes on this machine."""

    def __init__(self, slots: int, threads: int) -> None:
        self.slots, self.threads = slots, threads
        self._tasks: queue.SimpleQueue[tuple[int, Task] | None] = queue.SimpleQueue()
        self._outcomes: queue.SimpleQueue[tuple[int, TaskOutcome]] = queue.SimpleQueue()
        self._children: list[Child] = []
        self._threads: list[threading.Thread] = []

    @property
    def process_ids(self) -> list[int]:
        """Ids of the running workers."""
        return [child.id for child in self._children if child.id is not None]

    def submit(self, number: int, task: Task) -> None:
        """Start a task as soon as a worker is free."""
        if len(self._children) < self.slots:
            child = Child("texbake.building.workers", threads=self.threads)
            self._children.append(child)
            thread = threading.Thread(target=self._serve, args=(child,), daemon=True)
            thread.start()
            self._threads.append(thread)
        self._tasks.put((number, task))

    def finished(self, timeout: float | None) -> list[tuple[int, TaskOutcome]]:
        """Wait until a task is done or the timeout is over; return outcomes of finished tasks."""
        found = []
        with suppress(queue.Empty):
            found.append(self._outcomes.get(timeout=timeout))
            while True:
                found.append(self._outcomes.get_nowait())
        return found

    def close(self) -> None:
        """End all workers."""
        for child in self._children:
            child.close()
            self._tasks.put(None)
        for thread in self._threads:  # each notices the end of its process and cleans up
            thread.join(_PATIENCE)

    def _serve(self, child: Child) -> None:
        """Run one task after another in a child."""
        try:
            while (item := self._tasks.get()) is not None:
                number, task = item
                try:
                    # What comes back is not unpickled: a worker reads files of strangers.
                    outcome = TaskOutcome(**child.ask(pickle.dumps(task)))
                except ChildError as error:
                    outcome = TaskOutcome(error=_ending(error, task))
                except Exception as error:  # a step without an outcome would be waited for
                    outcome = TaskOutcome(error=_describe(error, started=child.id))
                self._outcomes.put((number, replace(outcome, attempts=child.attempts)))
        finally:
            child.end()


def _describe(error: Exception, *, started: int | None) -> str:
    """Return one line on what went wrong with a worker, or with starting it."""
    reason = " ".join((getattr(error, "strerror", None) or str(error)).split())
    if started is None:
        return f"no worker can be started: {reason}; free memory or disk, or use fewer jobs"
    return f"its worker gave no valid answer: {type(error).__name__}: {reason[:200]}"


def _ending(error: ChildError, task: Task) -> str:
    """Return how a worker ended, with the last line that it printed."""
    if error.code is None:
        return f"its worker {error.reason}"
    message = f"its worker ended ({error.how})" + ", twice" * error.is_from_others
    if error.how == "SIGKILL":
        message += f"; the system may have run out of memory: {memory_advice(task)}"
    return f"{message}: {error.said}" if error.said else message


if __name__ == "__main__":
    serve(lambda task: asdict(run_task(pickle.loads(task))))
