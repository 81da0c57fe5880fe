"""Events of a running build, and an estimate of the time left."""

from __future__ import annotations

import time
from collections import Counter, defaultdict
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

# States in which a step has ended ...
CURRENT, BUILT, FAILED, BLOCKED = "current", "built", "failed", "blocked"
# ... and those before.
WAITING, QUEUED, RUNNING = "waiting", "queued", "running"
ENDED = frozenset({CURRENT, BUILT, FAILED, BLOCKED})


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
    """Estimates the time left from the time that steps of each kind have taken so far.

    `kinds` has the kind of each step that may have to run.
    """

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
        """Return the seconds until all steps have ended; None before any step has run.

        A kind that has not run yet counts as the mean of those that have.
        """
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
