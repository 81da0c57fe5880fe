"""All kinds of steps: those of verbs, and those that show an asset, which stand here."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from texbake.baking.memory import MB, PROCESS
from texbake.rendering.options import RenderOptions
from texbake.verbs.step import (
    DECODED,
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

# Maps that `preview` and `page` show.
_SHOWN = ("normal_map", "displacement", "albedo")
# Bytes per sample of a picture, and per triangle that displacement divides a mesh into.
_SAMPLE, _DIVIDED = 120, 150


def _preview_memory(settings: Settings, sizes: Sizes) -> int:
    """Estimate for a picture of a mesh with its maps."""
    samples = settings["width"] * settings["height"] * settings["supersampling"] ** 2
    divided = _DIVIDED * settings["max_triangles"] if sizes.get("displacement") else 0
    images = DECODED * n_bytes(sizes, *_SHOWN)
    mesh = READ_FACE * n_faces(sizes, "mesh")
    return int(PROCESS + 64 * MB + _SAMPLE * samples + mesh + images + divided)


def _page_memory(settings: Settings, sizes: Sizes) -> int:
    """Estimate for the page of an asset."""
    images = 80 * n_bytes(sizes, *_SHOWN, "misses")
    return int(PROCESS + 400 * MB + images + 2 * READ_FACE * n_faces(sizes, "high", "low"))


def _preview(job: Job) -> dict[str, Any]:
    from texbake.jobs.preview import preview_files
    from texbake.jobs.preview_scene import MeshMaps

    maps: dict[str, Any] = {name: job.input(name) for name in _SHOWN}
    preview_files(
        job.file("mesh"),
        job.outputs["picture"],
        vars(PREVIEW.made(job.settings)),
        maps=MeshMaps(**maps, replaces=True),
        threads=job.threads,
    )
    return {}


PREVIEW = StepKind(
    name="preview",
    does="draws a mesh with its maps",
    options=RenderOptions,
    without=("time_budget",),
    inputs=(
        Reads("mesh"),
        *(Reads(name, required=False) for name in _SHOWN),
    ),
    outputs=lambda settings: {"picture": "preview.png"},
    run=_preview,
    memory=_preview_memory,
)


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
    maps = {name.removesuffix("_map"): file for name in _SHOWN if (file := job.input(name))}
    comparison = page_file(
        job.file("high"),
        job.file("low"),
        job.outputs["page"],
        options.picture,
        name=job.asset,
        maps=maps,
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
        *(Reads(role, required=False) for role in (*_SHOWN, "misses")),
    ),
    outputs=lambda settings: {"page": "page.html"},
    run=_page,
    memory=_page_memory,
    names_asset=True,
)


_HERE = {kind.name: kind for kind in (PREVIEW, PAGE)}
# In the order in which a pipeline usually has them.
_NAMES = (
    *("make", "repair", "transform", "remesh", "simplify", "unwrap", "check", "bake"),
    *("bake-texture", "pack-textures", "pack-channels", "split-channels", "mipmap"),
    *("preview", "page", "export"),
)
STEP_KINDS: dict[str, StepKind] = {name: _HERE.get(name) or find_step(name) for name in _NAMES}
