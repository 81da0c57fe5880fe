"""What the passes of a picture cost: time and memory, by the name of their effect."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field


@dataclass
class PassCost:
    """What a pass took: seconds of all threads together and bytes that it keeps.

    `skipped` says why it was not run after all.
    """

    seconds: float = 0.0
    n_bytes: int = 0
    skipped: str = ""


@dataclass(eq=False)
class Costs:
    """What the passes took, by the name of their effect."""

    by_name: dict[str, PassCost] = field(default_factory=dict)
    _lock: threading.Lock = field(default_factory=threading.Lock)
    _running: threading.local = field(default_factory=threading.local)

    def add(self, name: str, seconds: float, n_bytes: int = 0) -> None:
        """Count some time and memory of a pass."""
        with self._lock:
            cost = self.by_name.setdefault(name, PassCost())
            cost.seconds += seconds
            cost.n_bytes += n_bytes

    def skip(self, name: str, why: str) -> None:
        """Note that a pass was not needed after all."""
        with self._lock:
            self.by_name.setdefault(name, PassCost()).skipped = why

    @contextmanager
    def timed(self, name: str) -> Iterator[None]:
        """Count the time of a block, without that of the timed blocks within it."""
        inner = getattr(self._running, "seconds", 0.0)
        self._running.seconds = 0.0
        start = time.perf_counter()
        try:
            yield
        finally:
            taken = time.perf_counter() - start
            self.add(name, taken - self._running.seconds)
            self._running.seconds = inner + taken
