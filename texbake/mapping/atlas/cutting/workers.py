"""Child processes that answer requests one after another, and are replaced when they fail.

A compiled library may crash or never return on a hostile mesh. In a process of its own it cannot
harm the rest, and several run side by side. Each process answers many requests, because starting
one costs more than most answers.

A worker is a script that reads requests from stdin until it ends, and writes an answer to each to
stdout. Requests and answers are framed: eight bytes of length, little-endian, then that many bytes.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

from texbake.parallel import module_path, resolve_threads

Result = TypeVar("Result")

# After this many timeouts, no further request is sent: a library that hangs often takes forever.
_MOST_TIMEOUTS = 3

# Signals by which the system, when it is short of memory, or a person ends a worker. The request is
# not at fault, and results must not depend on it: another worker tries once more.
_SENT_BY_OTHERS = {
    -getattr(signal, name)
    for name in ("SIGKILL", "SIGTERM", "SIGINT", "SIGHUP")
    if hasattr(signal, name)
}

_MOST_ATTEMPTS = 2

_POLL_SECONDS = 0.1  # between checks for results; some systems do not interrupt a longer wait


@dataclass(frozen=True, kw_only=True)
class WorkerRequest(Generic[Result]):
    """A request to a worker.

    Attributes
    ----------
    body : callable
        Makes the bytes to send, just before they are sent.
    read : callable
        Turns the bytes of an answer into the result, or raises `ValueError` if they are invalid;
        may take long.
    timeout : float
        Seconds after which the worker is killed.
    most_bytes : int
        Length of the longest valid answer.
    """

    body: Callable[[], bytes]
    read: Callable[[bytes], Result]
    timeout: float
    most_bytes: int


@dataclass(frozen=True)
class WorkerFailure:
    """Why a request has no result.

    Attributes
    ----------
    reason : str
        What the library did, such as "crashed (exit code -11)".
    exit_code : int, optional
        Exit code of a worker that ended on its own.
    """

    reason: str
    exit_code: int | None = None


def ask_workers(
    script: Path,
    requests: Sequence[WorkerRequest[Result]],
    *,
    threads: int | None = None,
    done: Callable[[int], None] | None = None,
) -> list[Result | WorkerFailure]:
    """Send requests to workers and collect their results."""
    crew = _Crew(script, requests)
    n_workers = min(resolve_threads(threads), len(requests))
    pool = ThreadPoolExecutor(max(n_workers, 1), thread_name_prefix="texbake-worker")
    try:
        pending = {pool.submit(crew.work) for _ in range(n_workers)}
        n_counted = 0
        while pending:
            ended, pending = wait(pending, timeout=_POLL_SECONDS)
            for future in ended:
                future.result()
            for number in list(crew.results)[n_counted:]:
                if done is not None:
                    done(number)
                n_counted += 1
    finally:
        crew.dismiss()
        pool.shutdown(wait=True)
    return [crew.results[number] for number in range(len(requests))]


class _Crew(Generic[Result]):
    """The workers for one list of requests, and the results."""

    def __init__(self, script: Path, requests: Sequence[WorkerRequest[Result]]) -> None:
        self.results: dict[int, Result | WorkerFailure] = {}
        self._script, self._requests = script, requests
        self._numbers = iter(range(len(requests)))
        self._workers: set[_Worker] = set()
        self._lock = threading.Lock()
        self._dismissed = False
        self._n_timeouts = 0

    def work(self) -> None:
        """Send one request after another to a worker, which is replaced when it fails."""
        worker: _Worker | None = None
        try:
            while (number := self._next_number()) is not None:
                for _ in range(_MOST_ATTEMPTS):
                    worker = worker or self._new_worker()
                    result = self._result(worker, self._requests[number])
                    if isinstance(result, WorkerFailure):
                        self._bury(worker)
                        worker = None
                        if result.exit_code in _SENT_BY_OTHERS and not self._dismissed:
                            continue
                    break
                self.results[number] = result
        finally:
            self._bury(worker)

    def dismiss(self) -> None:
        """Kill the workers and let no others start."""
        with self._lock:
            self._dismissed = True
            for worker in self._workers:
                worker.process.kill()

    def _next_number(self) -> int | None:
        with self._lock:
            return None if self._dismissed else next(self._numbers, None)

    def _new_worker(self) -> _Worker:
        with self._lock:
            worker = _Worker(self._script)
            self._workers.add(worker)
            if self._dismissed:
                worker.process.kill()
            return worker

    def _result(self, worker: _Worker, request: WorkerRequest[Result]) -> Result | WorkerFailure:
        if self._n_timeouts >= _MOST_TIMEOUTS:
            return WorkerFailure("took too long on others")
        answer = worker.ask(request)
        if isinstance(answer, WorkerFailure):
            self._n_timeouts += worker.timed_out
            return answer
        try:
            return request.read(answer)
        except ValueError:
            return WorkerFailure("gave an invalid answer")

    def _bury(self, worker: _Worker | None) -> None:
        if worker is not None:
            worker.end()
            with self._lock:
                self._workers.discard(worker)


class _Worker:
    """A child process, used and ended only by the thread that started it."""

    def __init__(self, script: Path) -> None:
        self.timed_out = False
        self._messages = tempfile.TemporaryFile()  # noqa: SIM115, closed by `end`
        pipe = subprocess.PIPE
        # The same import path as here; -P keeps modules beside the script out of it. With one
        # worker per processor, threads inside a worker would only compete.
        environment = {
            **os.environ,
            "PYTHONPATH": module_path(),
            "OPENBLAS_NUM_THREADS": "1",
        }
        self.process = subprocess.Popen(
            [sys.executable, "-P", str(script)],
            stdin=pipe,
            stdout=pipe,
            stderr=self._messages,
            env=environment,
        )
        assert self.process.stdin is not None and self.process.stdout is not None
        self._requests, self._answers = self.process.stdin, self.process.stdout

    def ask(self, request: WorkerRequest[Result]) -> bytes | WorkerFailure:
        """Send one request and wait for its answer."""
        timer = threading.Timer(request.timeout, self._expire)
        timer.start()
        try:
            body = request.body()
            self._requests.write(len(body).to_bytes(8, "little") + body)
            self._requests.flush()
            head = self._answers.read(8)
            n_bytes = int.from_bytes(head, "little")
            if n_bytes > request.most_bytes:
                return WorkerFailure("gave an invalid answer")
            answer = self._answers.read(n_bytes)
        except OSError:  # the worker closed its end
            head, n_bytes, answer = b"", 0, b""
        finally:
            timer.cancel()
        if len(head) == 8 and len(answer) == n_bytes:
            return answer
        if self.timed_out:
            return WorkerFailure(f"took longer than {request.timeout:g} s")
        return self._crash()

    def end(self) -> None:
        """Kill the process if it still runs, and release its resources."""
        self.process.kill()
        self.process.wait()
        with suppress(OSError):  # unsent bytes to a process that has ended
            self._requests.close()
        self._answers.close()
        self._messages.close()

    def _expire(self) -> None:
        self.timed_out = True
        self.process.kill()

    def _crash(self) -> WorkerFailure:
        # A process that closed its pipes may still be ending; one that hangs is killed.
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(1.0)
        exit_code = self.process.poll()
        self._messages.seek(0)
        said = self._messages.read().decode(errors="replace").strip().splitlines()
        reasons = [] if exit_code is None else [f"exit code {exit_code}"]
        reasons += said[-1:]
        return WorkerFailure(f"crashed ({', '.join(reasons)})" if reasons else "crashed", exit_code)
