"""Triangles of the light mesh, and how it is made."""

from __future__ import annotations

import numpy as np

from texbake.baking.bake import bake
from texbake.baking.options import BakeOptions
from texbake.mapping.unwrap import unwrap
from texbake.mesh.distance import surface_distance
from texbake.mesh.mesh import Mesh
from texbake.mesh.simplify import simplify
from texbake.study.case import Case, Pair
from texbake.study.knob import Bench, Knob, Outcome, Setting, Unfit
from texbake.study.truth.pictures import close_up
from texbake.study.truth.probes import probe

_COUNTS = (100, 500, 2_000, 10_000, 50_000)
_QUICK_COUNTS = (50, 200)
_QUALITIES = ("fast", "best")
# Above as many triangles an atlas takes longer than all the rest together, and no angle is told.
_MOST_UNWRAPPED = 10_000


def _prepare(case: Case) -> Bench | Unfit:
    pair = case.pair
    size = case.choose(1024, 64)
    counts = [n for n in case.choose(_COUNTS, _QUICK_COUNTS) if n < pair.high.n_faces]
    if not counts:
        return Unfit(
            f"{pair.high.name} has {pair.high.n_faces} triangles, too few to be simplified to any "
            "of the numbers that are tried"
        )

    def work(value: tuple[int, str]) -> Mesh:
        count, quality = value
        return simplify(pair.high, count, quality=quality, threads=case.threads)

    def judge(value: tuple[int, str], light: Mesh) -> Outcome:
        samples = case.choose(50_000, 2_000)
        distance = surface_distance(pair.high, light, n_samples=samples, threads=case.threads)
        figures = {
            "triangles": float(light.n_faces),
            "distance, maximum (% of diagonal)": 100.0 * distance.max_relative,
        }
        if light.n_faces > _MOST_UNWRAPPED:
            return Outcome(
                100.0 * distance.mean_relative, close_up(light, zoom=1.0), figures=figures
            )
        mapped = unwrap(light, quality="fast", size=size, threads=case.threads)
        baked = bake(pair.high, mapped, BakeOptions(size=size, threads=case.threads))
        normals = baked.maps["normal"].values
        probes = probe(
            Pair(pair.high, mapped, "", pair.surface), case.choose(50_000, 2_000),
            threads=case.threads,
        )  # fmt: skip
        figures["angle after the bake, mean (°)"] = float(np.mean(probes.normal_errors(normals)))
        picture = close_up(mapped, normal_map=normals, zoom=1.0, threads=case.threads)
        return Outcome(100.0 * distance.mean_relative, picture, figures)

    return Bench(
        subject=f"{pair.high.name}, {pair.high.n_faces:,} triangles",
        truth="dense mesh",
        truth_text="The dense mesh itself: distances between both surfaces, both ways. Angles are "
        f"those of a {size} x {size} map baked onto the light mesh, up to "
        f"{_MOST_UNWRAPPED:,} triangles.",
        settings=tuple(
            Setting(f"{n:,} {quality}", (n, quality), quality)
            for n in counts
            for quality in _QUALITIES
        ),
        work=work,
        judge=judge,
    )


KNOB = Knob(
    name="light-mesh",
    title="Light mesh",
    about="How many triangles the dense mesh is simplified to, and by which method. What the "
    "triangles leave out the normal map puts back into the shading, but not into the silhouette.",
    error="distance between the surfaces, mean",
    unit="% of diagonal",
    kind="length",
    needs="pair",
    prepare=_prepare,
)
