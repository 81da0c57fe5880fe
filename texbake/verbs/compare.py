"""`compare`: measure how closely a low-poly mesh with its maps resembles the high-poly mesh."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from texbake.files import PathLike
from texbake.jobs.outputs import JobResult, check_distinct, check_picture, present_paths
from texbake.records import dataclass
from texbake.rendering.options import RenderOptions
from texbake.schema import Option, Size
from texbake.verbs.verb import PAGE, REPORT, THREADS, Options, Reads, Writes, verb

if TYPE_CHECKING:
    from texbake.progress import Progress
    from texbake.rendering.compare import Comparison


@dataclass(frozen=True)
class PictureSize:
    """Width and height of `RenderOptions` in one option."""

    size: Annotated[Size, Option("Width and height of the picture in pixels.")] = (
        RenderOptions.width,
        RenderOptions.height,
    )


def with_sides(values: dict[str, Any]) -> dict[str, Any]:
    """Return values with width and height in place of the size."""
    rest = dict(values)
    size = rest.pop("size")
    width, height = (size, size) if isinstance(size, int) else size
    return {**rest, "width": width, "height": height}


@verb(
    Reads("high"),
    Reads("low"),
    Reads("normal_map", "image", "Normal map of LOW.", required=False),
    Reads("displacement", "image", "Height map of LOW.", required=False),
    Reads("albedo", "image", "Color map of LOW.", required=False),
    Writes(
        "output",
        "picture",
        "The pictures side by side.  [default: LOW's name and _compare.png, in this folder]",
        required=False,
        metavar="FILE",
    ),
    Options(PictureSize, apart=True),
    Options(RenderOptions, "view", "up", "back_faces", "supersampling"),
    REPORT,
    PAGE,
    THREADS,
    examples="""
      texbake compare scan.ply low.obj --normal-map normal.png
      texbake compare scan.ply low.obj --normal-map normal.png --view 90,10 -o side.png
    """,
    prepare=with_sides,
)
def compare_files(
    high: PathLike,
    low: PathLike,
    output: PathLike | None = None,
    options: RenderOptions | None = None,
    *,
    normal_map: PathLike | None = None,
    displacement: PathLike | None = None,
    albedo: PathLike | None = None,
    report: PathLike | None = None,
    html: PathLike | None = None,
    command: str = "",
    threads: int | None = None,
    progress: Progress = None,
) -> JobResult[Comparison]:
    """Measure how close LOW with its maps comes to HIGH.

    From six sides, prints the angle between the shading normals that pixels show, and the PSNR and
    SSIM of the pictures, for LOW with its maps and without them. If no maps are given, the
    materials in LOW's file are used. HIGH shows its own materials if LOW has a color map or
    materials; LOW without maps is measured against HIGH in gray. Writes HIGH, LOW without maps,
    LOW with its maps, and the difference, side by side.
    """
    from texbake.jobs.comparison import write_comparison_page
    from texbake.jobs.preview_scene import shown_materials
    from texbake.mesh.files import read_mesh
    from texbake.mesh.files.source import parsed_once
    from texbake.rendering.compare import compare
    from texbake.texture.image import write_image

    output = Path(f"{Path(low).stem}_compare.png" if output is None else output)
    maps = {"normal": normal_map, "displacement": displacement, "albedo": albedo}
    files = {name: path for name, path in maps.items() if path is not None}
    check_distinct([output, report, html], [high, low, *files.values()])
    check_picture(output)
    options = options or RenderOptions()
    with parsed_once():
        high_mesh, low_mesh = (read_mesh(path, progress=progress) for path in (high, low))
        high_materials = shown_materials(high, high_mesh)
        low_materials = None if files else shown_materials(low, low_mesh)
    comparison = compare(
        high_mesh,
        low_mesh,
        normal_map=normal_map,
        displacement=displacement,
        albedo=albedo,
        high_materials=high_materials,
        low_materials=low_materials,
        options=options,
        threads=threads,
        progress=progress,
    )
    write_image(comparison.side_by_side(), output, color=True, threads=threads)
    if html is not None:
        write_comparison_page(
            html, high_mesh, low_mesh, comparison, files=files, command=command, picture=options
        )
    return JobResult(files=present_paths(output, html), report=comparison)
