"""What a build tells while it works, and how long it will take."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

# States of a step in the end; the others are on their way.
CURRENT, BUILT, FAILED, BLOCKED = "current", "built", "failed", "blocked"
WAITING, QUEUED, RUNNING = "waiting", "queued", "running"
ENDED = frozenset({CURRENT, BUILT, FAILED, BLOCKED})


@dataclass(frozen=True, kw_only=True)
class BuildEvent:
    """Something that happened.

    Attributes
    ----------
    event : str
        `began`, `step` (a step has reached `state`), `note` or `ended`.
    asset, step : str or None
    state : str or None
        `running`, `current` (nothing to do), `built`, `failed` or `blocked` (by one that failed).
    message : str or None
        Of a note or a failure, one line.
    seconds : float or None
        That a step took.
    done, total : int
        Steps that have ended, and all steps.
    seconds_left : float or None
        An estimate for the whole; None until something can be said.
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
        """Return what is known, as plain values."""
        return {name: value for name, value in asdict(self).items() if value is not None}


BuildListener = Callable[[BuildEvent], None]


class Outlook:
    """Estimates what is left from what steps of each kind have taken so far."""

    def __init__(self, slots: int) -> None:
        self._slots = slots
        self._seconds: dict[str, float] = defaultdict(float)
        self._counts: dict[str, int] = defaultdict(int)
        self._expected: dict[tuple[str, str], str] = {}
        self._left: dict[str, int] = defaultdict(int)
        self._started: dict[tuple[str, str], tuple[str, float]] = {}

    def expect(self, step: tuple[str, str], kind: str) -> None:
        """Count a step as one that may have to run, once however often it is said."""
        if step not in self._expected:
            self._expected[step] = kind
            self._left[kind] += 1

    def drop(self, step: tuple[str, str]) -> None:
        """Count a step no longer: it has ended, or another does the same."""
        kind = self._expected.pop(step, None)
        if kind is not None:
            self._left[kind] -= 1

    def started(self, step: tuple[str, str], kind: str) -> None:
        """Note that a step runs."""
        self._started[step] = kind, time.perf_counter()

    def ended(self, step: tuple[str, str]) -> float:
        """Note that it does no more; return the seconds since it began."""
        kind, start = self._started.pop(step)
        seconds = time.perf_counter() - start
        self._seconds[kind] += seconds
        self._counts[kind] += 1
        self.drop(step)
        return seconds

    def seconds_left(self) -> float | None:
        """Seconds until all that is expected is done; None before any step has run.

        Kinds that have not run yet count as the mean of those that have.
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
