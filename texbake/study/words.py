"""Numbers and findings in words."""

from __future__ import annotations

import math

from texbake.pages.words import duration, number
from texbake.study.against import savings
from texbake.study.pareto import payoff
from texbake.study.result import KnobResult, Measurement


def amount(x: float, unit: str) -> str:
    """Return an error with its unit."""
    return f"{number(x)}{'' if unit in ('', '°', '%') else ' '}{unit}"


def spread(item: Measurement) -> float:
    """How far the times lie from their median at most, as a share of it."""
    middle = item.median
    away = max(max(item.seconds) - middle, middle - min(item.seconds))
    return away / middle if middle else 0.0


def findings(result: KnobResult) -> list[str]:
    """Sentences on what a knob buys, what it costs, and where it stops paying."""
    sentences = []
    for front, best in zip(result.fronts, result.knees, strict=True):
        sentences += _on_front(result, front, best)
    sentences += _against_baseline(result)
    widest = max(result.measurements, key=spread)
    sentences.append(
        f"Noise: the times of a setting lay within ±{number(100.0 * spread(widest))} % of their "
        f"median at worst (“{widest.setting.label}”)."
    )
    return sentences


def _on_front(result: KnobResult, front: list[int], best: int) -> list[str]:
    unit = result.knob.unit
    first, kept, last = (result.measurements[i] for i in (front[0], best, front[-1]))
    told = f"“{first.setting.label}” is the quickest: {amount(first.error, unit)} in "
    told += f"{duration(first.median)}"
    if len(front) == 1:
        return [f"{told}; nothing slower is more accurate."]
    sentences = []
    if kept is first:
        sentences.append(f"{told}, and nothing slower pays.")
    else:
        sentences.append(
            f"From “{first.setting.label}” to “{kept.setting.label}” the error falls from "
            f"{amount(first.error, unit)} to {amount(kept.error, unit)}{_times_less(first, kept)}, "
            f"for {_times(kept.median / first.median)} the time."
        )
    if kept is not last:
        sentences.append(
            f"Beyond “{kept.setting.label}” it stops paying: “{last.setting.label}” takes "
            f"{_times(last.median / kept.median)} the time for {amount(last.error, unit)}"
            f"{_times_less(kept, last)}."
        )
    elif not first.setting.problem:
        sentences.append("It pays to the end of the range that was tried.")
    return sentences


def _against_baseline(result: KnobResult) -> list[str]:
    return [
        f"“{saving.series}” reaches the {amount(saving.setting.error, result.knob.unit)} of "
        f"“{saving.setting.setting.label}” in {'at most ' if saving.is_most else ''}"
        f"{number(saving.share)} of its time{'' if saving.is_most else ' (interpolated)'}."
        for saving in savings(result)
    ]


def _times_less(a: Measurement, b: Measurement) -> str:
    return f", {number(a.error / b.error)} times less" if b.error > 0.0 else ""


def _times(ratio: float) -> str:
    return f"{number(ratio)} times"


def next_step(result: KnobResult, best: int) -> str:
    """What the first step beyond a setting of the front would bring, in a few words."""
    front = next(front for front in result.fronts if best in front)
    rest = front[front.index(best) + 1 :]
    if not rest:
        return "end of the range"
    here, there = (result.measurements[i] for i in (best, rest[0]))
    share = 100.0 * (1.0 - there.error / here.error) if here.error > 0.0 else 0.0
    power = payoff(here.point, there.point)
    assert power < math.inf
    return (
        f"{there.setting.label}: −{number(share)} % error for "
        f"{_times(there.median / here.median)} the time"
    )
