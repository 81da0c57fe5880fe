"""Pictures of a mesh, a glTF file or a scene: one, several side by side, or a turntable.

A mesh is lit by the studio, and so is a scene without lights. Several filters, interpolations or
buffers give pictures of all their combinations, side by side in one file.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from texbake.errors import OptionError
from texbake.files import PathLike, appearing_together, check_folder, make_folder, scratch_folder
from texbake.jobs.outputs import (
    JobResult,
    check_distinct,
    check_page,
    check_picture,
    check_report,
    given,
    write_report,
)
from texbake.jobs.side_by_side import render_side_by_side, side_by_side_options
from texbake.mesh.files import read_mesh
from texbake.progress import ProgressSink, Stages
from texbake.rendering.contributions import Contribution, contributions_of
from texbake.rendering.costs import Costs
from texbake.rendering.draw import prepare
from texbake.rendering.effect import Plan
from texbake.rendering.maps import MapSource, space_warnings
from texbake.rendering.options import RenderOptions
from texbake.rendering.plan import plan_report, plan_table
from texbake.rendering.render import draw_picture, plan_scene, render_scene
from texbake.rendering.resolve import Frame
from texbake.rendering.scene.lights import Environment
from texbake.rendering.scene.read import read_scene
from texbake.rendering.scene.scene import Scene, turntable_cameras
from texbake.rendering.studio import STUDIO, STUDIO_ROOM, studio_scene
from texbake.sampling.time_budget import BudgetClock, finished
from texbake.texture.image import FloatImage, write_image

# Texels along one side of the room that metals reflect if a file has no environment.
_ROOM_SIZE = 128


def open_preview(
    path: PathLike,
    *,
    normal_map: MapSource | None = None,
    displacement: MapSource | None = None,
    albedo: MapSource | None = None,
    space: str | None = None,
    options: Mapping[str, Any] | None = None,
    as_mesh: bool = False,
    progress: ProgressSink | None = None,
) -> tuple[Scene, RenderOptions]:
    """Read a scene to draw, and the options to draw it with.

    Parameters
    ----------
    path
        A mesh, a glTF file or a `.toml` scene. A glTF file is drawn with its own materials, unless
        maps are given.
    normal_map, displacement, albedo
        Of a mesh, as in `texbake.rendering.render.render`.
    space
        Of the normal map; None: what its file says, else tangent space.
    options
        Fields of `RenderOptions` that override those of the scene file.
    as_mesh
        Draw a glTF file as a mesh without materials of its own, also if no maps are given.
    progress
        Receives the reading.

    Raises
    ------
    OptionError
        Maps are given for a scene, which has materials of its own, or a space and no normal map.
    TexbakeError
        As `read_mesh` and `read_scene` do.
    """
    maps: Any = {"normal_map": normal_map, "displacement": displacement, "albedo": albedo}
    named = [name for name, source in maps.items() if source is not None]
    suffix = Path(path).suffix.lower()
    if suffix == ".toml" and named:
        raise OptionError(f"{named[0]}: a scene has its own materials; name the map in {path}")
    if space is not None and normal_map is None:
        raise OptionError("space: it is that of a normal map; give `normal_map` as well")
    changes = dict(options or {})
    if suffix == ".toml" or (suffix in (".glb", ".gltf") and not (named or as_mesh)):
        scene = with_lighting(read_scene(path, progress=progress))
        if "view" in changes:  # overrides the camera of the file
            scene = replace(scene, view=None)
        return scene, scene.options(**changes)
    chosen = replace(RenderOptions(), **changes)
    mesh = read_mesh(path, progress=progress)
    return studio_scene(mesh, **maps, space=space, options=chosen), chosen


@dataclass(frozen=True, kw_only=True, eq=False)
class PreviewFiles(JobResult[Frame | None]):
    """What `preview_files` drew; `report` is the first picture, or None where only planned.

    Attributes
    ----------
    plan : Plan
        Which passes were chosen, and why.
    contributions : tuple of Contribution
        What each effect changes, if that was asked for.
    """

    plan: Plan
    contributions: tuple[Contribution, ...] = ()

    @property
    def costs(self) -> Costs | None:
        """What each pass took; None where nothing was drawn."""
        return None if self.report is None else self.report.costs

    def table(self) -> list[tuple[str, str]]:
        """Return rows of what adaptive samples and a time budget have reached."""
        frame = self.report
        parts = () if frame is None else (frame.sampling, frame.budget, frame.texels)
        return [row for part in parts if part is not None for row in part.table()]

    def plan_tables(self) -> tuple[list[tuple[str, ...]], list[tuple[str, ...]]]:
        """Return the passes with their reasons and costs, and what was left out and why."""
        rows, left_out = plan_table(self.plan, self.costs)
        return [*rows], [*left_out]

    def to_json(self) -> dict[str, Any]:
        """Return the plan, its costs, and what samples have reached, as plain values."""
        reached = {} if self.report is None else self.report.sampling_report()
        changes = [item.to_json() for item in self.contributions]
        changed = {"effects": changes} if changes else {}
        return plan_report(self.plan, self.costs) | reached | changed

    def contributions_table(self) -> list[tuple[str, ...]]:
        """Return rows of effects, the pixels that each changed, and what it cost."""
        rows = [("effect", "pixels changed", "%", "largest", "ms", "kB")]
        for item in self.contributions:
            pixels = f"{item.pixels:,}" if item.pixels else "changed nothing"
            rows.append(
                (item.name, pixels, f"{100.0 * item.share:.1f}", str(item.largest),
                 f"{item.milliseconds:,.1f}", f"{item.n_bytes / 1000:,.0f}")
            )  # fmt: skip
        return [*rows]


@appearing_together()
def preview_files(
    path: PathLike,
    output: PathLike | None,
    options: Mapping[str, Any] | None = None,
    *,
    normal_map: PathLike | None = None,
    displacement: PathLike | None = None,
    albedo: PathLike | None = None,
    space: str | None = None,
    filters: Sequence[str] = (),
    interpolations: Sequence[str] = (),
    buffers: Sequence[str] = (),
    mapping_orders: Sequence[str] = (),
    n_views: int | None = None,
    as_mesh: bool = False,
    contributions: bool = False,
    report: PathLike | None = None,
    html: PathLike | None = None,
    command: str = "",
    threads: int | None = None,
    progress: ProgressSink | None = None,
    clock: BudgetClock | None = None,
) -> PreviewFiles:
    """Draw a mesh file with its maps, or a scene file.

    Parameters
    ----------
    path, options, normal_map, displacement, albedo, space, as_mesh
        As for `open_preview`.
    output
        The picture; with `n_views` a folder. None to plan the passes and draw nothing.
    filters, interpolations, buffers, mapping_orders
        Draw all combinations of these, side by side.
    n_views
        Draw a turntable of as many pictures.
    contributions
        Whether to draw the picture again without each effect, to tell what it changes.
    report
        File for the plan, its costs, and what samples have reached, as JSON.
    html
        Page with the picture and the contributions of its effects, which are then found as well.
    command
        Command line to show on the page.
    threads
        None for every processor.
    progress
        Receives the stages.
    clock
        When the time of `RenderOptions.time_budget` began; None: now. It ends when the picture is
        written.

    Raises
    ------
    OptionError
        A turntable has several filters, interpolations, buffers or mapping orders.
    TexbakeError
        As `open_preview` and `render_scene` do.
    """
    clock = clock or BudgetClock()
    several = (filters, interpolations, buffers, mapping_orders)
    if n_views is not None and max(map(len, several)) > 1:
        raise OptionError("view: a turntable has one filter, interpolation and buffer; name one")
    measures = contributions or html is not None
    if measures and (output is None or n_views is not None or max(map(len, several)) > 1):
        raise OptionError("contributions: they are those of one picture; draw one")
    check_distinct([output, report, html], [path, normal_map, displacement, albedo])
    check_report(report)
    check_page(html)
    if output is not None and n_views is None:
        check_picture(output)
    elif output is not None:
        check_folder(output)
    scene, chosen = open_preview(
        path,
        normal_map=normal_map,
        displacement=displacement,
        albedo=albedo,
        space=space,
        options=options,
        as_mesh=as_mesh,
        progress=progress,
    )
    pictures = _pictures(output, n_views)
    check_distinct([*pictures, report, html], scene.files)
    variants = side_by_side_options(
        chosen,
        filters=filters,
        interpolations=interpolations,
        buffers=buffers,
        mapping_orders=mapping_orders,
    )
    frame = None
    if output is not None and n_views is not None:
        frame = write_turntable(
            scene, variants[0][1], n_views, output, threads=threads, progress=progress
        )
    elif output is not None:
        frame = _write_picture(scene, variants, output, threads, progress, clock)
    changes: tuple[Contribution, ...] = ()
    if measures and frame is not None:
        changes = contributions_of(scene, variants[0][1], frame, threads=threads, progress=progress)
    if html is not None and frame is not None:
        # Imported here, so that other pictures do not load what pages need.
        from texbake.pages.contributions_page import write_contributions_page

        write_contributions_page(html, Path(path).name, frame, changes, command)
    done = PreviewFiles(
        files=given(output, report, html),
        report=frame,
        contributions=changes,
        plan=plan_scene(scene, variants[0][1]) if frame is None else frame.plan,
        warnings=(*space_warnings(normal_map, space), *_warnings(path, scene, frame)),
    )
    if report is not None:
        write_report(report, done.to_json())
    return done


def _pictures(output: PathLike | None, n_views: int | None) -> Sequence[Path]:
    if output is None or n_views is None:
        return given(output)
    return turntable_files(output, n_views)


def _write_picture(
    scene: Scene,
    variants: Sequence[tuple[str, RenderOptions]],
    output: PathLike,
    threads: int | None,
    progress: ProgressSink | None,
    clock: BudgetClock,
) -> Frame:
    """Write one picture, or several side by side; return the first."""
    if len(variants) == 1:
        clock = replace(clock, finish=_WritingPicture(Path(output).suffix, threads))
        frame = render_scene(scene, variants[0][1], threads=threads, progress=progress, clock=clock)
        frame.write(output, threads=threads)
        if frame.budget is not None:
            frame = replace(frame, budget=finished(frame.budget, clock))
        return frame
    color, frames = render_side_by_side(scene, variants, threads=threads, progress=progress)
    write_image(color, output, color=True, threads=threads)
    return frames[0]


@dataclass(frozen=True)
class _WritingPicture:
    """Writes a picture as it will be written, but to no purpose other than to time it."""

    suffix: str
    threads: int | None

    def __call__(self, color: FloatImage) -> None:
        with scratch_folder() as folder:
            path = folder / f"picture{self.suffix}"
            write_image(color, path, color=True, threads=self.threads)


def _warnings(path: PathLike, scene: Scene, frame: Frame | None) -> Iterator[str]:
    if frame is not None:
        yield from (f"{path}: {note}" for note in scene.notes)
        for part in (frame.sampling, frame.budget):
            if part is not None:
                yield from part.warnings


def with_lighting(scene: Scene) -> Scene:
    """Return the scene, lit by the studio if nothing lights its surfaces.

    Emissive and unlit materials light nothing else; light maps count as lighting. If a material is
    a metal, the room of the studio lights the scene instead, so that the metal has something to
    reflect.
    """
    lighting = scene.lighting
    materials = [item.material for item in scene.objects]
    is_lit = (
        lighting.lights
        or any(lighting.ambient.color)
        or any(lighting.ambient.ground or ())
        or lighting.environment is not None
        or any(item.light_map is not None for item in materials)
    )
    if is_lit or all(item.shading == "unlit" for item in materials):
        return scene
    if any(item.metalness != 0.0 for item in materials):
        room = Environment(image=STUDIO_ROOM, size=_ROOM_SIZE, background=False, lighting=True)
        return replace(scene, lighting=replace(lighting, environment=room))
    return replace(scene, lighting=replace(lighting, lights=STUDIO.lights, ambient=STUDIO.ambient))


def turntable_files(folder: PathLike, n_views: int) -> list[Path]:
    """Return the files of a turntable's pictures, in their order.

    >>> [file.name for file in turntable_files("frames", 2)]
    ['000.png', '001.png']
    """
    digits = max(3, len(str(n_views - 1)))
    return [Path(folder) / f"{index:0{digits}d}.png" for index in range(n_views)]


def write_turntable(
    scene: Scene,
    options: RenderOptions,
    n_views: int,
    folder: PathLike,
    *,
    threads: int | None = None,
    progress: ProgressSink | None = None,
) -> Frame:
    """Draw one turn around the scene into a folder, as `000.png`, `001.png` and so on.

    The folder is made if it is missing; each file in it appears whole or not at all.

    Returns
    -------
    Frame
        The last picture.

    Raises
    ------
    FileError
        The folder cannot be written.
    TexbakeError
        As `texbake.rendering.render.render_scene` does.
    """
    path = make_folder(folder)
    prepared = prepare(scene, options, threads=threads)
    cameras = turntable_cameras(scene, options, n_views)
    stages = Stages(progress)
    with stages.stage("turn", total=n_views, unit="pictures") as advance:
        for file, camera in zip(turntable_files(path, n_views), cameras, strict=True):
            frame = draw_picture(prepared, camera)
            frame.write(file, threads=threads)
            advance(1)
    return frame
