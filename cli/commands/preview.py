"""`texbake preview`: render a mesh or a scene."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from texbake import RenderOptions
from texbake.schema import option_field

from ..messages import command_line
from ..options import (
    IMAGE_SUFFIXES,
    MESH_SUFFIXES,
    Decorator,
    image_option,
    options_of,
    output_option,
    picture_changes,
    report_option,
    threads_option,
)
from ..terminal import Terminal, columns, say, terminal_options
from ..types import FileOf, Names, Turntable

if TYPE_CHECKING:
    from texbake.jobs.preview import PreviewFiles

_SIDE_BY_SIDE = ("filters", "interpolations", "buffers", "mapping_orders")
_TARGETS = ("max_error", "time_budget")
# Of normal maps.
_SPACES = ("tangent", "object", "world")
# The two that `--affine-vs-perspective` lays side by side.
_AFFINE_VS_PERSPECTIVE = ("affine", "perspective")


def _side_by_side(name: str, parameter: str) -> Decorator[Any]:
    """Add an option of a picture that several pictures can differ by."""
    field = option_field(RenderOptions, name)
    words = field.option.choices
    return click.option(
        f"--{name.replace('_', '-')}",
        parameter,
        type=Names(words),
        default=(),
        help=f"{field.option.help} Several are drawn side by side: {', '.join(words)}.  "
        f"[default: {field.option.default or field.default}]",
    )


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
@output_option(
    click.Path(path_type=Path),
    "FILE|DIR",
    f"The picture ({', '.join(name[1:] for name in IMAGE_SUFFIXES)}), or a folder for a turntable.",
)
@image_option("--normal-map", "Normal map, in tangent, object or world space.")
@click.option(
    "--space",
    type=click.Choice(_SPACES),
    help="Space of the normal map.  [default: what its file says, else tangent]",
)
@image_option("--displacement", "Height map; the mesh is subdivided and moved by it.")
@image_option("--albedo", "Color map.")
@picture_changes
@options_of(RenderOptions, "exposure", "edges", "max_error", "time_budget")
@_side_by_side("filter", "filters")
@_side_by_side("interpolation", "interpolations")
@click.option(
    "--affine-vs-perspective",
    is_flag=True,
    help=f"The same as --interpolation {','.join(_AFFINE_VS_PERSPECTIVE)}.",
)
@_side_by_side("buffer", "buffers")
@_side_by_side("mapping_order", "mapping_orders")
@click.option(
    "--explain",
    is_flag=False,
    flag_value="table",
    type=click.Choice(("table", "json", "changes")),
    metavar="[table|json|changes]",
    help="Print which passes ran, why, and how long they took, and which were left out and why; "
    "changes: draw the picture again without each effect, and print how many pixels it changes.",
)
@click.option("--plan-only", is_flag=True, help="Print the passes and draw nothing.")
@report_option
@click.option(
    "--html",
    type=FileOf((".html",)),
    metavar="FILE.html",
    help="Also write an HTML page with the picture and what each effect contributes to it.",
)
@threads_option
@terminal_options
def preview(
    input: Path,  # noqa: A002  # what the help calls it
    output: Path | None,
    normal_map: Path | None,
    space: str | None,
    displacement: Path | None,
    albedo: Path | None,
    picture: dict[str, Any],
    threads: int | None,
    terminal: Terminal,
    **choices: Any,
) -> None:
    """Draw a mesh with its maps, or a scene.

    A normal map whose file does not say its space and convention is read as tangent space, OpenGL.
    Heights are decoded by the metadata of their file, or are in model units. A glTF file is drawn
    with its own materials. A scene file says how it is drawn; options given here take precedence.
    """
    view = picture.get("view")
    n_views = view.n_views if isinstance(view, Turntable) else None
    if n_views is not None:
        del picture["view"]
        _check_single(choices)
    if output is None and not choices["plan_only"]:
        raise click.UsageError("Missing option '-o' / '--output'.")
    _take_targets(picture, choices, n_views)
    from texbake.jobs.preview import preview_files
    from texbake.jobs.preview_scene import MeshMaps

    maps = MeshMaps(normal_map=normal_map, displacement=displacement, albedo=albedo, space=space)
    side_by_side = {name.removesuffix("s"): choices[name] for name in _SIDE_BY_SIDE}
    side_by_side["interpolation"] = _interpolations(choices)
    with terminal.progress() as progress:
        done = preview_files(
            input,
            None if choices["plan_only"] else output,
            picture,
            maps=maps,
            side_by_side=side_by_side,
            n_views=n_views,
            contributions=choices["explain"] == "changes",
            report=choices["report"],
            html=choices["html"],
            command=command_line(),
            threads=threads,
            progress=progress,
            clock=terminal.clock(),
        )
    for warning in done.warnings:
        terminal.warn(warning)
    explain = choices["explain"] or ("table" if choices["plan_only"] else None)
    if explain is not None:
        _print_plan(done, explain)
    terminal.summary(done.table())
    if not choices["plan_only"]:
        terminal.wrote(done.files)


def _given(name: str) -> bool:
    """Whether an option of this command was given."""
    source = click.get_current_context().get_parameter_source(name)
    return source not in (ParameterSource.DEFAULT, None)


def _take_targets(picture: dict[str, Any], choices: dict[str, Any], n_views: int | None) -> None:
    """Move the options of adaptive sampling and exposure to the options of the picture."""
    picture |= {name: choices[name] for name in ("edges", "exposure") if _given(name)}
    targets = {name: choices[name] for name in _TARGETS if choices[name] is not None}
    if not targets:
        return
    flag = f"--{next(iter(targets)).replace('_', '-')}"
    for name in "supersampling", "edges":
        if name in picture:
            raise click.UsageError(f"--{name} leaves {flag} nothing to choose; give one of them.")
    if "time_budget" in targets and (n_views is not None or _is_several(choices)):
        raise click.UsageError("--time-budget is for one picture; give several a --max-error.")
    picture |= targets


def _is_several(choices: dict[str, Any]) -> bool:
    """Whether pictures are put side by side."""
    several = any(len(choices[name]) > 1 for name in _SIDE_BY_SIDE)
    return several or bool(choices["affine_vs_perspective"])


def _check_single(choices: dict[str, Any]) -> None:
    if _is_several(choices):
        raise click.UsageError(
            "A turntable has one filter, interpolation, buffer and mapping order; name one of each."
        )


def _interpolations(choices: dict[str, Any]) -> tuple[str, ...]:
    if not choices["affine_vs_perspective"]:
        return tuple(choices["interpolations"])
    if choices["interpolations"]:
        raise click.UsageError("--affine-vs-perspective names the interpolations already.")
    return _AFFINE_VS_PERSPECTIVE


def _print_plan(done: PreviewFiles, form: str) -> None:
    """Print which passes were chosen, and what was left out; or what each changes."""
    if form == "changes":
        columns(done.contributions_table(), numbers=5)
        return
    if form == "json":
        say(json.dumps(done.to_json(), indent=2))
        return
    rows, left_out = done.plan_tables()
    columns(rows, numbers=0 if done.costs is None else 2)
    say("")
    columns([("left out", "because"), *left_out])
