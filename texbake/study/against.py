"""What one way of doing a thing saves against another at equal error, from measured settings.

Between two settings of a way the error is taken to fall as a power of the time, which is a straight
line where both scales are logarithmic.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from texbake.study.pareto import pareto_front
from texbake.study.result import KnobResult, Measurement


@dataclass(frozen=True)
class Saving:
    """A way that reaches the error of a setting of another.

    Attributes
    ----------
    series : str
        The way.
    setting : Measurement
        What it is held against.
    share : float
        Of its time.
    is_most : bool
        It takes at most that share: the way's quickest setting is already as accurate.
    """

    series: str
    setting: Measurement
    share: float
    is_most: bool


def savings(result: KnobResult) -> list[Saving]:
    """Each other series of a knob against every setting of its baseline whose error it reaches."""
    baseline = result.knob.baseline
    series = dict.fromkeys(item.setting.series for item in result.measurements)
    found = []
    for name in series if baseline else ():
        if name == baseline:
            continue
        points = [item.point for item in result.measurements if item.setting.series == name]
        for item in result.measurements:
            seconds = seconds_for(points, item.error) if item.setting.series == baseline else None
            if seconds is not None:
                is_most = seconds == min(points)[0]
                found.append(Saving(name, item, seconds / item.median, is_most))
    return found


def seconds_for(points: Sequence[tuple[float, float]], error: float) -> float | None:
    """Seconds at which points (seconds, error) reach an error; None where none of them does.

    Examples
    --------
    >>> seconds_for([(1.0, 8.0), (4.0, 2.0)], 4.0)
    2.0
    """
    front = [points[i] for i in pareto_front(points)]
    for k, (seconds, reached) in enumerate(front):
        if reached > error:
            continue
        if k == 0 or reached <= 0.0:
            return seconds
        before, was = front[k - 1]
        part = math.log(was / error) / math.log(was / reached)
        return float(before * (seconds / before) ** part)
    return None
