"""All kinds of steps: those of verbs, and the page of an asset, which is defined here."""

from __future__ import annotations

from typing import Any

from texbake.baking.memory import MB, PROCESS
from texbake.records import dataclass
from texbake.rendering.options import RenderOptions
from texbake.verbs.preview import SHOWN
from texbake.verbs.step import (
    READ_FACE,
    Job,
    Settings,
    Sizes,
    StepKind,
    find_step,
    n_bytes,
    n_faces,
)
from texbake.verbs.verb import Reads


def _page_memory(settings: Settings, sizes: Sizes) -> int:
    """Estimate for the page of an asset."""
    images = 80 * n_bytes(sizes, *SHOWN, "misses")
    return int(PROCESS + 400 * MB + images + 2 * READ_FACE * n_faces(sizes, "high", "low"))


@dataclass(frozen=True, kw_only=True)
class PageStep:
    """From where the pictures and the view of a page look at the asset.

    Attributes
    ----------
    view
        Azimuth and elevation of the camera in degrees, and its distance in model units.
    up : str
        Axis of the world that is up in the pictures: y or z.
    size : int
        Width and height of the pictures, in pixels.
    """

    view: tuple[float, float] | tuple[float, float, float | None] = RenderOptions.view
    up: str = RenderOptions.up
    size: int = 560

    def __post_init__(self) -> None:
        _ = self.picture  # raises what is wrong with them

    @property
    def picture(self) -> RenderOptions:
        """Options of the pictures."""
        return RenderOptions(width=self.size, height=self.size, view=self.view, up=self.up)


def _page(job: Job) -> dict[str, Any]:
    from texbake.jobs.comparison import page_file

    options: PageStep = PAGE.made(job.settings)
    comparison = page_file(
        job.file("high"),
        job.file("low"),
        job.outputs["page"],
        options.picture,
        name=job.asset,
        maps={name.removesuffix("_map"): file for name in SHOWN if (file := job.input(name))},
        misses=job.input("misses"),
        threads=job.threads,
    ).report
    if comparison is None:
        return {}
    return {"error_deg": comparison.mapped.mean_deg, "bare_error_deg": comparison.bare.mean_deg}


PAGE = StepKind(
    name="page",
    does="writes a page of an asset: the meshes, their maps, errors",
    options=PageStep,
    without=(),
    inputs=(
        Reads("high"),
        Reads("low"),
        *(Reads(role, required=False) for role in (*SHOWN, "misses")),
    ),
    outputs=lambda settings: {"page": "page.html"},
    run=_page,
    memory=_page_memory,
    names_asset=True,
)


# In the order in which a pipeline usually has them.
_NAMES = (
    *("make", "repair", "transform", "remesh", "run", "simplify", "unwrap", "check", "bake"),
    *("bake-texture", "pack-textures", "pack-channels", "split-channels", "mipmap"),
    *("preview", "page", "export"),
)
STEP_KINDS: dict[str, StepKind] = {
    name: PAGE if name == "page" else find_step(name) for name in _NAMES
}
