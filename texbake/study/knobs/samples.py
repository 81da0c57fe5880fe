"""Samples a texel: how many rays are averaged into one."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from texbake.baking.bake import bake
from texbake.baking.options import ADAPTIVE, SAMPLES, BakeOptions
from texbake.baking.result import BakeResult
from texbake.study.case import Case
from texbake.study.knob import Bench, Knob, Outcome, Setting
from texbake.study.truth.pictures import close_up
from texbake.study.truth.probes import angles_deg
from texbake.study.truth.texel_means import N_RAYS, mean_normals

# Estimated errors that adaptive samples may leave in a texel, degrees.
_BOUNDS = (2.0, 1.0, 0.5, 0.25, 0.12)
_QUICK_BOUNDS = (1.0,)
_FIXED, _BUDGET = "fixed samples", "time budget"
# Budgets, in the time of 16 samples a texel.
_BUDGETS = (0.5, 1.0, 2.0)
_QUICK_BUDGETS = (1.0,)


def _prepare(case: Case) -> Bench:
    pair = case.pair
    size = case.choose(1024, 32)
    truth, known = mean_normals(pair, size, threads=case.threads)

    def work(asked: BakeOptions) -> BakeResult:
        return bake(pair.high, pair.low, asked)

    def judge(asked: BakeOptions, result: BakeResult) -> Outcome:
        values = result.maps["normal"].values
        compared = known & result.has_data
        angles = angles_deg(values[compared].astype(np.float64), truth[compared])
        return Outcome(
            error=float(np.sqrt((angles**2).mean())),
            picture=close_up(pair.low, normal_map=values, zoom=12.0, threads=case.threads),
            figures={
                "angle, mean (°)": float(angles.mean()),
                "angle, 95th percentile (°)": float(np.quantile(angles, 0.95)),
                "angle, maximum (°)": float(angles.max()),
            },
        )

    return Bench(
        subject=f"{pair.subject}, at {size} x {size}",
        truth="converged",
        truth_text=f"The mean normal over the covered part of each texel, of a grid of {N_RAYS:,} "
        "rays, all of them added up before the sum is normalized. Where edges run through texels "
        "it is itself off by about half of what 64 samples are.",
        settings=_settings(case, size, work),
        work=work,
        judge=judge,
    )


def _settings(
    case: Case, size: int, work: Callable[[BakeOptions], BakeResult]
) -> tuple[Setting, ...]:
    """Fixed samples, bounds, and budgets that are shares of the time that 16 samples take."""
    same = BakeOptions(size=size, threads=case.threads)
    sixteen = replace(same, samples=16)
    work(sixteen)  # compiles
    start = time.perf_counter()
    work(sixteen)
    seconds = time.perf_counter() - start
    fixed = [Setting(str(n), replace(same, samples=n), _FIXED) for n in SAMPLES]
    bounds = [
        Setting(
            f"{ADAPTIVE} {bound:g}°",
            replace(same, samples=ADAPTIVE, max_error=f"{bound:g}deg"),
            ADAPTIVE,
        )
        for bound in case.choose(_BOUNDS, _QUICK_BOUNDS)
    ]
    budgets = [
        Setting(f"budget {budget:.2g} s", replace(same, time_budget=f"{budget:.2g}s"), _BUDGET)
        for budget in (share * seconds for share in case.choose(_BUDGETS, _QUICK_BUDGETS))
    ]
    return (*fixed, *bounds, *budgets)


KNOB = Knob(
    name="samples",
    title="Samples per texel",
    about="Rays averaged into each texel. Detail finer than a texel turns into noise with one and "
    "into its mean with many; where there is none, more rays buy nothing. Adaptive samples go "
    "where neighbors disagree, until the estimated error of each texel is below the bound; a time "
    "budget takes the bound that is predicted to fit.",
    error="angle to the texel's mean normal, root mean square",
    unit="°",
    kind="angle",
    needs="pair",
    prepare=_prepare,
    baseline=_FIXED,
)
