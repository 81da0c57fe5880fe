"""Events of a running build, and an estimate of the time left."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

# States in which a step has ended ...
CURRENT, BUILT, FAILED, BLOCKED = "current", "built", "failed", "blocked"
# ... and those before.
WAITING, QUEUED, RUNNING = "waiting", "queued", "running"
ENDED = frozenset({CURRENT, BUILT, FAILED, BLOCKED})


@dataclass(frozen=True, kw_only=True)
class BuildEvent:
    """An event of a build.

    Attributes
    ----------
    event : str
        `began`, `step` (a step has reached `state`), `note` or `ended`.
    state : str or None
        `running`, `current` (nothing to do), `built`, `failed` or `blocked` (by one that failed).
    message : str or None
        One line of a note or a failure.
    seconds : float or None
        Time that a step took.
    done, total : int
        Steps that have ended, and all steps.
    seconds_left : float or None
        Estimate for the whole build; None before one is possible.
    """

    event: str
    asset: str | None = None
    step: str | None = None
    state: str | None = None
    message: str | None = None
    seconds: float | None = None
    done: int = 0
    total: int = 0
    seconds_left: float | None = None

    def to_json(self) -> dict[str, Any]:
        """Return the known fields as plain values."""
        return {name: value for name, value in asdict(self).items() if value is not None}


BuildListener = Callable[[BuildEvent], None]


def noted(listener: BuildListener) -> Callable[[str], None]:
    """Return a function that gives a listener a note."""
    return lambda message: listener(BuildEvent(event="note", message=message))


class Outlook:
    """Estimates the time left from the time that steps of each kind have taken so far."""

    def __init__(self, slots: int) -> None:
        self._slots = slots
        self._seconds: dict[str, float] = defaultdict(float)
        self._counts: dict[str, int] = defaultdict(int)
        self._expected: dict[tuple[str, str], str] = {}
        self._left: dict[str, int] = defaultdict(int)
        self._started: dict[tuple[str, str], tuple[str, float]] = {}

    def expect(self, step: tuple[str, str], kind: str) -> None:
        """Count a step as one that may have to run; a second call changes nothing."""
        if step not in self._expected:
            self._expected[step] = kind
            self._left[kind] += 1

    def drop(self, step: tuple[str, str]) -> None:
        """Stop counting a step: it has ended, or another step does the same."""
        kind = self._expected.pop(step, None)
        if kind is not None:
            self._left[kind] -= 1

    def started(self, step: tuple[str, str], kind: str) -> None:
        """Record that a step has started."""
        self._started[step] = kind, time.perf_counter()

    def ended(self, step: tuple[str, str]) -> float:
        """Record that a step has ended; return the seconds since it started."""
        kind, start = self._started.pop(step)
        seconds = time.perf_counter() - start
        self._seconds[kind] += seconds
        self._counts[kind] += 1
        self.drop(step)
        return seconds

    def seconds_left(self) -> float | None:
        """Return the seconds until all expected steps are done; None before any step has run.

        A kind that has not run yet counts as the mean of those that have.
        """
        n_done = sum(self._counts.values())
        if n_done == 0:
            return None
        usual = sum(self._seconds.values()) / n_done
        left = 0.0
        for kind, n in self._left.items():
            count = self._counts[kind]
            left += n * (self._seconds[kind] / count if count else usual)
        now = time.perf_counter()
        left -= sum(min(now - start, usual) for _, start in self._started.values())
        return max(left, 0.0) / self._slots
