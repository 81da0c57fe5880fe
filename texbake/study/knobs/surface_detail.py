"""Normal map, displacement, or both, on a light mesh."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from texbake.baking.bake import bake
from texbake.baking.options import BakeOptions
from texbake.rendering.camera import Camera
from texbake.rendering.options import RenderOptions
from texbake.rendering.render import render
from texbake.rendering.resolve import Frame
from texbake.study.case import Case
from texbake.study.knob import Bench, Knob, Outcome, Setting
from texbake.study.truth.pictures import crop, picture_error

_KINDS = {
    "bare": (),
    "normal map": ("normal",),
    "displacement": ("displacement",),
    "both": ("normal", "displacement"),
}


def _prepare(case: Case) -> Bench:
    pair = case.pair
    size = case.choose(2048, 128)
    baked = bake(
        pair.high,
        pair.low,
        BakeOptions(size=size, maps=("normal", "displacement"), threads=case.threads),
    )
    maps: dict[str, npt.NDArray[np.float32]] = {
        "normal": baked.maps["normal"].values,
        "displacement": baked.maps["displacement"].values[..., 0],
    }
    pixels = case.choose(600, 96)
    options = RenderOptions(width=pixels, height=pixels, supersampling=2)
    camera = Camera.framing(pair.high, pair.low, options=options)
    truth = render(pair.high, options=options, camera=camera, threads=case.threads)

    def work(kind: str) -> Frame:
        chosen = _KINDS[kind]
        return render(
            pair.low,
            normal_map=maps["normal"] if "normal" in chosen else None,
            displacement=maps["displacement"] if "displacement" in chosen else None,
            options=options,
            camera=camera,
            threads=case.threads,
        )

    def judge(kind: str, frame: Frame) -> Outcome:
        either = (frame.coverage > 0.0) | (truth.coverage > 0.0)
        outline = np.abs(frame.coverage - truth.coverage)
        return Outcome(
            error=picture_error(frame.color, truth.color, either),
            picture=crop(frame.color, (0.5, 0.5)),
            figures={
                "silhouette (% of the mesh's pixels)": 100.0
                * float(outline.sum() / truth.coverage.sum())
            },
        )

    return Bench(
        subject=f"{pair.subject}, maps of {size} x {size}, {pixels} x {pixels} pixels",
        truth="dense mesh",
        truth_text="A picture of the dense mesh itself by the same camera and light.",
        settings=tuple(Setting(kind, kind) for kind in _KINDS),
        work=work,
        judge=judge,
    )


KNOB = Knob(
    name="surface-detail",
    title="Normal map, displacement, both",
    about="A normal map shades a light mesh as though it were the dense one and leaves its outline "
    "as it is. Displacement moves the outline too, for the price of all the triangles that it is "
    "cut into.",
    error="picture, root mean square",
    unit="of 255",
    kind="picture",
    needs="pair",
    prepare=_prepare,
)
