"""Runs steps in the order of their dependencies, as many at once as workers and memory allow.

A step is examined when all steps before it have ended. Only then are its inputs known, so that a
step whose inputs came out the same as last time need not run, whatever ran before it. Listeners
receive an event for each, with an estimate of the time left.
"""

from __future__ import annotations

import heapq
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Mapping
from dataclasses import asdict
from graphlib import TopologicalSorter
from typing import Any

from texbake.building.graph import Id
from texbake.building.resolve import (
    BLOCKED,
    BUILT,
    CURRENT,
    FAILED,
    QUEUED,
    RUNNING,
    Resolver,
    StepState,
)
from texbake.building.store import Manifest, Publisher
from texbake.building.task import Task, TaskOutcome
from texbake.building.workers import Executor
from texbake.errors import TexbakeError, counted
from texbake.records import dataclass

_MOST_PUT_OFF = 64  # steps too large for the free memory, before the search for smaller ones ends
_LOOK_SECONDS = 0.5  # between events on which nothing happens


@dataclass(frozen=True, kw_only=True)
class BuildEvent:
    """An event of a build."""

    event: str  # `began`, `step` (a step has reached `state`), `note` or `ended`
    asset: str | None = None
    step: str | None = None
    # `running`, `current` (nothing to do), `built`, `failed` or `blocked` (by one that failed)
    state: str | None = None
    message: str | None = None  # one line of a note or a failure
    seconds: float | None = None  # time that a step took
    done: int = 0  # steps that have ended, and all steps
    total: int = 0
    seconds_left: float | None = None  # estimate for the whole build; None before one is possible

    def to_json(self) -> dict[str, Any]:
        """Return the fields that are set as plain values."""
        return {name: value for name, value in asdict(self).items() if value is not None}


BuildListener = Callable[[BuildEvent], None]


class EtaEstimator:
    """Estimates the time left from the time that steps of each kind have taken so far."""

    def __init__(self, kinds: Mapping[tuple[str, str], str], slots: int) -> None:
        self._kinds, self._slots = dict(kinds), slots
        self._left = Counter(kinds.values())
        self._seconds: dict[str, float] = defaultdict(float)
        self._counts: Counter[str] = Counter()
        self._started: dict[tuple[str, str], float] = {}

    def drop(self, step: tuple[str, str]) -> None:
        """Stop counting a step: it has ended, or another step does the same."""
        if step in self._kinds:
            self._left[self._kinds.pop(step)] -= 1

    def started(self, step: tuple[str, str]) -> None:
        """Record that a step has started."""
        self._started[step] = time.perf_counter()

    def ended(self, step: tuple[str, str]) -> float:
        """Record that a step has ended; return the seconds since it started."""
        seconds = time.perf_counter() - self._started.pop(step)
        kind = self._kinds[step]
        self._seconds[kind] += seconds
        self._counts[kind] += 1
        self.drop(step)
        return seconds

    def seconds_left(self) -> float | None:
        """Seconds until all steps have ended; None before any step has run."""
        n_done = self._counts.total()
        if n_done == 0:
            return None
        mean = sum(self._seconds.values()) / n_done
        left = 0.0
        for kind, n in self._left.items():
            count = self._counts[kind]
            left += n * (self._seconds[kind] / count if count else mean)
        now = time.perf_counter()
        left -= sum(min(now - start, mean) for start in self._started.values())
        return max(left, 0.0) / self._slots


class Schedule:
    """The steps of a build; those that run together share `memory_bytes`, None for no limit."""

    def __init__(
        self,
        states: Mapping[Id, StepState],
        resolver: Resolver,
        publisher: Publisher,
        executor: Executor,
        *,
        memory_bytes: int | None,
        listener: BuildListener,
    ) -> None:
        self._states, self._resolver = states, resolver
        self._publisher, self._executor = publisher, executor
        self._memory_bytes, self._listener = memory_bytes, listener
        self._ids = list(states)
        self._numbers = {step: number for number, step in enumerate(states)}
        self._sorter = TopologicalSorter(
            {step: state.node.waits_for for step, state in states.items()}
        )
        self._sorter.prepare()
        # Heaps of numbers of steps: those to examine, and those to run.
        self._ready: list[int] = []
        self._queue: list[int] = []
        self._tasks: dict[int, Task] = {}  # of queued and running steps
        self._running: set[int] = set()
        self._same: dict[str, list[Id]] = {}  # steps by the key that is being made
        self._n_ended = 0
        kinds = {step: state.node.table.kind.name for step, state in states.items()}
        self._eta = EtaEstimator(kinds, executor.slots)

    def run(self) -> None:
        """Run until every step has ended."""
        self._add_ready()
        while self._sorter.is_active():
            if self._ready:
                self._look(self._ids[heapq.heappop(self._ready)])
            self._start()
            if self._running:
                self._collect(0.0 if self._ready else _LOOK_SECONDS)

    def _add_ready(self) -> None:
        for step in self._sorter.get_ready():
            heapq.heappush(self._ready, self._numbers[step])

    def _look(self, step: Id) -> None:
        """End a step whose result is stored or that cannot run; queue it otherwise."""
        state = self._states[step]
        for name in state.node.waits_for:
            before = self._states[name]
            if before.state == FAILED:
                self._end(step, BLOCKED, f"it needs {name[1]}, which failed")
                return
            if before.state == BLOCKED:
                self._end(step, BLOCKED, before.error)
                return
        try:
            if self._resolver.look(state):
                assert state.manifest is not None
                self._finish(step, state.manifest, CURRENT)
                return
            state.state = QUEUED
            if state.key in self._same:  # another asset has the same step and is making it
                self._same[state.key].append(step)
                self._eta.drop(step)
                return
            task = self._resolver.task(state, self._executor.threads, self._memory_bytes)
        except TexbakeError as error:
            self._end(step, FAILED, str(error))
            return
        self._same[state.key] = [step]
        number = self._numbers[step]
        self._tasks[number] = task
        heapq.heappush(self._queue, number)

    def _start(self) -> None:
        """Start steps while there are a free worker and enough memory."""
        put_off: list[int] = []
        while (
            self._queue
            and len(self._running) < self._executor.slots
            and len(put_off) < _MOST_PUT_OFF
        ):
            number = heapq.heappop(self._queue)
            task = self._tasks[number]
            if not self._fits(task):
                put_off.append(number)
                continue
            self._running.add(number)
            state = self._states[self._ids[number]]
            state.state = RUNNING
            self._eta.started(state.node.id)
            self._executor.submit(number, task)
            self._tell(state)
        for number in put_off:
            heapq.heappush(self._queue, number)

    def _fits(self, task: Task) -> bool:
        """Whether a task fits into memory beside those that run; one that never fits runs alone."""
        if self._memory_bytes is None or not self._running:
            return True
        used = sum(self._tasks[number].memory_bytes for number in self._running)
        return used + task.memory_bytes <= self._memory_bytes

    def _collect(self, timeout: float) -> None:
        for number, outcome in self._executor.finished(timeout):
            self._running.remove(number)
            task = self._tasks.pop(number)
            state = self._states[self._ids[number]]
            state.seconds = self._eta.ended(state.node.id)
            state.attempts = outcome.attempts
            if outcome.attempts > 1:
                state.notes.append("its worker ended; another one ran it")
            for step in self._same.pop(task.key):
                self._close(step, outcome)

    def _close(self, step: Id, outcome: TaskOutcome) -> None:
        """End a step whose task, or the same task of another asset, has ended."""
        if outcome.manifest is not None:
            self._resolver.store.remember(outcome.manifest, self._resolver.digests)
            self._finish(step, outcome.manifest, BUILT)
        else:
            self._states[step].trace = outcome.trace
            self._end(step, FAILED, outcome.error)

    def _finish(self, step: Id, manifest: Manifest, how: str) -> None:
        """Publish the outputs of a step, and end it."""
        state = self._states[step]
        state.manifest = manifest
        try:
            n_put = self._publisher.publish(state.node, manifest)
        except TexbakeError as error:
            self._end(step, FAILED, str(error))
            return
        # Another asset may have made the result: then its outputs were not there before.
        if n_put and how == CURRENT and self._resolver.is_as_before(state):
            state.notes.append(f"restored {counted(n_put, 'missing or changed output')}")
        self._end(step, how)

    def _end(self, step: Id, how: str, error: str = "") -> None:
        state = self._states[step]
        state.state, state.error = how, error
        self._n_ended += 1
        self._eta.drop(step)
        self._tell(state)
        self._sorter.done(step)
        self._add_ready()

    def _tell(self, state: StepState) -> None:
        asset, step = state.node.id
        self._listener(
            BuildEvent(
                event="step",
                asset=asset,
                step=step,
                state=state.state,
                message=state.error or None,
                seconds=round(state.seconds, 3) if state.seconds else None,
                done=self._n_ended,
                total=len(self._states),
                seconds_left=self._eta.seconds_left(),
            )
        )
