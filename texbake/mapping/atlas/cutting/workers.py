"""Requests that several child processes answer side by side."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from texbake.child import Child, ChildError
from texbake.parallel import resolve_threads

Result = TypeVar("Result")

# After this many timeouts, no further request is sent: a library that hangs often takes forever.
_MOST_TIMEOUTS = 3

_POLL_SECONDS = 0.1  # between checks for results; some systems do not interrupt a longer wait


@dataclass(frozen=True, kw_only=True)
class WorkerRequest(Generic[Result]):
    """A request to a child process."""

    body: Callable[[], Any]  # makes the value to send, just before it is sent
    # Turns the answer into the result, or raises an error if it is invalid; may take long.
    read: Callable[[Any], Result]
    timeout: float  # seconds after which the process is killed


def run_in_workers(
    module: str,
    requests: Sequence[WorkerRequest[Result]],
    *,
    threads: int | None = None,
    done: Callable[[int], None] | None = None,
) -> list[Result | ChildError]:
    """Send requests to children that run a module, and collect their results or failures."""
    pool = _WorkerPool(module, requests)
    n_workers = min(resolve_threads(threads), len(requests))
    executor = ThreadPoolExecutor(max(n_workers, 1), thread_name_prefix="texbake-worker")
    try:
        pending = {executor.submit(pool.work) for _ in range(n_workers)}
        n_counted = 0
        while pending:
            ended, pending = wait(pending, timeout=_POLL_SECONDS)
            for future in ended:
                future.result()
            for number in list(pool.results)[n_counted:]:
                if done is not None:
                    done(number)
                n_counted += 1
    finally:
        pool.close()
        executor.shutdown(wait=True)
    return [pool.results[number] for number in range(len(requests))]


class _WorkerPool(Generic[Result]):
    """The children for one list of requests, and the results."""

    def __init__(self, module: str, requests: Sequence[WorkerRequest[Result]]) -> None:
        self.results: dict[int, Result | ChildError] = {}
        self._module, self._requests = module, requests
        self._waiting = deque(range(len(requests)))
        self._children: list[Child] = []
        self._lock = threading.Lock()
        self._n_timeouts = 0

    def work(self) -> None:
        """Send one request after another to a child."""
        child = Child(self._module)
        with self._lock:
            self._children.append(child)
        try:
            while (number := self._next_number()) is not None:
                self.results[number] = self._result(child, self._requests[number])
        finally:
            child.end()

    def close(self) -> None:
        """Kill the children and let no others start."""
        with self._lock:
            self._waiting.clear()
            for child in self._children:
                child.close()

    def _next_number(self) -> int | None:
        with self._lock:
            return self._waiting.popleft() if self._waiting else None

    def _result(self, child: Child, request: WorkerRequest[Result]) -> Result | ChildError:
        if self._n_timeouts >= _MOST_TIMEOUTS:
            return ChildError("took too long on others")
        try:
            return request.read(child.ask(request.body(), timeout=request.timeout))
        except ChildError as error:
            self._n_timeouts += error.timed_out
            return error
        except (ValueError, TypeError, AttributeError):
            child.end()
            return ChildError("gave an invalid answer")
