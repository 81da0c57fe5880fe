"""What a study found, in words."""

from __future__ import annotations

from collections.abc import Sequence

from texbake.core import portable_math as pm
from texbake.pages.page import duration, number
from texbake.records import dataclass
from texbake.study.result import KnobResult, Measurement, pareto_front


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
