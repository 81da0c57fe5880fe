"""Direction of the rays: face, vertex or smooth normals, or a cage."""

from __future__ import annotations

from texbake.baking.bake import bake
from texbake.baking.options import BakeOptions
from texbake.baking.result import BakeResult
from texbake.mesh.mesh import Mesh
from texbake.mesh.normals import smooth_normals
from texbake.rendering.compare import compare
from texbake.rendering.options import RenderOptions
from texbake.study.case import Case
from texbake.study.knob import Bench, Knob, Outcome, Setting
from texbake.study.truth.pictures import close_up

_DIRECTIONS = ("face", "vertex", "smooth", "cage")
_VIEWS = ((30.0, 20.0), (150.0, -20.0), (270.0, 20.0))


def _prepare(case: Case) -> Bench:
    pair = case.pair
    size = case.choose(1024, 64)
    cage, back = _cage(pair.high, pair.low, case.threads)
    pixels = case.choose(480, 64)
    options = RenderOptions(width=pixels, height=pixels, supersampling=1)

    def work(direction: str) -> BakeResult:
        if direction == "cage":
            bakes = BakeOptions(size=size, back=back, threads=case.threads)
            return bake(pair.high, pair.low, bakes, cage=cage)
        bakes = BakeOptions(size=size, rays=direction, threads=case.threads)
        return bake(pair.high, pair.low, bakes)

    def judge(direction: str, result: BakeResult) -> Outcome:
        normals = result.maps["normal"].values
        seen = compare(
            pair.high,
            pair.low,
            normal_map=normals,
            options=options,
            views=_VIEWS[: case.choose(3, 1)],
            threads=case.threads,
        ).mapped
        report = result.report
        return Outcome(
            error=seen.mean_deg,
            picture=close_up(pair.low, normal_map=normals, threads=case.threads),
            figures={
                "angle, 95th percentile (°)": seen.p95_deg,
                "texels missed (%)": 100.0 * report.texels_missed / report.texels_covered,
            },
        )

    return Bench(
        subject=f"{pair.subject}, at {size} x {size}",
        truth="dense mesh",
        truth_text="Pictures of the dense mesh itself, pixel by pixel: no direction of rays is "
        "taken for the right one.",
        settings=tuple(Setting(name, name) for name in _DIRECTIONS),
        work=work,
        judge=judge,
    )


def _cage(high: Mesh, low: Mesh, threads: int | None) -> tuple[Mesh, float]:
    """Light mesh moved outwards as far as smooth rays would start, and how far those go inwards."""
    measured = bake(high, low, BakeOptions(size=32, threads=threads)).report
    moved = low.positions + (measured.front or 0.0) * smooth_normals(low)
    return low.replace(positions=moved, name="cage"), measured.back


KNOB = Knob(
    name="ray-direction",
    title="Ray direction",
    about="Where the ray of a texel goes. Along face normals neighboring faces look past one "
    "another; the light mesh's own normals split at hard edges; smooth normals and cages leave no "
    "gaps. All cost the same, so this one is free to get right.",
    error="angle between shading normals in pictures, mean",
    unit="°",
    kind="angle",
    needs="pair",
    prepare=_prepare,
)
