"""Time and memory of the passes of a picture, by effect."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field


@dataclass
class PassCost:
    """Cost of a pass: seconds summed over all threads, and bytes of its results.

    `skipped` says why the pass turned out not to be needed, unless it `has_run` for some target.
    """

    seconds: float = 0.0
    n_bytes: int = 0
    skipped: str = ""
    has_run: bool = False


@dataclass(eq=False)
class Costs:
    """Costs of passes, by the name of their effect."""

    by_name: dict[str, PassCost] = field(default_factory=dict)
    _lock: threading.Lock = field(default_factory=threading.Lock)
    _running: threading.local = field(default_factory=threading.local)

    def add(self, name: str, seconds: float, n_bytes: int = 0) -> None:
        """Add time and memory to a pass."""
        with self._lock:
            cost = self.by_name.setdefault(name, PassCost())
            cost.seconds += seconds
            cost.n_bytes += n_bytes
            cost.has_run = True

    def skip(self, name: str, why: str) -> None:
        """Record why a pass turned out not to be needed."""
        with self._lock:
            self.by_name.setdefault(name, PassCost()).skipped = why

    @contextmanager
    def timed(self, name: str) -> Iterator[None]:
        """Measure a block, without the time of timed blocks nested in it."""
        inner = getattr(self._running, "seconds", 0.0)
        self._running.seconds = 0.0
        start = time.perf_counter()
        try:
            yield
        finally:
            taken = time.perf_counter() - start
            self.add(name, taken - self._running.seconds)
            self._running.seconds = inner + taken
