"""Runs steps in the order of their dependencies, as many at once as workers and memory allow.

A step is examined when all steps before it have results. Only then are its inputs known, so that a
step whose inputs came out the same as last time need not run, whatever ran before it.
"""

from __future__ import annotations

import heapq
from collections import defaultdict
from collections.abc import Callable, Mapping

from texbake.building import progress
from texbake.building.graph import Id, Node
from texbake.building.progress import BuildEvent, BuildListener, Outlook
from texbake.building.resolve import Resolver, StepState
from texbake.building.store import Manifest, Publisher, Store
from texbake.building.task import DAMAGED, DONE, Task, TaskOutcome
from texbake.building.workers import Executor
from texbake.errors import TexbakeError

# How often a step is postponed because of a damaged stored input before it fails.
_MOST_DAMAGES = 3
_MOST_PUT_OFF = 64  # steps too large for the free memory, before the search for smaller ones ends
_LOOK_SECONDS = 0.5  # between events on which nothing happens


class Schedule:
    """The steps of a build."""

    def __init__(
        self,
        states: Mapping[Id, StepState],
        resolver: Resolver,
        store: Store,
        publisher: Publisher,
        executor: Callable[[], Executor],
        *,
        memory_bytes: int | None,
        listener: BuildListener,
        slots: int,
    ) -> None:
        self._states, self._resolver, self._store = states, resolver, store
        self._publisher, self._make_executor = publisher, executor
        self._executor: Executor | None = None
        self._memory_bytes, self._listener = memory_bytes, listener
        self._order = {step: number for number, step in enumerate(states)}
        self._ids = list(states)
        self._waits: dict[Id, set[Id]] = {}
        self._followers: dict[Id, list[Id]] = defaultdict(list)
        self._ready: list[int] = []
        self._queue: list[int] = []
        self._tasks: dict[int, Task] = {}  # of queued steps
        self._running: dict[int, Task] = {}
        self._same: dict[str, list[Id]] = {}  # steps by the key that is being made
        self._damages: dict[Id, int] = defaultdict(int)
        self._n_remakes = 0
        self._remade: dict[str, int] = {}  # number of the last remake, by key
        self._begun: dict[int, int] = {}  # number of remakes when a step began
        self._n_ended = 0
        self._outlook = Outlook(slots)
        for step, state in states.items():
            self._waits[step] = set(state.node.waits_for)
            for before in state.node.waits_for:
                self._followers[before].append(step)
            if not state.node.waits_for:
                heapq.heappush(self._ready, self._order[step])
            self._outlook.expect(step, state.node.table.kind.name)

    def run(self) -> None:
        """Run until every step has ended."""
        while self._ready or self._queue or self._running:
            if self._ready:
                step = self._ids[heapq.heappop(self._ready)]
                if self._states[step].state == progress.WAITING and not self._waits[step]:
                    self._look(step)
            self._start()
            if self._running:
                busy = bool(self._ready)
                self._collect(0.0 if busy else _LOOK_SECONDS)

    def _look(self, step: Id) -> None:
        state = self._states[step]
        try:
            stored = self._resolver.look(state)
        except TexbakeError as error:
            self._fail(step, str(error))
            return
        if stored:
            assert state.manifest is not None
            self._outlook.drop(step)
            self._finish(step, state.manifest, progress.CURRENT)
            return
        if state.key in self._same:  # another asset has the same step and is making it
            self._same[state.key].append(step)
            self._outlook.drop(step)
            state.state = progress.QUEUED
            return
        self._same[state.key] = [step]
        state.state = progress.QUEUED
        heapq.heappush(self._queue, self._order[step])

    def _start(self) -> None:
        """Start steps while there are a free worker and enough memory."""
        if not self._queue:
            return
        if self._executor is None:
            self._executor = self._make_executor()
        put_off: list[int] = []
        while (
            self._queue
            and len(self._running) < self._executor.slots
            and len(put_off) < _MOST_PUT_OFF
        ):
            number = heapq.heappop(self._queue)
            state = self._states[self._ids[number]]
            if number not in self._tasks:
                self._tasks[number] = self._resolver.task(
                    state, self._executor.threads, self._memory_bytes
                )
            if not self._fits(self._tasks[number]):
                put_off.append(number)
                continue
            task = self._tasks.pop(number)
            self._running[number], self._begun[number] = task, self._n_remakes
            state.state = progress.RUNNING
            self._outlook.started(state.node.id, state.node.table.kind.name)
            self._executor.submit(number, task)
            self._tell(state)
        for number in put_off:
            heapq.heappush(self._queue, number)

    def _fits(self, task: Task) -> bool:
        """Whether a task fits into memory beside those that run; one that never fits runs alone."""
        if self._memory_bytes is None or not self._running:
            return True
        taken = sum(running.memory_bytes for running in self._running.values())
        return taken + task.memory_bytes <= self._memory_bytes

    def _collect(self, timeout: float) -> None:
        assert self._executor is not None
        for number, outcome in self._executor.finished(timeout):
            task, begun = self._running.pop(number), self._begun.pop(number)
            state = self._states[self._ids[number]]
            state.seconds += self._outlook.ended(state.node.id)
            state.attempts += outcome.attempts
            state.worker = outcome.worker
            if outcome.status == DAMAGED:
                self._remake(self._same.pop(task.key), outcome, begun)
                continue
            if outcome.attempts > 1:
                state.notes.append("its worker ended; another one ran it")
            for step in self._same.pop(task.key):
                self._close(step, outcome)

    def _close(self, step: Id, outcome: TaskOutcome) -> None:
        """End a step whose task, or the same task of another asset, has ended."""
        if outcome.status == DONE:
            assert outcome.manifest is not None
            self._store.remember(outcome.manifest, self._resolver.digests)
            self._finish(step, outcome.manifest, progress.BUILT)
        else:
            self._states[step].trace = outcome.trace
            self._fail(step, outcome.error)

    def _finish(self, step: Id, manifest: Manifest, how: str) -> None:
        state = self._states[step]
        state.manifest = manifest
        try:
            n_put = self._publisher.publish(state.node, manifest)
        except TexbakeError as error:
            self._fail(step, str(error))
            return
        # Another asset may have made the result: then its outputs were not there before.
        if n_put and how == progress.CURRENT and self._resolver.is_as_before(state):
            state.notes.append(f"{n_put} of its outputs were missing or changed and were restored")
        state.state = how
        self._n_ended += 1
        self._tell(state)
        for follower in self._followers[step]:
            self._waits[follower].discard(step)
            waiting = self._states[follower].state == progress.WAITING
            if waiting and not self._waits[follower]:
                heapq.heappush(self._ready, self._order[follower])

    def _fail(self, step: Id, error: str) -> None:
        state = self._states[step]
        state.state, state.error = progress.FAILED, error
        self._n_ended += 1
        self._outlook.drop(step)
        self._tell(state)
        self._block(step)

    def _block(self, step: Id) -> None:
        """End all steps that depend on one that failed."""
        blocked = list(self._followers[step])
        while blocked:
            follower = self._states[blocked.pop()]
            if follower.state == progress.WAITING:
                follower.state = progress.BLOCKED
                follower.error = f"it needs {step[1]}, which failed"
                self._n_ended += 1
                self._outlook.drop(follower.node.id)
                self._tell(follower)
                blocked += self._followers[follower.node.id]

    def _remake(self, steps: list[Id], outcome: TaskOutcome, begun: int) -> None:
        """Have a damaged result made again, and postpone the steps that read it.

        Steps that began before its last remake say nothing about what is stored now.
        """
        for step in steps:
            self._states[step].state = progress.WAITING
        if self._remade.get(outcome.damaged, 0) <= begun:
            self._store.remove(outcome.damaged)
            self._n_remakes += 1
            self._remade[outcome.damaged] = self._n_remakes
            for step in steps:
                self._damages[step] += 1
            for maker, state in self._states.items():
                made = state.state in (progress.CURRENT, progress.BUILT)
                if made and state.key == outcome.damaged:
                    self._make_again(maker, outcome.error)
        for step in steps:
            if self._damages[step] > _MOST_DAMAGES:
                self._fail(step, f"its stored input is damaged: {outcome.error}")
            elif self._states[step].state == progress.WAITING:  # not blocked by an earlier step
                self._put_off(step)

    def _make_again(self, maker: Id, error: str) -> None:
        state = self._states[maker]
        state.notes.append(f"its stored result was damaged and was made again: {error}")
        state.state, state.manifest = progress.WAITING, None
        self._n_ended -= 1
        self._outlook.expect(maker, state.node.table.kind.name)
        heapq.heappush(self._ready, self._order[maker])
        for follower in self._followers[maker]:
            follows = self._states[follower]
            if follows.state == progress.WAITING:
                self._waits[follower].add(maker)
            elif follows.state == progress.QUEUED:
                self._take_back(follows.key)

    def _take_back(self, key: str) -> None:
        """Postpone the queued steps of a key, unless a worker is already making it."""
        first = self._order[self._same[key][0]]
        if first in self._running:
            return
        self._queue.remove(first)
        heapq.heapify(self._queue)
        self._tasks.pop(first, None)
        for step in self._same.pop(key):
            self._put_off(step)

    def _put_off(self, step: Id) -> None:
        """Have a step wait until all steps before it have results again."""
        state = self._states[step]
        state.state = progress.WAITING
        self._outlook.expect(step, state.node.table.kind.name)
        makers = [self._states[source] for source in state.node.waits_for]
        self._waits[step] = {maker.node.id for maker in makers if maker.manifest is None}
        lost = [m.node.id for m in makers if m.state in (progress.FAILED, progress.BLOCKED)]
        if lost:
            self._block(lost[0])
        elif not self._waits[step]:
            heapq.heappush(self._ready, self._order[step])

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
                seconds_left=self._outlook.seconds_left(),
            )
        )


def states_of(nodes: Mapping[Id, Node]) -> dict[Id, StepState]:
    """Return a new state for each step."""
    return {step: StepState(node) for step, node in nodes.items()}
