"""A page of an asset, for people to look at."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from texbake.building.memory import (
    IDLE_WORKER,
    MB,
    READ_FACE,
    faces_of,
)
from texbake.building.step import (
    InputRole,
    Job,
    Settings,
    Sizes,
    StepKind,
)
from texbake.rendering.options import RenderOptions

if TYPE_CHECKING:
    from texbake.mesh.mesh import Mesh
    from texbake.rendering.compare import Comparison

# Maps of the view, by the key of their file, as a page calls them.
_SHOWN = {"normal_map": "normal", "displacement": "displacement", "albedo": "albedo"}
_INFLATED = 80
# A page holds so much of a dense mesh and of maps at once.
_PAGE = 400 * MB


@dataclass(frozen=True, kw_only=True)
class PageStep:
    """Where the pictures and the view of a page start from.

    Attributes
    ----------
    view, up
        As those of `RenderOptions`.
    size : int
        Pixels a side of its pictures.
    """

    view: tuple[float, float] | tuple[float, float, float | None] = RenderOptions.view
    up: str = RenderOptions.up
    size: int = 560

    def __post_init__(self) -> None:
        _ = self.picture  # checks them

    @property
    def picture(self) -> RenderOptions:
        """Options of the pictures."""
        return RenderOptions(width=self.size, height=self.size, view=self.view, up=self.up)


def _run(job: Job) -> dict[str, Any]:
    from texbake.mesh.files import read_mesh
    from texbake.pages.asset_page import AssetPage, write_asset_page

    options: PageStep = PAGE.made(job.settings)
    # Files of a build have the names of their outputs, which say nothing to a reader.
    high = read_mesh(job.file("high")).replace(name="its dense mesh")
    low = read_mesh(job.file("low")).replace(name=job.asset)
    maps = {name: file for role, name in _SHOWN.items() if (file := job.input(role))}
    comparison = _compared(high, low, job, options)
    page = AssetPage(
        high=high,
        low=low,
        files=maps,
        misses=job.input("misses"),
        comparison=comparison,
        figures=_figures(comparison),
        picture=options.picture,
    )
    write_asset_page(job.outputs["page"], page)
    if comparison is None:
        return {}
    return {"error_deg": comparison.mapped.mean_deg, "bare_error_deg": comparison.bare.mean_deg}


def _compared(high: Mesh, low: Mesh, job: Job, options: PageStep) -> Comparison | None:
    """Pictures and angles of both meshes; None without normals that could be compared."""
    from texbake.rendering.compare import compare

    if job.input("normal_map") is None:
        return None
    return compare(
        high,
        low,
        normal_map=job.input("normal_map"),
        options=options.picture,
        threads=job.threads,
    )


def _figures(comparison: Comparison | None) -> list[tuple[str, str]]:
    from texbake.jobs.report import comparison_table

    return [] if comparison is None else comparison_table(comparison)


def _memory(settings: Settings, sizes: Sizes) -> int:
    roles = (*_SHOWN, "misses")
    images = _INFLATED * sum(size.n_bytes for role in roles for size in sizes.get(role, ()))
    meshes = 2 * READ_FACE * (faces_of(sizes, "high") + faces_of(sizes, "low"))
    return int(IDLE_WORKER + _PAGE + images + meshes)


PAGE = StepKind(
    name="page",
    does="writes a page of an asset: the meshes, their maps, errors",
    options=PageStep,
    without=(),
    inputs=(
        InputRole(name="high"),
        InputRole(name="low"),
        *(InputRole(name=role, required=False) for role in (*_SHOWN, "misses")),
    ),
    outputs=lambda settings: {"page": "page.html"},
    run=_run,
    memory=_memory,
    names_asset=True,
)
