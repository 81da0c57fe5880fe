"""What a study measured, and its file: JSON with everything."""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterable, Sequence
from dataclasses import field
from typing import Any

from texbake.core import portable_math as pm
from texbake.records import dataclass
from texbake.study.knob import Evaluation, Knob, Setting
from texbake.study.options import StudyOptions

# A step pays off if four times the time at least halves the error.
PAYS = 0.5


def pareto_front(points: Sequence[tuple[float, float]]) -> list[int]:
    """Indices of the points (seconds, error) that no other beats, fastest first; finite ones."""
    order = sorted(range(len(points)), key=lambda i: (*points[i], i))
    front: list[int] = []
    for i in order:
        seconds, error = points[i]
        if not (math.isfinite(seconds) and math.isfinite(error)):
            continue
        if not front or error < points[front[-1]][1]:
            front.append(i)
    return front


def convergence_order(a: tuple[float, float], b: tuple[float, float]) -> float:
    """Return the exponent p of the step from a point of a front to a later one; inf if free."""
    if b[1] <= 0.0 or b[0] <= a[0]:
        return math.inf
    return pm.log(a[1] / b[1]) / pm.log(b[0] / a[0])


def knee(points: Sequence[tuple[float, float]], front: Sequence[int]) -> int | None:
    """Index of the point of a front beyond which no step pays off by `PAYS`; None if empty."""
    if not front:
        return None
    here = front[0]
    for there in front[1:]:
        if convergence_order(points[here], points[there]) >= PAYS:
            here = there
    return here


SCHEMA = "texbake-study-1"


@dataclass(frozen=True, eq=False)
class Measurement:
    """One setting: how wrong and how slow."""

    setting: Setting
    outcome: Evaluation
    seconds: tuple[float, ...]  # time of each timed run
    peak_bytes: int | None  # how far resident memory rose above what it was before

    @property
    def error(self) -> float:
        """In the unit of the knob."""
        return self.outcome.error

    @property
    def median(self) -> float:
        """Median of the seconds."""
        return statistics.median(self.seconds)

    @property
    def point(self) -> tuple[float, float]:
        """(seconds, error)."""
        return self.median, self.error

    def to_json(self) -> dict[str, Any]:
        """Return all figures by name; those that are not finite become None."""
        return {
            "setting": self.setting.label,
            "series": self.setting.series,
            "problem": self.setting.problem,
            "error": _finite(self.error),
            "figures": {name: _finite(x) for name, x in self.outcome.figures.items()},
            "seconds": list(self.seconds),
            "seconds_median": self.median,
            "seconds_min": min(self.seconds),
            "seconds_max": max(self.seconds),
            "peak_bytes": self.peak_bytes,
        }


class ParetoRanking:
    """Measurements of settings that compete, and which of them are worth their time."""

    measurements: tuple[Measurement, ...]

    @property
    def problems(self) -> list[list[int]]:
        """Indices of settings, for each problem that they compete in."""
        problems: dict[str, list[int]] = {}
        for i, item in enumerate(self.measurements):
            problems.setdefault(item.setting.problem, []).append(i)
        return list(problems.values())

    @property
    def fronts(self) -> list[list[int]]:
        """For each problem, the settings that no other beats, faster ones first."""
        return [self._in(items, pareto_front(self._points(items))) for items in self.problems]

    @property
    def front(self) -> list[int]:
        """The settings of all fronts."""
        return [i for front in self.fronts for i in front]

    @property
    def knees(self) -> list[int]:
        """For each problem, the setting beyond which more time does not pay off."""
        knees = []
        for items in self.problems:
            points = self._points(items)
            best = knee(points, pareto_front(points))
            knees += self._in(items, [] if best is None else [best])
        return knees

    def _points(self, items: list[int]) -> list[tuple[float, float]]:
        return [self.measurements[i].point for i in items]

    @staticmethod
    def _in(items: list[int], chosen: list[int]) -> list[int]:
        return [items[i] for i in chosen]


@dataclass(frozen=True, eq=False)
class KnobResult(ParetoRanking):
    """All settings of a knob."""

    knob: Knob
    # subject, truth, truth_text: as in its `Experiment`.
    subject: str
    truth: str
    truth_text: str
    measurements: tuple[Measurement, ...]

    def to_json(self) -> dict[str, Any]:
        """Return everything but the pictures."""
        labels = [item.setting.label for item in self.measurements]
        return {
            "knob": self.knob.name,
            "title": self.knob.title,
            "error": self.knob.error,
            "unit": self.knob.unit,
            "kind": self.knob.kind,
            "subject": self.subject,
            "truth": self.truth,
            "truth_text": self.truth_text,
            "front": [labels[i] for i in self.front],
            "stops_paying": [labels[i] for i in self.knees],
            "settings": [item.to_json() for item in self.measurements],
        }


@dataclass(frozen=True, eq=False)
class StudyResult:
    """Everything that a study measured."""

    options: StudyOptions
    inputs: dict[str, str]  # names of the meshes and the scene that were given
    machine: dict[str, Any]  # what it ran on
    knobs: tuple[KnobResult, ...]
    seconds: float = 0.0  # time of the whole study
    # names of the knobs that could not be studied on what was given, and why
    skipped: dict[str, str] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """Return everything but the pictures."""
        return {
            "schema": SCHEMA,
            "inputs": self.inputs,
            "machine": self.machine,
            "repeats": self.options.repeats,
            "quick": self.options.quick,
            "seconds": self.seconds,
            "skipped": self.skipped,
            "knobs": [item.to_json() for item in self.knobs],
        }


def figure_names(measurements: Iterable[Measurement]) -> list[str]:
    """Return the names of all further figures, in the order of their first appearance."""
    return list(dict.fromkeys(name for item in measurements for name in item.outcome.figures))


def _finite(x: float) -> float | None:
    return float(x) if math.isfinite(x) else None
