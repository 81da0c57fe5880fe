"""Values that effects compute for a picture, by the functions that compute them, and costs."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Generic, TypeVar

if TYPE_CHECKING:
    from texbake.rendering.effect import RenderState

# Index of an object or a light; None for the whole picture.
Target = int | None
Value = TypeVar("Value")


@dataclass(frozen=True, eq=False)
class Result(Generic[Value]):
    """A value that an effect computes before shading, and the key to look it up by."""

    # Function of (state, target) that returns the value
    compute: Callable[[RenderState, Any], Value]
    deferred: bool = False  # whether it is computed only when a fragment first asks for it


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


@dataclass(frozen=True, eq=False)
class Results:
    """Immutable mapping from `Result` and target to the values that effects have computed."""

    _values: Mapping[Result[Any], Mapping[Target, Any]] = field(default_factory=dict)

    def has(self, result: Result[Any], target: Target) -> bool:
        """Whether a value has been computed, even if it is None."""
        return target in self._values.get(result, ())

    def get(self, result: Result[Value], target: Target = None) -> Value | None:
        """Return a value, or None if there is none; computes a deferred one."""
        value: Value | Deferred[Value] | None = self._values.get(result, {}).get(target)
        return value.get() if isinstance(value, Deferred) else value

    def all(self, result: Result[Value]) -> Mapping[Target, Value]:
        """Return the values of a result for all targets."""
        return self._values.get(result, {})

    def including(
        self, result: Result[Value], target: Target, value: Value | Deferred[Value]
    ) -> Results:
        """Return a copy with one more value."""
        values = {**self._values.get(result, {}), target: value}
        return Results({**self._values, result: values})

    def growing(self, result: Result[Any]) -> tuple[Results, dict[Target, Any]]:
        """Return a copy, and the values of a result in it, to be added to without copying them."""
        values = dict(self._values.get(result, {}))
        return Results({**self._values, result: values}), values

    def without(self, left_out: Iterable[Result[Any]]) -> Results:
        """Return a copy without some results, for all targets."""
        dropped = set(left_out)
        return Results({key: values for key, values in self._values.items() if key not in dropped})

    def only(self, kept: Iterable[Result[Any]]) -> Results:
        """Return a copy with some of the results alone, for all targets."""
        return Results({key: self._values[key] for key in kept if key in self._values})

    def or_those_of(self, others: Results) -> Results:
        """Return a copy completed with the values of `others` that are missing here."""
        values = dict(self._values)
        for key, targets in others._values.items():
            values[key] = {**targets, **values.get(key, {})}
        return Results(values)


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
            taken = time.perf_counter() - start
            self.add(name, taken - self._running.seconds)
            self._running.seconds = inner + taken
