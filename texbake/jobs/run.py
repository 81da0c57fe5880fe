"""The whole job: from a high-poly mesh to a low-poly one with its maps, pictures and a report.

    high ─ simplify ─ unwrap ─► low.obj ─ bake ─► normal.png, displacement.exr ─► low.glb
      └───────────────────────────── compare ─► preview.png, compare.png ─► report.json

The files appear together when all stages have succeeded; until then those of an earlier run are
kept.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import asdict, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texbake.baking.parts.bake_parts import bake_objects
from texbake.baking.result import BakeResult, check_texels
from texbake.errors import OptionError
from texbake.files import PathLike, appearing_together
from texbake.jobs.comparison import comparison_warnings
from texbake.jobs.fit import with_diagnosis
from texbake.jobs.fitting_atlas import unwrap_to_fit
from texbake.jobs.low_poly import LowPoly, LowPolyMaker
from texbake.jobs.material_transfer import channels_of_images, transferred_channels
from texbake.jobs.options import PICTURES, RunOptions, with_levels
from texbake.jobs.outputs import write_report
from texbake.jobs.run_files import coded_map, files_of_levels, mesh_name, write_asset
from texbake.mapping.unwrap import UnwrapReport
from texbake.mesh.hard_edges import LowNormals
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.materials import Materials
from texbake.mesh.mesh import Mesh
from texbake.mesh.normals import with_visible_normals
from texbake.mesh.objects import joined_objects
from texbake.mesh.simplify import SimplifyReport
from texbake.progress import Progress, StageRecord, Stages
from texbake.raycast.orientation import OrientationReport, oriented
from texbake.records import dataclass
from texbake.rendering.compare import Comparison, compare
from texbake.texture.image import write_image

if TYPE_CHECKING:
    from texbake.pages.asset_page import Plot


@dataclass(frozen=True, kw_only=True, eq=False)
class RunLevel:
    """A coarser level of detail."""

    mesh: Mesh
    baked: BakeResult
    files: dict[str, Path]  # as those of `RunResult`
    notes: tuple[str, ...] = ()  # what the user should know about its mesh, one sentence each


@dataclass(frozen=True, kw_only=True, eq=False)
class Asset:
    """A low-poly mesh and its maps, made from a high-poly mesh."""

    high: Mesh  # the high-poly mesh, facing outwards
    low: Mesh  # the low-poly mesh, with texture coordinates
    orientation: OrientationReport  # which parts of the high-poly mesh were flipped
    # why the low-poly mesh was made from a closed surface around the high-poly one, if no option
    # asked for it, and which gaps were closed
    why_closed: tuple[str, ...]
    simplified: SimplifyReport
    unwrapped: UnwrapReport
    baked: BakeResult

    @property
    def notes(self) -> tuple[str, ...]:
        """What the user should know about the low-poly mesh, one sentence each."""
        return (*self.orientation.notes, *self.why_closed, *self.simplified.notes)

    def to_json(self) -> dict[str, Any]:
        """Return the figures as plain values, for `json.dump`."""
        return {
            "orientation": asdict(self.orientation),
            "remesh": list(self.why_closed),
            "simplify": self.simplified.to_json(),
            "unwrap": self.unwrapped.to_json(),
            "bake": self.baked.report.to_json(),
        }


@dataclass(frozen=True, kw_only=True, eq=False)
class RunResult(Asset):
    """What `run` made."""

    # `mesh` (OBJ), `normal`, `displacement`, further maps, `glb` and `report`; `preview` and
    # `compare`, the pictures, unless nothing was compared. With a preset only one of the meshes is
    # there, and `settings`. Those of a coarser level of detail begin with `lod1_` and so on.
    files: dict[str, Path]
    comparison: Comparison | None  # none if nothing was compared
    # time and memory of the stages, including writing their files
    stages: list[StageRecord] = field(default_factory=list)
    missing: tuple[str, ...] = ()  # sentences on what the asset lacks of the high-poly file
    levels: tuple[RunLevel, ...] = ()  # coarser levels of detail

    @property
    def warnings(self) -> list[str]:
        """Return what the user should look at, a sentence each."""
        worse = [] if self.comparison is None else comparison_warnings(self.comparison)
        notes = [*self.notes, *(note for level in self.levels for note in level.notes)]
        return [*worse, *self.missing, *notes, *self.baked.report.warnings]

    def table(self) -> list[tuple[str, str]]:
        """Return rows of a label and a figure, how closely the result matches first."""
        faces = ("faces", f"{self.high.n_faces:,} to {self.low.n_faces:,}")
        return [faces, *self._match(), *self._texture()]

    def page_table(self) -> list[tuple[str, str]]:
        """Return the rows of the page, which shows the pictures first."""
        return [*self._texture(), *self._match(), ("Bake", ""), *self.baked.report.table()]

    def _match(self) -> list[tuple[str, str]]:
        distance = self.simplified.distance
        compared = [] if self.comparison is None else self.comparison.table()
        return [
            ("Compared with the high-poly mesh", ""),
            *((f"  {label}", figures) for label, figures in compared),
            (
                "  distance of the surfaces",
                f"RMS {100 * distance.rms_relative:.3f} %, "
                f"maximum {100 * distance.max_relative:.3f} % of the diagonal",
            ),
        ]

    def _texture(self) -> list[tuple[str, str]]:
        baked = self.baked.report
        return [
            *_sampling_rows(self.baked),
            ("Texture", ""),
            *([("  objects", baked.objects)] if baked.n_objects else []),
            ("  charts", f"{self.unwrapped.n_charts:,}, padding {self.unwrapped.options.padding}"),
        ]

    def to_json(self) -> dict[str, Any]:
        """Return every figure as plain values, for `json.dump`."""
        return {
            "files": {name: str(path) for name, path in self.files.items()},
            "stages": [asdict(stage) for stage in self.stages],
            **super().to_json(),
            "compare": None if self.comparison is None else self.comparison.to_json(),
            "levels": [
                {
                    "n_faces": level.mesh.n_faces,
                    "notes": list(level.notes),
                    "bake": level.baked.report.to_json(),
                }
                for level in self.levels
            ],
        }


@appearing_together()
def run(
    high: MeshLike,
    folder: PathLike,
    options: RunOptions | None = None,
    *,
    materials: Materials | None = None,
    progress: Progress = None,
) -> RunResult:
    """Make a low-poly mesh with maps from a high-poly mesh, pictures of both, and a report.

    Parameters
    ----------
    high
        The high-poly mesh. The files are named after it: `scan.ply` gives `scan_low.obj` and so on.
    folder
        For the files; made if it is missing.
    options
        None for the defaults.
    materials
        Of the high-poly mesh, all channels of which are baked; see `read_materials`. None
        for none: the mesh in the GLB file then has the base color of the options.
    progress
        True shows a bar for the running stage; a listener is called with each stage.

    Raises
    ------
    FileError
        The folder cannot be made or written to; raised before the work begins.
    UnwrapError
        No atlas could be made, or its charts are too small for the texels.
    """
    options = options or RunOptions()
    high = joined_objects(as_mesh(high)) if options.join_objects else as_mesh(high)
    channels = channels_of_images(materials, embeds=options.target.embeds)
    files, *others = files_of_levels(folder, high, channels, options)
    stages = Stages()
    asset, coarser = make_asset(
        high, options, low_name=mesh_name(files), materials=materials, stages=stages,
        progress=progress,
    )  # fmt: skip
    high, low, baked = asset.high, asset.low, asset.baked
    with stages.part("write maps"):
        write_asset(baked, (high, low), materials, files, options, progress)
    levels = []
    for made, level_files in zip(coarser, others, strict=True):
        with stages.part(f"level of {made.mesh.n_faces:,} triangles"):
            padding = asset.unwrapped.options.padding or 0
            scaled = options.at_level(low.n_faces, made.mesh.n_faces, padding)
            level = _baked_level(high, made, materials, level_files, scaled, progress)
            levels.append(level)
    comparison = None
    if options.compare != "off":
        with stages.part("compare"):
            comparison = _compared(high, low, baked, materials, files, options, progress)
    result = RunResult(
        files=with_levels(files, [level.files for level in levels]),
        levels=tuple(levels),
        comparison=comparison,
        stages=stages.records,
        **vars(asset),
    )
    write_report(files["report"], result.to_json())
    return result


def make_asset(
    high: Mesh,
    options: RunOptions,
    *,
    low_name: str,
    materials: Materials | None,
    stages: Stages,
    progress: Progress,
    must_reach: bool = True,
) -> tuple[Asset, list[LowPoly]]:
    """Simplify, unwrap and bake a mesh with all channels; also return coarser levels of it."""
    rule = LowNormals(options.normals, options.angle)
    with stages.part("simplify"):
        # The author of a model with images has seen it: one-sided cards are intended.
        keep_open = materials is not None and materials.has_images
        turning, threads = options.orientation, options.threads
        with Stages(progress).stage("find outside"):
            high, orientation = oriented(high, turning, keep_open=keep_open, threads=threads)
        with Stages(progress).stage("find hard edges"):
            high = rule.of_high(high, threads=threads)
        # Seams are dropped, because the unwrap cuts new charts.
        maker = LowPolyMaker(
            high=high, rule=rule, n_faces=options.n_faces, error=options.error,
            quality=options.quality, seams="drop", threads=threads, progress=progress,
        )  # fmt: skip
        low_poly = maker.make(options.remesh, must_reach=must_reach)
    if options.levels and options.levels[0] >= low_poly.mesh.n_faces:
        raise OptionError(
            f"levels: {options.levels[0]:,} triangles are not fewer than the "
            f"{low_poly.mesh.n_faces:,} of the low-poly mesh; request fewer"
        )
    low = rule.before_unwrap(low_poly.mesh.replace(name=low_name))
    with stages.part("unwrap"):
        low, unwrapped, _ = unwrap_to_fit(
            low, options.unwrap_options(), may_grow=False, threads=threads, progress=progress
        )
        low = rule.after_unwrap(low)
    with stages.part("levels") if options.levels else nullcontext():
        coarser = [maker.make_level(low, low_poly, n_faces) for n_faces in options.levels or ()]
    low = with_visible_normals(low, threads=threads)
    with stages.part("bake"):
        channels = transferred_channels(materials)
        chosen = low_poly.aimed(options.bake_options(channels, unwrapped.options.padding))
        baked = bake_objects(high, low, chosen, materials=materials, progress=progress)
        if low_poly.ray_distance is None:  # otherwise they miss what fills the tunnels
            baked = with_diagnosis(high, low, baked, join_objects=options.join_objects)
        check_texels(low, baked)
    return Asset(
        high=high, low=low, orientation=orientation, why_closed=low_poly.why,
        simplified=low_poly.report, unwrapped=unwrapped, baked=baked,
    ), coarser  # fmt: skip


def _sampling_rows(baked: BakeResult) -> list[tuple[str, str]]:
    """Return rows of what adaptive samples and a time budget have reached."""
    parts = (baked.report.sampling, baked.report.budget)
    rows = [(f"  {label}", figures) for part in parts if part for label, figures in part.table()]
    return [("Samples of the maps", ""), *rows] if rows else []


def _baked_level(
    high: Mesh,
    made: LowPoly,
    materials: Materials | None,
    files: dict[str, Path],
    options: RunOptions,
    progress: Progress,
) -> RunLevel:
    """Bake the maps of a coarser level, and write it."""
    mesh = made.mesh.replace(name=mesh_name(files))
    channels = transferred_channels(materials)
    chosen = made.aimed(options.bake_options(channels, options.padding))
    baked = bake_objects(high, mesh, chosen, materials=materials, progress=progress)
    check_texels(mesh, baked)
    write_asset(baked, (high, mesh), materials, files, options, progress)
    notes = tuple(f"{mesh.name}: {note}" for note in made.report.notes)
    return RunLevel(mesh=mesh, baked=baked, files=files, notes=notes)


def _compared(
    high: Mesh,
    low: Mesh,
    baked: BakeResult,
    materials: Materials | None,
    files: dict[str, Path],
    options: RunOptions,
    progress: Progress,
) -> Comparison:
    """Compare with the maps as their files hold them, and write both pictures."""
    full = options.compare == "full"
    shown = ("normal", "displacement") if full else ("normal",)
    maps = {name: coded_map(baked, name, options).as_read(files[name]) for name in shown}
    comparison = compare(
        high,
        low,
        normal_map=maps["normal"],
        displacement=maps.get("displacement"),
        high_materials=materials,
        options=options.render_options(),
        quick=not full,
        threads=options.threads,
        progress=progress,
    )
    for name, sheet in zip(PICTURES, comparison.sheets(), strict=True):
        write_image(sheet, files[name], color=True, threads=options.threads)
    return comparison


def with_page(
    result: RunResult,
    html: PathLike,
    options: RunOptions,
    *,
    command: str = "",
    plots: Sequence[Plot] = (),
) -> RunResult:
    """Write a page to look at, with `plots` of more measurements, and add it to the files."""
    from texbake.pages.asset_page import AssetPage, write_asset_page

    page = AssetPage(
        high=result.high,
        low=result.low,
        baked=result.baked,
        comparison=result.comparison,
        stages=result.stages,
        figures=result.page_table(),
        warnings=result.warnings,
        command=command,
        picture=options.render_options(),
        plots=plots,
    )
    write_asset_page(html, page)
    return replace(result, files={**result.files, "html": Path(html)})
