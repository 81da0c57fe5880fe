"""`run`, `lighten` and `demo`: from a high-poly mesh or a model to a finished asset in one command.

The work itself is in `texbake.jobs`.
"""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any

from texbake.baking.memory import PROCESS, bake_memory
from texbake.errors import OptionError
from texbake.files import PathLike
from texbake.jobs.lighten_options import LightenOptions
from texbake.jobs.options import DEMO_FOLDER, DemoOptions, RunOptions, with_levels
from texbake.records import dataclass
from texbake.schema import option, option_of
from texbake.verbs.step import (
    Job,
    Settings,
    Sizes,
    n_faces,
    stage_seconds,
    step_of,
    without_timings,
)
from texbake.verbs.verb import PAGE, REPORT, Options, Reads, Writes, verb

if TYPE_CHECKING:
    from texbake.jobs.lighten import LightenReport
    from texbake.jobs.outputs import JobResult
    from texbake.jobs.run import RunResult
    from texbake.progress import Progress

_FOLDER = "Folder for the files, which is made if it is missing."


@verb(
    Reads("high"),
    Writes("output", "folder", _FOLDER),
    Options(RunOptions, without=("base_color",), defaults={"n_faces": None}),
    PAGE,
    examples="""
      texbake run scan.ply -o asset --faces 500 --size 2048
      texbake run scan.ply -o asset --faces 2000 --quality best --convention directx
      texbake run scan.ply -o asset --error 0.5%
      texbake run scan.ply -o asset --faces 2000 --preset unreal --maps ao --levels 500,120
      texbake run scan.ply -o asset --faces 500 --max-error 0.5deg,0.01%
    """,
    table=lambda result: result.table(),
)
def run_files(
    high: PathLike,
    output: PathLike,
    options: RunOptions | None = None,
    *,
    html: PathLike | None = None,
    command: str = "",
    progress: Progress = None,
) -> RunResult:
    """Do the whole job: from HIGH to a finished asset.

    Simplifies, unwraps, bakes and compares: the asset is a low-poly mesh with maps. A mesh
    scan.ply gives scan_low.obj, scan_low.glb, scan_normal.png, scan_displacement.exr,
    scan_preview.png, scan_compare.png and scan_report.json.

    By default, maps have 2048 x 2048 texels with four rays each, as a finished asset needs.
    texbake bake casts a sixteenth as many by default, which is enough to try options. With
    --preset, the files have the names, formats and codings that a program expects, and SETTINGS.txt
    says what to set there.
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


@dataclass(frozen=True, kw_only=True)
class RunStep(RunOptions):
    """How a finished asset is made from a high-poly mesh."""

    faces: Annotated[int | None, option_of(RunOptions, "n_faces")] = None
    images: tuple[str, ...] | None = option(
        None,
        "Images of the materials of HIGH, for a program whose mesh files do not contain them.",
        choices=("base_color", "orm", "emissive", "clearcoat", "transmission", "sheen", "specular"),
        metavar="NAME,...",
        default="none",
    )

    def __post_init__(self) -> None:
        if self.faces is None and self.error is None:
            raise OptionError("faces, error: neither is given; give one of them, or both")
        object.__setattr__(self, "n_faces", self.faces)
        super().__post_init__()
        if self.images and self.target.embeds:
            raise OptionError("images: the GLB file contains them; leave this key out")

    def names_of_levels(
        self, asset: str, images: Sequence[str] | None = None
    ) -> list[dict[str, str]]:
        """Return the names of the files, given the images that the materials have."""
        own = self.images or ()
        if images is not None and not self.target.embeds and set(images) != set(own):
            names = list(images)
            raise OptionError(
                f"images: {self.target.title} takes the materials of this mesh as images; name "
                f"them with: images = {names}"
            )
        return super().names_of_levels(asset, images or own)


def _run_files(settings: Settings) -> dict[str, str]:
    """Return the files of a run by its keys."""
    options: RunStep = RUN.made(settings)
    first, *others = options.names_of_levels("asset")
    first.pop("settings", None)  # it names the files of a folder, and these have other names
    return with_levels(first, others)


def _run_step(job: Job) -> dict[str, Any]:
    from texbake.files import scratch_folder
    from texbake.jobs.outputs import write_report

    with scratch_folder() as folder:
        result = run_files(job.file("high"), folder, RUN.made(job.settings, threads=job.threads))
        for key, path in job.outputs.items():
            if key != "report":
                shutil.copyfile(result.files[key], path)
    figures = result.to_json()
    figures["files"] = {key: path.name for key, path in job.outputs.items()}
    write_report(job.outputs["report"], without_timings(figures))
    baked, compared = result.baked.report, result.comparison
    return {
        "faces": result.low.n_faces,
        "levels": [level.mesh.n_faces for level in result.levels],
        "miss_percent": baked.miss_percent,
        "error_deg": None if compared is None else compared.mapped.mean_deg,
        "notes": result.warnings,
        "stages": stage_seconds(result.stages),
    }


def _run_memory(settings: Settings, sizes: Sizes) -> int:
    """Estimate: what simplifies the mesh and what bakes it, of which the larger one counts."""
    n_high = n_faces(sizes, "high")
    bake = RUN.made(settings).bake_options()
    n_texels = bake.width_px * bake.height_px
    return max(bake_memory(n_high, 1000, n_texels, bake.maps), PROCESS + 300 * n_high)


RUN = step_of(
    run_files,
    does="makes a low-poly mesh with maps, levels of detail and pictures from a high-poly mesh",
    options=RunStep,
    # What a time budget allows depends on the machine; the same inputs must give the same bytes.
    without=("threads", "n_faces", "time_budget", "base_color"),
    outputs=_run_files,
    run=_run_step,
    memory=_run_memory,
    revision=2,
)


@verb(
    Reads("model"),
    Writes("output", "image", "The lightened model.", suffixes=(".glb",)),
    Options(LightenOptions),
    REPORT,
    PAGE,
    examples="""
      texbake lighten model.glb -o light.glb --html light.html
      texbake lighten model.fbx -o light.glb --faces 5000 --size 1024
      texbake lighten model.glb -o light.glb --target-size 500kB
      texbake lighten model.glb -o light.glb --min-psnr 20
    """,
)
def lighten_file(
    model: PathLike,
    output: PathLike,
    options: LightenOptions | None = None,
    *,
    report: PathLike | None = None,
    html: PathLike | None = None,
    command: str = "",
    progress: Progress = None,
) -> JobResult[LightenReport]:
    """Make MODEL smaller, with all of its materials.

    MODEL is simplified. If its texture coordinates are an atlas, they stay, with the images of each
    material, and MODEL gets a new normal map. Otherwise, MODEL is unwrapped once, and every channel
    of its materials is baked into one set of images: base color and alpha, metallic, roughness,
    occlusion, emissive, normal, clearcoat, transmission, sheen, specular, thickness, iridescence
    and diffuse transmission. The new normal map includes the normal maps of MODEL.
    """
    from texbake.jobs.lighten import lighten

    return lighten(model, output, options or LightenOptions(), html, command, progress)


@verb(
    Writes("output", "folder", _FOLDER, default=DEMO_FOLDER),
    Options(DemoOptions),
    PAGE,
    examples="""
      texbake demo
      texbake demo -o orange --triangles 4000000
      texbake demo --html orange.html
    """,
    table=lambda result: result.table(),
)
def demo_files(
    output: PathLike = DEMO_FOLDER,
    options: DemoOptions | None = None,
    *,
    html: PathLike | None = None,
    command: str = "",
    progress: Progress = None,
) -> RunResult:
    """Do the whole job on an orange that is made by code.

    Also writes the high-poly mesh, orange_high.ply, to try other commands on. The page of --html
    also has plots of how right a photograph, a bump map, a normal map and a displacement map stay
    while the light and the viewer turn.
    """
    from texbake.files import make_folder
    from texbake.jobs.run import run, with_page
    from texbake.mesh.files import write_mesh
    from texbake.mesh.shapes import orange
    from texbake.progress import Stages

    options = options or DemoOptions()
    high_file = make_folder(output) / "orange_high.ply"
    stages = Stages(progress)
    with stages.stage("make the orange"):
        high = orange(options.triangles)
        write_mesh(high, high_file)
    result = run(high, output, options.run_options(), progress=progress)
    result = replace(
        result, files={"high": high_file, **result.files}, stages=[*stages.records, *result.stages]
    )
    if html is None:
        return result
    from texbake.jobs.orange_turns import turns_plot

    plot = turns_plot(options.threads, progress)
    return with_page(result, html, options.run_options(), command=command, plots=[plot])
