"""Workers on this machine: processes that stay warm between steps, and are replaced if they end.

A worker that is killed loses only the step it was running. A new worker tries the step once more,
in case it was not the cause; if the second worker ends as well, the step has failed.

Run as a program (`python -m texbake.building.workers`), this module is one worker: it reads tasks
from stdin, one line of JSON each, and writes their outcomes to stdout. It ends as soon as stdin
does, whatever it is doing, so that no worker outlives its build. What libraries print goes to
stderr.
"""

from __future__ import annotations

import json
import os
import queue
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
from contextlib import suppress
from dataclasses import replace
from typing import IO, Any, Protocol

from texbake.building.task import (
    FAILED,
    LOST,
    Task,
    TaskOutcome,
    memory_advice,
    run_task,
)
from texbake.child import end_with_parent
from texbake.files import new_scratch_folder
from texbake.parallel import module_path

MOST_ATTEMPTS = 2
_PATIENCE = 2.0  # seconds for workers to end by themselves
_LAST_WORDS = 1 << 16  # bytes of what a worker has printed in which its last line is looked for


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
        self._crew: list[threading.Thread] = []
        self._processes: set[_Process] = set()
        self._lock = threading.Lock()
        self._closed = False

    @property
    def process_ids(self) -> list[int]:
        """Ids of the running workers."""
        with self._lock:
            return [process.id for process in self._processes]

    def submit(self, number: int, task: Task) -> None:
        """Start a task as soon as a worker is free."""
        if len(self._crew) < self.slots:
            thread = threading.Thread(target=self._serve, args=(len(self._crew),), daemon=True)
            thread.start()
            self._crew.append(thread)
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
        with self._lock:
            self._closed = True
            processes = list(self._processes)
        for _ in self._crew:
            self._tasks.put(None)
        for process in processes:
            process.kill()
        for thread in self._crew:  # each notices the end of its process and cleans up
            thread.join(_PATIENCE)

    def _serve(self, slot: int) -> None:
        """Run one task after another in a process, and in a new one if that ends."""
        process: _Process | None = None
        try:
            while (item := self._tasks.get()) is not None:
                number, task = item
                outcome = TaskOutcome(status=LOST)
                for attempt in range(1, MOST_ATTEMPTS + 1):
                    try:
                        process = process or self._start()
                        if process is None:  # closed
                            return
                        outcome = process.ask(task)
                    except Exception as error:  # a step without an outcome would be waited for
                        message = _describe(error, started=process)
                        outcome = TaskOutcome(status=FAILED, error=message)
                        if process is not None:
                            self._bury(process)
                            process = None
                    outcome = replace(outcome, attempts=attempt, worker=f"{slot + 1}")
                    if outcome.status != LOST:
                        break
                    assert process is not None
                    self._bury(process)
                    process = None
                if outcome.status == LOST:
                    outcome = replace(outcome, status=FAILED)
                self._outcomes.put((number, outcome))
        finally:
            if process is not None:
                self._bury(process)

    def _start(self) -> _Process | None:
        with self._lock:
            if self._closed:
                return None
            process = _Process(self.threads)
            self._processes.add(process)
            return process

    def _bury(self, process: _Process) -> None:
        process.end()
        with self._lock:
            self._processes.discard(process)


def _describe(error: Exception, *, started: _Process | None) -> str:
    """Return one line on what went wrong with a worker, or with starting it."""
    reason = " ".join((getattr(error, "strerror", None) or str(error)).split())
    if started is None:
        return f"no worker can be started: {reason}; free memory or disk, or use fewer jobs"
    return f"its worker gave no valid answer: {type(error).__name__}: {reason[:200]}"


class _Process:
    """One worker process."""

    def __init__(self, threads: int) -> None:
        # The last output of libraries is the only hint on why a worker died.
        self._said: IO[bytes] = tempfile.TemporaryFile(prefix="texbake-worker-")  # noqa: SIM115
        # A worker that is killed cannot remove its temporary files itself.
        self._scratch = new_scratch_folder()
        names = "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"
        try:
            self._process = subprocess.Popen(
                # -P: files in the current folder are not imported as modules.
                [sys.executable, "-P", "-m", "texbake.building.workers"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._said,
                env={
                    **os.environ,
                    **dict.fromkeys(names, str(threads)),
                    "PYTHONPATH": module_path(),
                    "TMPDIR": str(self._scratch),
                },
            )
        except OSError:
            self._said.close()
            shutil.rmtree(self._scratch, ignore_errors=True)
            raise

    @property
    def id(self) -> int:
        """Id of the process."""
        return self._process.pid

    def ask(self, task: Task) -> TaskOutcome:
        """Run a task; the outcome is `lost` if the process ends before it answers."""
        assert self._process.stdin is not None and self._process.stdout is not None
        line = b""
        with suppress(OSError, ValueError):
            self._process.stdin.write(json.dumps(task.to_json()).encode() + b"\n")
            self._process.stdin.flush()
            line = self._process.stdout.readline()
        if not line.endswith(b"\n"):
            return TaskOutcome(status=LOST, error=self._ending(task))
        values: dict[str, Any] = json.loads(line)
        return TaskOutcome(**values)

    def kill(self) -> None:
        """End the process, busy or not; a running task gets the outcome `lost`."""
        with suppress(OSError):
            self._process.kill()

    def end(self) -> None:
        """End the process, and close its pipes."""
        self.kill()
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(_PATIENCE)
        for pipe in (self._process.stdin, self._process.stdout, self._said):
            assert pipe is not None
            with suppress(OSError):  # data that could not be sent
                pipe.close()
        shutil.rmtree(self._scratch, ignore_errors=True)

    def _ending(self, task: Task) -> str:
        """Return how the process ended, with the last line that it printed."""
        try:
            code = self._process.wait(_PATIENCE)
        except subprocess.TimeoutExpired:
            code = 0
        how = f"exit code {code}"
        if code < 0:
            with suppress(ValueError):
                how = signal.Signals(-code).name
        self._said.seek(max(self._said.seek(0, os.SEEK_END) - _LAST_WORDS, 0))
        said = self._said.read().decode("utf-8", "replace").split("\n")
        last = next((line.strip() for line in reversed(said) if line.strip()), "")
        message = f"its worker ended ({how}), twice"
        if how == "SIGKILL":
            message += f"; the system may have run out of memory: {memory_advice(task)}"
        return f"{message}: {last[:200]}" if last else message


def main() -> None:
    """Run one task after another, as a worker process."""
    # Ctrl-C reaches all processes of a terminal; the build decides what happens to workers.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    tasks: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    threading.Thread(target=_read, args=(tasks,), daemon=True).start()
    while True:
        outcome = run_task(json.loads(tasks.get()))
        answers.write(json.dumps(outcome).encode() + b"\n")
        answers.flush()


def _read(tasks: queue.SimpleQueue[bytes]) -> None:
    for line in sys.stdin.buffer:
        tasks.put(line)
    os._exit(0)


if __name__ == "__main__":
    main()
