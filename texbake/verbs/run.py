"""`run`: simplify, unwrap, bake and compare in one command."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from texbake.files import PathLike
from texbake.jobs.options import RunOptions
from texbake.verbs.verb import PAGE, Options, Reads, Writes, verb

if TYPE_CHECKING:
    from texbake.jobs.run import RunResult
    from texbake.progress import ProgressSink


@verb(
    Reads("high"),
    Writes("output", "folder", "Folder for the files, which is made if it is missing."),
    Options(RunOptions, without=("base_color",), defaults={"n_faces": None}),
    PAGE,
    examples="""
      texbake run scan.ply -o asset --faces 500 --size 2048
      texbake run scan.ply -o asset --faces 2000 --quality best --convention directx
      texbake run scan.ply -o asset --error 0.5%
      texbake run scan.ply -o asset --faces 500 --max-error 0.5deg,0.01%
    """,
    table=lambda done: done.table(),
)
def run_files(
    high: PathLike,
    output: PathLike,
    options: RunOptions | None = None,
    *,
    html: PathLike | None = None,
    command: str = "",
    progress: ProgressSink | None = None,
) -> RunResult:
    """Do the whole job: from HIGH to a finished asset.

    Simplifies, unwraps, bakes and compares: the asset is a low-poly mesh with maps. A mesh
    scan.ply gives scan_low.obj, scan_low.glb, scan_normal.png, scan_displacement.exr,
    scan_preview.png, scan_compare.png and scan_report.json.

    By default, maps have 2048 x 2048 texels with four rays each, as a finished asset needs.
    texbake bake casts a sixteenth as many by default, which is enough to try options.
    """
    from texbake.jobs.material_transfer import compared_without, left_out
    from texbake.jobs.run import run, with_page
    from texbake.mesh.files import read_mesh
    from texbake.mesh.files.source import parsed_once
    from texbake.texture.model_materials import model_materials

    options = options or RunOptions()
    with parsed_once():
        mesh = read_mesh(high, progress=progress)
        materials = model_materials(high, mesh)
        without = left_out(high)
    result = run(mesh, output, options, materials=materials, progress=progress)
    result = replace(result, missing=(*without, *compared_without(high, materials)))
    return result if html is None else with_page(result, html, options, command=command)
