"""Texture size: texels a side of the maps of a bake."""

from __future__ import annotations

import numpy as np

from texbake.baking.bake import bake
from texbake.baking.options import BakeOptions
from texbake.baking.result import BakeResult
from texbake.study.case import Case
from texbake.study.knob import Bench, Knob, Outcome, Setting
from texbake.study.truth.pictures import close_up
from texbake.study.truth.probes import probe, truth_of

_SIZES = (256, 512, 1024, 2048, 4096, 8192)
_QUICK_SIZES = (32, 64, 128)


def _prepare(case: Case) -> Bench:
    pair = case.pair
    probes = probe(pair, case.choose(100_000, 5_000), threads=case.threads)

    def work(size: int) -> BakeResult:
        options = BakeOptions(size=size, maps=("normal", "displacement"), threads=case.threads)
        return bake(pair.high, pair.low, options)

    def judge(size: int, result: BakeResult) -> Outcome:
        normals = result.maps["normal"].values
        angles = probes.normal_errors(normals)
        heights = probes.height_errors(result.maps["displacement"].values)
        return Outcome(
            error=float(angles.mean()),
            picture=close_up(pair.low, normal_map=normals, zoom=12.0, threads=case.threads),
            figures={
                "angle, 95th percentile (°)": float(np.quantile(angles, 0.95)),
                "height, mean (% of diagonal)": 100.0 * float(heights.mean()) / pair.low.diagonal,
            },
        )

    truth, words = truth_of(pair, probes)
    sizes = case.choose(_SIZES, _QUICK_SIZES)
    return Bench(
        subject=pair.subject,
        truth=truth,
        truth_text=words,
        settings=tuple(Setting(str(size), size) for size in sizes),
        work=work,
        judge=judge,
    )


KNOB = Knob(
    name="texture-size",
    title="Texture size",
    about="Texels a side of a normal and a displacement map. Four times the texels cost about four "
    "times the time and memory; what they buy depends on how fine the detail is.",
    error="angle of the normal, mean",
    unit="°",
    kind="angle",
    needs="pair",
    prepare=_prepare,
)
