"""Octaves of noise, and coordinates of 32 against 64 bits."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.study.case import Case
from texbake.study.knob import Bench, Knob, Outcome, Setting
from texbake.study.truth.pictures import crop
from texbake.texture.procedures.noise import fractal_sum

_TRUTH_OCTAVES = 16
_OCTAVES = (1, 2, 3, 4, 6, 8, 10, 12)
_QUICK_OCTAVES = (1, 3, 6)
# Cells from the origin: a scene that was not modeled about it.
_AWAY = 10_000.0
_CELLS = 6.0  # a side of the picture
_TYPES = {"float64": np.float64, "float32": np.float32}


def _prepare(case: Case) -> Bench:
    side = case.choose(512, 64)
    steps = (np.arange(side) + 0.5) * (_CELLS / side) + _AWAY
    x, y = np.meshgrid(steps, steps)
    points = np.stack([x.ravel(), y.ravel(), np.full(side * side, 0.37)], axis=1)
    stored = {name: np.ascontiguousarray(points, kind) for name, kind in _TYPES.items()}

    def values(name: str, octaves: int) -> npt.NDArray[np.float64]:
        return fractal_sum(stored[name], octaves=octaves, threads=case.threads)

    truth = values("float64", _TRUTH_OCTAVES)

    def judge(value: tuple[str, int], sums: npt.NDArray[np.float64]) -> Outcome:
        off = sums - truth
        picture = np.repeat((0.5 + 0.6 * sums).reshape(side, side, 1), 3, axis=2)
        return Outcome(
            error=float(np.sqrt(np.square(off).mean())),
            picture=crop(np.clip(picture, 0.0, 1.0).astype(np.float32)),
            figures={
                "maximum": float(np.abs(off).max()),
                "coordinates (MB)": stored[value[0]].nbytes / 1e6,
            },
        )

    def work(value: tuple[str, int]) -> Any:
        return values(*value)

    return Bench(
        subject=f"fractal noise at {side * side:,} points, {_AWAY:,.0f} cells from the origin",
        truth="converged",
        truth_text=f"The sum of {_TRUTH_OCTAVES} octaves in float64; what it leaves out is 2^-"
        f"{_TRUTH_OCTAVES} of the first.",
        settings=tuple(
            Setting(f"{octaves}, {name}", (name, octaves), name)
            for octaves in case.choose(_OCTAVES, _QUICK_OCTAVES)
            for name in _TYPES
        ),
        work=work,
        judge=judge,
    )


KNOB = Knob(
    name="noise",
    title="Octaves of noise; float32 and float64",
    about="Each octave halves what is still missing and costs as much as the first. Coordinates "
    "kept in float32 take half the memory, but far from the origin their last bits are as coarse "
    "as the finest octaves: more of those buy nothing then. Sums are computed in float64 either "
    "way.",
    error="value, root mean square, in heights of the first octave",
    unit="",
    kind="value",
    needs="nothing",
    prepare=_prepare,
)
