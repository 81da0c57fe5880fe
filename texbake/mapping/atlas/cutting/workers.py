"""Child processes that answer requests, one after another, and are replaced where they fail.

Compiled libraries may crash or never return on hostile meshes. In a process of its own such a
library takes nothing else with it, several of them run side by side, and each is used for many
requests, because starting one costs more than most answers.

A worker is a script that reads requests from stdin until that ends, and writes an answer to each to
stdout. Both are framed: eight bytes of length, little-endian, then as many bytes.
"""

from __future__ import annotations

import os
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

from texbake.parallel import resolve_threads

Result = TypeVar("Result")

# Once so many requests took too long, no other is sent: what hangs often would take forever.
_MOST_TIMEOUTS = 3

_POLL_SECONDS = 0.1  # between looks at what is done; some systems interrupt no longer wait


@dataclass(frozen=True, kw_only=True)
class Request(Generic[Result]):
    """What a worker is asked.

    Attributes
    ----------
    body : callable
        Makes the bytes to send, when it is their turn.
    read : callable
        Makes the result of the bytes of an answer, or raises `ValueError` where they are none; may
        take long.
    timeout : float
        Seconds after which the worker is given up.
    most_bytes : int
        Longest answer that can be one.
    """

    body: Callable[[], bytes]
    read: Callable[[bytes], Result]
    timeout: float
    most_bytes: int


@dataclass(frozen=True)
class Failure:
    """Why a request has no result.

    Attributes
    ----------
    reason : str
        What the library did, such as "crashed (exit code -11)".
    exit_code : int, optional
        Of a worker that ended by itself.
    """

    reason: str
    exit_code: int | None = None


def ask_workers(
    script: Path,
    requests: Sequence[Request[Result]],
    *,
    threads: int | None = None,
    told: Callable[[int], None] | None = None,
) -> list[Result | Failure]:
    """Have requests answered by workers.

    Parameters
    ----------
    script : Path
        What a worker runs.
    requests : sequence of Request
        Taken in this order; those that take long should come first.
    threads : int, optional
        Most workers at a time; None for one a processor.
    told : callable, optional
        Called in this thread with the index of each request that is done.

    Returns
    -------
    list
        Of each request its result, or why it has none. No worker is left when this returns or
        raises, also by an interrupt.
    """
    crew = _Crew(script, requests)
    n_workers = min(resolve_threads(threads), len(requests))
    pool = ThreadPoolExecutor(max(n_workers, 1), thread_name_prefix="texbake-worker")
    try:
        pending = {pool.submit(crew.work) for _ in range(n_workers)}
        n_told = 0
        while pending:
            done, pending = wait(pending, timeout=_POLL_SECONDS)
            for future in done:
                future.result()
            for number in list(crew.results)[n_told:]:
                if told is not None:
                    told(number)
                n_told += 1
    finally:
        crew.dismiss()
        pool.shutdown(wait=True)
    return [crew.results[number] for number in range(len(requests))]


class _Crew(Generic[Result]):
    """The workers for one list of requests, and what came of each."""

    def __init__(self, script: Path, requests: Sequence[Request[Result]]) -> None:
        self.results: dict[int, Result | Failure] = {}
        self._script, self._requests = script, requests
        self._numbers = iter(range(len(requests)))
        self._workers: set[_Worker] = set()
        self._lock = threading.Lock()
        self._dismissed = False
        self._n_timeouts = 0

    def work(self) -> None:
        """Have one request after another answered, by one worker as long as it does not fail."""
        worker: _Worker | None = None
        try:
            while (number := self._next_number()) is not None:
                worker = worker or self._new_worker()
                result = self._result(worker, self._requests[number])
                if isinstance(result, Failure):
                    self._bury(worker)
                    worker = None
                self.results[number] = result
        finally:
            self._bury(worker)

    def dismiss(self) -> None:
        """Kill the workers, and let no other start."""
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

    def _result(self, worker: _Worker, request: Request[Result]) -> Result | Failure:
        if self._n_timeouts >= _MOST_TIMEOUTS:
            return Failure("took too long on others")
        answer = worker.ask(request)
        if isinstance(answer, Failure):
            self._n_timeouts += worker.timed_out
            return answer
        try:
            return request.read(answer)
        except ValueError:
            return Failure("gave an answer that makes no sense")

    def _bury(self, worker: _Worker | None) -> None:
        if worker is not None:
            worker.end()
            with self._lock:
                self._workers.discard(worker)


class _Worker:
    """A child process; only the thread that made it asks it and ends it."""

    def __init__(self, script: Path) -> None:
        self.timed_out = False
        self._messages = tempfile.TemporaryFile()  # noqa: SIM115, closed by `end`
        pipe = subprocess.PIPE
        # The same places to import from as here; -P keeps the modules beside the script out of
        # them. There is one worker a processor: threads of its own would be in each other's way.
        paths = os.pathsep.join(filter(None, sys.path))
        environment = {**os.environ, "PYTHONPATH": paths, "OPENBLAS_NUM_THREADS": "1"}
        self.process = subprocess.Popen(
            [sys.executable, "-P", str(script)],
            stdin=pipe,
            stdout=pipe,
            stderr=self._messages,
            env=environment,
        )
        assert self.process.stdin is not None and self.process.stdout is not None
        self._requests, self._answers = self.process.stdin, self.process.stdout

    def ask(self, request: Request[Result]) -> bytes | Failure:
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
                return Failure("gave an answer that makes no sense")
            answer = self._answers.read(n_bytes)
        except OSError:  # it closed its end
            head, n_bytes, answer = b"", 0, b""
        finally:
            timer.cancel()
        if len(head) == 8 and len(answer) == n_bytes:
            return answer
        if self.timed_out:
            return Failure(f"took longer than {request.timeout:g} s")
        return self._crash()

    def end(self) -> None:
        """Kill the process, if it still runs, and give back what it holds."""
        self.process.kill()
        self.process.wait()
        with suppress(OSError):  # what was not sent to a process that is gone
            self._requests.close()
        self._answers.close()
        self._messages.close()

    def _expire(self) -> None:
        self.timed_out = True
        self.process.kill()

    def _crash(self) -> Failure:
        # A process that closed its pipes may still have to end; one that hangs then is killed.
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(1.0)
        exit_code = self.process.poll()
        self._messages.seek(0)
        said = self._messages.read().decode(errors="replace").strip().splitlines()
        reasons = [] if exit_code is None else [f"exit code {exit_code}"]
        reasons += said[-1:]
        return Failure(f"crashed ({', '.join(reasons)})" if reasons else "crashed", exit_code)
