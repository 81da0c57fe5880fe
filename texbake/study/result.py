"""What a study measured, what it found in words, and its file: JSON with everything."""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterable, Sequence
from dataclasses import field
from typing import Any

from texbake.core import portable_math as pm
from texbake.pages.page import duration, number
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


def amount(x: float, unit: str) -> str:
    """Return an error with its unit."""
    return f"{number(x)}{'' if unit in ('', '°', '%') else ' '}{unit}"


def spread(item: Measurement) -> float:
    """Return how far the times lie from their median at most, as a share of it."""
    middle = item.median
    away = max(max(item.seconds) - middle, middle - min(item.seconds))
    return away / middle if middle else 0.0


def findings(result: KnobResult) -> list[str]:
    """Say in sentences what a knob gains, what it costs, and where it stops paying off."""
    sentences = []
    for front, best in zip(result.fronts, result.knees, strict=True):
        sentences += _on_front(result, front, best)
    sentences += [
        f"“{saving.series}” reaches the {amount(saving.setting.error, result.knob.unit)} of "
        f"“{saving.setting.setting.label}” in {'at most ' if saving.is_most else ''}"
        f"{number(saving.share)} of its time{'' if saving.is_most else ' (interpolated)'}."
        for saving in speedups(result)
    ]
    widest = max(result.measurements, key=spread)
    sentences.append(
        f"Noise: the times of a setting lay within ±{number(100.0 * spread(widest))} % of their "
        f"median at worst (“{widest.setting.label}”)."
    )
    return sentences


def _on_front(result: KnobResult, front: list[int], best: int) -> list[str]:
    unit = result.knob.unit
    first, kept, last = (result.measurements[i] for i in (front[0], best, front[-1]))
    fastest = f"“{first.setting.label}” is the fastest: {amount(first.error, unit)} in "
    fastest += f"{duration(first.median)}"
    if len(front) == 1:
        return [f"{fastest}; nothing slower is more accurate."]
    sentences = []
    if kept is first:
        sentences.append(f"{fastest}, and nothing slower pays off.")
    else:
        sentences.append(
            f"From “{first.setting.label}” to “{kept.setting.label}” the error falls from "
            f"{amount(first.error, unit)} to {amount(kept.error, unit)}{_times_less(first, kept)}, "
            f"for {_times(kept.median / first.median)} the time."
        )
    if kept is not last:
        sentences.append(
            f"Beyond “{kept.setting.label}” it stops paying off: “{last.setting.label}” takes "
            f"{_times(last.median / kept.median)} the time for {amount(last.error, unit)}"
            f"{_times_less(kept, last)}."
        )
    elif not first.setting.problem:
        sentences.append("It pays off to the end of the range that was tried.")
    return sentences


def _times_less(a: Measurement, b: Measurement) -> str:
    return f", {number(a.error / b.error)} times less" if b.error > 0.0 else ""


def _times(ratio: float) -> str:
    return f"{number(ratio)} times"


def next_step(result: KnobResult, best: int) -> str:
    """Say in a few words what the next setting on the front would gain."""
    front = next(front for front in result.fronts if best in front)
    rest = front[front.index(best) + 1 :]
    if not rest:
        return "end of the range"
    here, there = (result.measurements[i] for i in (best, rest[0]))
    share = 100.0 * (1.0 - there.error / here.error) if here.error > 0.0 else 0.0
    return (
        f"{there.setting.label}: −{number(share)} % error for "
        f"{_times(there.median / here.median)} the time"
    )


@dataclass(frozen=True)
class Speedup:
    """A series that reaches the error of a setting of the baseline, in less or more time."""

    series: str  # the series
    setting: Measurement  # the setting of the baseline
    share: float  # share of that setting's time
    is_most: bool  # whether it takes that share at most: its fastest setting is already as accurate


def speedups(result: KnobResult) -> list[Speedup]:
    """Compare each other series of a knob with every setting of its baseline that it matches."""
    baseline = result.knob.baseline
    series = dict.fromkeys(item.setting.series for item in result.measurements)
    matches = []
    for name in series if baseline else ():
        if name == baseline:
            continue
        points = [item.point for item in result.measurements if item.setting.series == name]
        for item in result.measurements:
            seconds = seconds_for(points, item.error) if item.setting.series == baseline else None
            if seconds is not None:
                is_most = seconds == min(points)[0]
                matches.append(Speedup(name, item, seconds / item.median, is_most))
    return matches


def seconds_for(points: Sequence[tuple[float, float]], error: float) -> float | None:
    """Seconds at which points (seconds, error) reach an error, along powers of time, or None."""
    front = [points[i] for i in pareto_front(points)]
    for k, (seconds, reached) in enumerate(front):
        if reached > error:
            continue
        if k == 0 or reached <= 0.0:
            return seconds
        before, was = front[k - 1]
        part = pm.log(was / error) / pm.log(was / reached)
        return float(before * pm.power(seconds / before, part))
    return None
