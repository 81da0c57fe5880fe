"""Values that effects compute for a picture, by the functions that compute them, and costs."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import field
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from texbake.records import dataclass

if TYPE_CHECKING:
    from texbake.rendering.effect import RenderState

# Index of an object or a light; None for the whole picture.
Target = int | None
Value = TypeVar("Value")


# Function of (state, target) that computes a value before shading, and the key to look it up by.
Compute = Callable[["RenderState", Any], Value]


class Deferred(Generic[Value]):
    """A value that is computed when it is first asked for, by one thread for all."""

    def __init__(self, compute: Callable[[], Value]) -> None:
        self._compute = compute
        self._lock = threading.Lock()
        self._values: list[Value] = []

    @property
    def is_known(self) -> bool:
        """Whether it has been computed."""
        return bool(self._values)

    def get(self) -> Value:
        """Return the value."""
        with self._lock:
            if not self._values:
                self._values.append(self._compute())
        return self._values[0]


class Results:
    """Values that effects have computed, by function and target; any thread may add one."""

    def __init__(self) -> None:
        self._values: dict[Compute[Any], dict[Target, Any]] = {}

    def all(self, result: Compute[Value]) -> Mapping[Target, Value]:
        """Return the values of a result for all targets."""
        return self._values.get(result, {})

    def get(self, result: Compute[Value], target: Target = None) -> Value | None:
        """Return a value, or None if there is none; computes a deferred one."""
        value: Value | Deferred[Value] | None = self.all(result).get(target)
        return value.get() if isinstance(value, Deferred) else value

    def put(self, result: Compute[Any], target: Target, value: Any) -> None:
        """Add a value, or replace it."""
        self._values.setdefault(result, {})[target] = value

    def copy(
        self, *, only: Collection[Any] | None = None, without: Collection[Any] = ()
    ) -> Results:
        """Return a copy, of some results alone."""
        copied = Results()
        for key, values in list(self._values.items()):  # a thread may add one meanwhile
            if key not in without and (only is None or key in only):
                copied._values[key] = dict(values)
        return copied

    def add_missing(self, others: Results) -> None:
        """Add the values of others that are missing here."""
        for key, values in list(others._values.items()):
            self._values[key] = values | self._values.get(key, {})


@dataclass
class PassCost:
    """Cost of a pass over all threads, or why it was `skipped` unless it `has_run` for a target."""

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
            elapsed = time.perf_counter() - start
            self.add(name, elapsed - self._running.seconds)
            self._running.seconds = inner + elapsed
