"""`texbake preview`: a picture of a mesh or a scene."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from texbake.files import check_folder
from texbake.jobs.outputs import check_distinct, check_picture, check_report
from texbake.rendering.options import (
    BUFFERS,
    EDGES,
    INTERPOLATIONS,
    RenderOptions,
)
from texbake.rendering.scene.textures import FILTERS

from ..options import (
    IMAGE_SUFFIXES,
    MESH_SUFFIXES,
    choice_option,
    image_option,
    number_option,
    picture_changes,
    report_option,
    threads_option,
)
from ..terminal import Terminal, columns, say, terminal_options
from ..types import FileOf, Names, Turntable

if TYPE_CHECKING:
    from texbake.progress import ProgressSink
    from texbake.rendering.picture import Costs
    from texbake.rendering.plan.plan import Plan
    from texbake.rendering.resolve import Frame
    from texbake.rendering.scene.scene import Scene

_TARGETS = ("max_error", "time_budget")
# The two that `--affine-vs-perspective` lays side by side.
_AFFINE_VS_PERSPECTIVE = ("affine", "perspective")


@click.command(
    epilog="""
    \b
    Example:
      texbake preview low.obj --normal-map normal.png -o low.png
      texbake preview scan.ply --up z --view 120,15 --size 1920x1080 -o scan.png
      texbake preview scene.toml -o scene.png --explain
      texbake preview scene.toml -o scene.png --max-error 2/255
      texbake preview scene.toml -o scene.png --time-budget 20s
      texbake preview scene.toml --plan-only
      texbake preview scene.toml --filter nearest,bilinear,trilinear,ewa -o filters.png
      texbake preview scene.toml --affine-vs-perspective -o affine.png
      texbake preview scene.toml --buffer depth,normals,uv -o buffers.png
      texbake preview scene.toml --view turntable:36 -o frames/
    """
)
@click.argument("input", type=FileOf((*MESH_SUFFIXES, ".toml")), metavar="MESH|SCENE.toml")
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    metavar="FILE|DIR",
    help=f"The picture ({', '.join(name[1:] for name in IMAGE_SUFFIXES)}); a folder for a "
    "turntable.",
)
@image_option("--normal-map", "Normals, in tangent, object or world space.")
@image_option("--displacement", "Heights; the mesh is cut into small triangles and moved by them.")
@image_option("--albedo", "Colors.")
@picture_changes
@choice_option(
    "--edges", EDGES, RenderOptions.edges, "Shade a pixel once inside a triangle, or every sample."
)
@number_option(
    "--max-error",
    str,
    RenderOptions.max_error,
    "E",
    "Sample pixels adaptively, until each is estimated to be off by at most so much from black to "
    "white in sRGB: 2/255, or 0.01.",
)
@number_option(
    "--time-budget",
    str,
    RenderOptions.time_budget,
    "T",
    "Pick the least such error that is predicted to be drawn in 20s, 2min, ...; a short probe "
    "tells how long it takes.",
)
@click.option(
    "--filter",
    "filters",
    type=Names(FILTERS),
    default=(),
    help=f"Filter of all images: {', '.join(FILTERS)}. Several are laid side by side.  "
    "[default: each image's own]",
)
@click.option(
    "--interpolation",
    "interpolations",
    type=Names(INTERPOLATIONS),
    default=(),
    help=f"{', '.join(INTERPOLATIONS)}. Several are laid side by side.  "
    f"[default: {RenderOptions.interpolation}]",
)
@click.option(
    "--affine-vs-perspective",
    is_flag=True,
    help=f"The same as --interpolation {','.join(_AFFINE_VS_PERSPECTIVE)}.",
)
@click.option(
    "--buffer",
    "buffers",
    type=Names(BUFFERS),
    default=(),
    help=f"Show the inside instead: {', '.join(BUFFERS)}. Several are laid side by side.",
)
@click.option(
    "--explain",
    is_flag=False,
    flag_value="table",
    type=click.Choice(("table", "json")),
    metavar="[table|json]",
    help="Print which passes were run, what called for them and what they took, and what was left "
    "out and why.",
)
@click.option("--plan-only", is_flag=True, help="Print the passes and draw nothing.")
@report_option
@threads_option
@terminal_options
def preview(
    input: Path,  # noqa: A002  # what the help calls it
    output: Path | None,
    normal_map: Path | None,
    displacement: Path | None,
    albedo: Path | None,
    picture: dict[str, Any],
    threads: int | None,
    terminal: Terminal,
    **choices: Any,
) -> None:
    """Draw a mesh with its maps, or a scene.

    A normal map says in its file which space and convention it has; one that does not is taken for
    tangent space and OpenGL. Heights are decoded by what their file says, or are model units. A
    glTF file is drawn with its own materials. A scene file says itself how it is drawn; options
    given here stand above that.
    """
    report: Path | None = choices["report"]
    turn = picture.pop("view") if isinstance(picture.get("view"), Turntable) else None
    inputs = [input, normal_map, displacement, albedo]
    if turn is not None:
        _check_one_way(choices)
    _check_outputs(output, report, inputs, turn=turn, plan_only=choices["plan_only"])
    import texbake
    from texbake.jobs.preview import open_preview

    _take_targets(picture, choices, turn)
    with terminal.progress() as progress:
        scene, options = open_preview(
            input,
            normal_map=normal_map,
            displacement=displacement,
            albedo=albedo,
            options=picture,
            progress=progress,
        )
        written = [] if choices["plan_only"] else _pictures(output, turn)
        check_distinct([*written, report], scene.files)
        ways = _ways(options, choices)
        if choices["plan_only"]:
            plan = texbake.plan_scene(scene, ways[0][1])
            _tell(plan, None, choices["explain"] or "table", report)
            return
        assert output is not None
        if turn is not None:
            frame = _write_turn(scene, ways[0][1], turn.n_views, output, threads, progress)
        else:
            frame = _write_picture(scene, ways, output, threads, progress)
    for note in scene.notes:
        terminal.warn(f"{input}: {note}")
    if choices["explain"] is not None or report is not None:
        _tell(frame.plan, frame.costs, choices["explain"], report, frame)
    for part in frame.sampling, frame.budget:
        if part is not None:
            for warning in part.warnings:
                terminal.warn(warning)
            terminal.summary(part.table())
    terminal.wrote([output] if report is None else [output, report])


def _given(name: str) -> bool:
    """Whether an option of this command was given."""
    source = click.get_current_context().get_parameter_source(name)
    return source not in (ParameterSource.DEFAULT, None)


def _take_targets(picture: dict[str, Any], choices: dict[str, Any], turn: Turntable | None) -> None:
    """Note which edges, and which error or time, are asked for."""
    if _given("edges"):
        picture["edges"] = choices["edges"]
    asked = {name: choices[name] for name in _TARGETS if choices[name] is not None}
    if not asked:
        return
    flag = f"--{next(iter(asked)).replace('_', '-')}"
    for name in "supersampling", "edges":
        if name in picture:
            raise click.UsageError(f"--{name} leaves {flag} nothing to choose; give one of them.")
    if "time_budget" in asked and (turn is not None or _names_several(choices)):
        raise click.UsageError("--time-budget is of one picture; give several a --max-error.")
    picture |= asked


def _names_several(choices: dict[str, Any]) -> bool:
    """Whether pictures are to be laid side by side."""
    several = any(len(choices[name]) > 1 for name in ("filters", "interpolations", "buffers"))
    return several or bool(choices["affine_vs_perspective"])


def _check_one_way(choices: dict[str, Any]) -> None:
    """Refuse several ways to draw a turn, of which only the first would be drawn."""
    if _names_several(choices):
        raise click.UsageError(
            "A turntable is drawn in one way: name one filter, interpolation and buffer."
        )


def _check_outputs(
    output: Path | None,
    report: Path | None,
    inputs: list[Path | None],
    *,
    turn: Turntable | None,
    plan_only: bool,
) -> None:
    check_distinct([output, report], inputs)
    check_report(report)
    if plan_only:
        return
    if output is None:
        raise click.UsageError("Missing option '-o' / '--output'.")
    if turn is None:
        check_picture(output)
    else:
        check_folder(output)


def _pictures(output: Path | None, turn: Turntable | None) -> list[Path | None]:
    """Return the files that are going to be written."""
    from texbake.jobs.preview import turntable_files

    return [output] if turn is None or output is None else [*turntable_files(output, turn.n_views)]


def _ways(options: RenderOptions, choices: dict[str, Any]) -> list[tuple[str, RenderOptions]]:
    """Options of each picture, with its caption; several are laid side by side."""
    from texbake.jobs.preview import side_by_side_options

    interpolations = choices["interpolations"]
    if choices["affine_vs_perspective"]:
        if interpolations:
            raise click.UsageError("--affine-vs-perspective names the interpolations already.")
        interpolations = _AFFINE_VS_PERSPECTIVE
    return side_by_side_options(
        options,
        filters=choices["filters"],
        interpolations=interpolations,
        buffers=choices["buffers"],
    )


def _write_picture(
    scene: Scene,
    ways: list[tuple[str, RenderOptions]],
    output: Path,
    threads: int | None,
    progress: ProgressSink | None,
) -> Frame:
    """Write one picture, or several side by side; return the first."""
    import texbake
    from texbake.jobs.preview import render_side_by_side

    if len(ways) == 1:
        frame = texbake.render_scene(scene, ways[0][1], threads=threads, progress=progress)
        frame.write(output, threads=threads)
        return frame
    color, frames = render_side_by_side(scene, ways, threads=threads, progress=progress)
    texbake.write_image(color, output, color=True, threads=threads)
    return frames[0]


def _write_turn(
    scene: Scene,
    options: RenderOptions,
    n_views: int,
    output: Path,
    threads: int | None,
    progress: ProgressSink | None,
) -> Frame:
    """Write the pictures of a turn into a folder; return the last."""
    from texbake.jobs.preview import write_turntable

    return write_turntable(scene, options, n_views, output, threads=threads, progress=progress)


def _tell(
    plan: Plan,
    costs: Costs | None,
    form: str | None,
    report: Path | None,
    frame: Frame | None = None,
) -> None:
    """Print the plan, and write it as JSON with what samples reached, where it is asked for."""
    from texbake.rendering.plan.explain import plan_report, plan_table

    told = plan_report(plan, costs) | ({} if frame is None else frame.sampling_report())
    if report is not None:
        from texbake.jobs.outputs import write_report

        write_report(report, told)
    if form == "json":
        say(json.dumps(told, indent=2))
    elif form == "table":
        rows, left_out = plan_table(plan, costs)
        columns(rows, numbers=0 if costs is None else 2)
        say("")
        columns([("left out", "because"), *left_out])
