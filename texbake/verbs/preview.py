"""`preview`: draw a mesh with its maps, or a scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texbake.baking.memory import MB, PROCESS
from texbake.errors import OptionError
from texbake.files import PathLike, check_folder
from texbake.jobs.outputs import check_distinct, check_picture, present_paths
from texbake.rendering.options import RenderOptions
from texbake.schema import option_field
from texbake.verbs.compare import PictureSize, with_sides
from texbake.verbs.step import DECODED, READ_FACE, Job, Settings, Sizes, n_bytes, n_faces, step_of
from texbake.verbs.verb import REPORT, THREADS, Extra, Options, Reads, Writes, verb

if TYPE_CHECKING:
    from texbake.jobs.preview import PreviewFiles
    from texbake.progress import Progress
    from texbake.sampling.rounds import BudgetClock

# Maps in place of the materials of a file.
SHOWN = ("normal_map", "displacement", "albedo")
_SIDE_BY_SIDE = ("filter", "interpolation", "buffer", "mapping_order")
# Options of a picture that are not among those.
_PICTURE = ("up", "back_faces", "supersampling", "exposure", "edges", "max_error", "time_budget")
# The two that `--affine-vs-perspective` lays side by side.
_AFFINE_VS_PERSPECTIVE = ("affine", "perspective")
# Bytes per sample of a picture, and per triangle that displacement divides a mesh into.
_SAMPLE, _DIVIDED = 120, 150


def _variants_option(name: str) -> Extra:
    """Return an option of a picture that several pictures can differ by."""
    item = option_field(RenderOptions, name)
    words = item.option.choices
    return Extra(
        f"--{name.replace('_', '-')} {name}s",
        f"{item.option.help} Several are drawn side by side: {', '.join(words)}.  "
        f"[default: {item.option.default or item.default}]",
        names=words,
    )


def _picture_options(values: dict[str, Any]) -> dict[str, Any]:
    """Return the options of the picture that were given; the scene file determines the others."""
    rest = dict(values)
    view, explain = rest.pop("view"), rest.pop("explain")
    changes = {name: rest.pop(name) for name in ("size", *_PICTURE)}
    changes = {name: value for name, value in changes.items() if value is not None}
    n_views = view if isinstance(view, int) else None
    if view is not None and n_views is None:
        changes["view"] = view
    several = {name: rest.pop(f"{name}s") for name in _SIDE_BY_SIDE}
    if rest.pop("affine_vs_perspective"):
        if several["interpolation"]:
            raise OptionError("affine_vs_perspective: it names the interpolations already")
        several["interpolation"] = _AFFINE_VS_PERSPECTIVE
    if rest.pop("plan_only"):
        rest["output"] = None
    elif rest["output"] is None:
        raise OptionError("output: it is missing; name the picture, or use `plan_only`")
    for target in [name for name in ("max_error", "time_budget") if name in changes][:1]:
        for name in "supersampling", "edges":
            if name in changes:
                raise OptionError(f"{name}: it leaves `{target}` nothing to choose; leave one out")
    return {
        **rest,
        "options": with_sides(changes) if "size" in changes else changes,
        "side_by_side": several,
        "n_views": n_views,
        "contributions": explain == "changes",
    }


@verb(
    Reads("input", "shown", metavar="MESH|SCENE.toml"),
    Writes(
        "output",
        "images",
        "The picture (exr, hdr, jpg, jpeg, png, ppm, tga, tif, tiff), or a folder for a turntable.",
        required=False,
        metavar="FILE|DIR",
    ),
    Reads("normal_map", "image", "Normal map, in tangent, object or world space.", required=False),
    Extra(
        "--space",
        "Space of the normal map.  [default: what its file says, else tangent]",
        choices=("tangent", "object", "world"),
    ),
    Reads(
        "displacement", "image", "Height map; the mesh is subdivided and moved by it.",
        required=False,
    ),
    Reads("albedo", "image", "Color map.", required=False),
    Options(PictureSize, apart=True, only_given=True),
    Extra(
        "--view",
        f"{option_field(RenderOptions, 'view').option.help.rstrip('.')}; or a whole turn of N "
        "pictures.  [default: {:g},{:g}]".format(*RenderOptions.view),
        is_view=True,
    ),
    Options(RenderOptions, *_PICTURE, apart=True, only_given=True),
    _variants_option("filter"),
    _variants_option("interpolation"),
    Extra(
        "--affine-vs-perspective",
        f"The same as --interpolation {','.join(_AFFINE_VS_PERSPECTIVE)}.",
        is_flag=True,
    ),
    _variants_option("buffer"),
    _variants_option("mapping_order"),
    Extra(
        "--explain",
        "Print which passes ran, why, and how long they took, and which were left out and why; "
        "changes: draw the picture again without each effect, and print how many pixels it "
        "changes.",
        choices=("table", "json", "changes"),
        is_flag=False,
        flag_value="table",
        metavar="[table|json|changes]",
    ),
    Extra("--plan-only", "Print the passes and draw nothing.", is_flag=True),
    REPORT,
    Writes(
        "html", "page",
        "Also write an HTML page with the picture and what each effect contributes to it.",
    ),
    THREADS,
    examples="""
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
    """,
    prepare=_picture_options,
)  # fmt: skip
def preview_files(
    input: PathLike,  # noqa: A002  # what the help calls it
    output: PathLike | None,
    options: Mapping[str, Any] | None = None,
    *,
    normal_map: PathLike | None = None,
    displacement: PathLike | None = None,
    albedo: PathLike | None = None,
    space: str | None = None,
    own_materials: bool = True,
    side_by_side: Mapping[str, Sequence[str]] | None = None,
    n_views: int | None = None,
    contributions: bool = False,
    report: PathLike | None = None,
    html: PathLike | None = None,
    command: str = "",
    threads: int | None = None,
    progress: Progress = None,
    clock: BudgetClock | None = None,
) -> PreviewFiles:
    """Draw a mesh with its maps, or a scene.

    A normal map whose file does not say its space and convention is read as tangent space, OpenGL.
    Heights are decoded by the metadata of their file, or are in model units. A glTF file is drawn
    with its own materials. A scene file says how it is drawn; options given here take precedence.
    """
    from texbake.jobs.preview import draw_preview, side_by_side_options, turntable_files
    from texbake.jobs.preview_scene import default_view, open_preview
    from texbake.sampling.rounds import BudgetClock

    clock, choices = clock or BudgetClock(), side_by_side or {}
    is_several = any(len(words) > 1 for words in choices.values())
    if n_views is not None and is_several:
        raise OptionError(
            "view: a turntable has one filter, interpolation, buffer and mapping order; name one "
            "of each"
        )
    is_one = output is not None and n_views is None and not is_several
    if (options or {}).get("time_budget") is not None and output is not None and not is_one:
        raise OptionError("time_budget: it is for one picture; give several a `max_error`")
    if (contributions or html is not None) and not is_one:
        raise OptionError("contributions: they are those of one picture; draw one")
    if output is not None:
        (check_picture if n_views is None else check_folder)(output)
    files = {"normal_map": normal_map, "displacement": displacement, "albedo": albedo}
    maps = {name: file for name, file in files.items() if file is not None}
    scene, chosen = open_preview(
        input, options, maps=maps, space=space, own_materials=own_materials, progress=progress
    )
    pictures = present_paths(output)
    if output is not None and n_views is not None:
        pictures = tuple(turntable_files(output, n_views))
    check_distinct([*pictures, report, html], scene.files)
    view = default_view(input, scene, chosen)
    variants = side_by_side_options(view.options, choices)
    result = draw_preview(
        view, variants, output, n_views, contributions=contributions or html is not None,
        normal_map=normal_map, space=space, threads=threads, progress=progress, clock=clock,
    )  # fmt: skip
    if html is not None and result.report is not None:
        # Imported here, so that other pictures do not load what pages need.
        from texbake.pages.picture_pages import write_contributions_page

        name = Path(input).name
        write_contributions_page(html, name, result.report, result.contributions, command)
    return replace(result, files=present_paths(output, html))


def _step(job: Job) -> dict[str, Any]:
    preview_files(
        job.file("mesh"),
        job.outputs["picture"],
        vars(PREVIEW.made(job.settings)),
        normal_map=job.input("normal_map"),
        displacement=job.input("displacement"),
        albedo=job.input("albedo"),
        own_materials=False,
        threads=job.threads,
    )
    return {}


def _memory(settings: Settings, sizes: Sizes) -> int:
    """Estimate for a picture of a mesh with its maps."""
    samples = settings["width"] * settings["height"] * settings["supersampling"] ** 2
    divided = _DIVIDED * settings["max_triangles"] if sizes.get("displacement") else 0
    images = DECODED * n_bytes(sizes, *SHOWN)
    mesh = READ_FACE * n_faces(sizes, "mesh")
    return int(PROCESS + 64 * MB + _SAMPLE * samples + mesh + images + divided)


PREVIEW = step_of(
    preview_files,
    does="draws a mesh with its maps",
    options=RenderOptions,
    without=("time_budget",),
    inputs=(Reads("mesh"), *(Reads(name, required=False) for name in SHOWN)),
    outputs=lambda settings: {"picture": "preview.png"},
    run=_step,
    memory=_memory,
)
