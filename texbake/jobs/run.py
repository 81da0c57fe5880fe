"""The whole job: a dense mesh to a light one with its maps, and what there is to see and know.

    high ─ simplify ─ unwrap ─► low.obj ─ bake ─► normal.png, displacement.exr ─► low.glb
      └───────────────────────────── compare ─► preview.png, compare.png ─► report.json

Every file appears whole and only when its stage has succeeded; what an earlier run left there is
kept until then.
"""

from __future__ import annotations

import tempfile
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from texbake.baking.bake import bake
from texbake.baking.result import BakeResult
from texbake.files import PathLike, check_writable, make_folder
from texbake.jobs.options import RunOptions
from texbake.jobs.report import comparison_report, comparison_table, write_report
from texbake.mapping.unwrap import unwrap_with_report
from texbake.mapping.unwrap_report import UnwrapReport
from texbake.mesh.files import write_mesh
from texbake.mesh.mesh import Mesh
from texbake.mesh.simplify import SimplifyReport, simplify_with_report
from texbake.progress import ProgressSink, StageRecord, Stages
from texbake.rendering.camera import Camera
from texbake.rendering.compare import Closeness, Comparison, compare
from texbake.rendering.panels import Panel, side_by_side
from texbake.rendering.render import render
from texbake.texture.encoding import decode_srgb
from texbake.texture.image import write_image

# What the files are called, after the name of the asset.
_NAMES = {
    "mesh": "_low.obj",
    "normal": "_normal.png",
    "displacement": "_displacement.exr",
    "glb": "_low.glb",
    "preview": "_preview.png",
    "compare": "_compare.png",
    "report": "_report.json",
}


@dataclass(frozen=True, kw_only=True, eq=False)
class RunResult:
    """Everything that `run` made.

    Attributes
    ----------
    files : dict of str to Path
        `mesh`, `normal`, `displacement`, `glb`, `preview`, `compare` and `report`.
    low : Mesh
        The light mesh, with texture coordinates.
    simplified : SimplifyReport
    unwrapped : UnwrapReport
    baked : BakeResult
    comparison : Comparison
    stages : list of StageRecord
        What the stages took, with writing their files.
    """

    files: dict[str, Path]
    low: Mesh
    simplified: SimplifyReport
    unwrapped: UnwrapReport
    baked: BakeResult
    comparison: Comparison
    stages: list[StageRecord] = field(default_factory=list)

    @property
    def warnings(self) -> list[str]:
        """What the user should look at, a sentence each."""
        return [*self.simplified.notes, *self.baked.report.warnings]

    def table(self) -> list[tuple[str, str]]:
        """Rows of a label and a figure, for a person: stages, and how close the result comes."""
        distance = self.simplified.distance
        return [
            ("Stages", ""),
            *((f"  {stage.name}", f"{stage.seconds:.2f} s") for stage in self.stages),
            ("  total", f"{sum(stage.seconds for stage in self.stages):.2f} s"),
            *_asked_for(self.baked),
            ("Closeness to the dense mesh", ""),
            (
                "  surface of the light mesh",
                f"off by RMS {100 * distance.rms_relative:.3f} %, "
                f"greatest {100 * distance.max_relative:.3f} % of the diagonal",
            ),
            *((f"  {label}", figures) for label, figures in comparison_table(self.comparison)),
        ]

    def to_json(self) -> dict[str, Any]:
        """Return every figure as plain values, for `json.dump`."""
        return {
            "files": {name: str(path) for name, path in self.files.items()},
            "stages": [asdict(stage) for stage in self.stages],
            "simplify": self.simplified.to_json(),
            "unwrap": self.unwrapped.to_json(),
            "bake": self.baked.report.to_json(),
            "compare": comparison_report(self.comparison),
        }


def run(
    high: Mesh,
    folder: PathLike,
    options: RunOptions | None = None,
    *,
    progress: ProgressSink | None = None,
) -> RunResult:
    """Make a light mesh with maps of a dense mesh, pictures of both, and a report.

    Parameters
    ----------
    high
        The dense mesh. The files are named after it: `scan.ply` gives `scan_low.obj` and so on.
    folder
        For the files; made if it is missing.
    options
        None for the defaults.
    progress
        Told of the stages.

    Raises
    ------
    FileError
        The folder cannot be made or written to; told before the work begins.
    UnwrapError
        No atlas could be made.
    """
    options = options or RunOptions()
    files = _files_in(folder, high)
    stages = Stages()
    with stages.part("simplify"):
        low, simplified = simplify_with_report(
            high,
            options.n_faces,
            quality=options.quality,
            threads=options.threads,
            progress=progress,
        )
    low = low.replace(name=files["mesh"].name)
    with stages.part("unwrap"):
        low, unwrapped = unwrap_with_report(
            low, options=options.unwrap_options(), progress=progress
        )
        write_mesh(low, files["mesh"])
    with stages.part("bake"):
        baked = bake(high, low, options.bake_options(), progress=progress)
    with stages.part("write maps"):
        _write_maps(baked, low, files, options, progress)
    with stages.part("compare"):
        comparison = _compared(high, low, files, options, progress)
    result = RunResult(
        files=files,
        low=low,
        simplified=simplified,
        unwrapped=unwrapped,
        baked=baked,
        comparison=comparison,
        stages=stages.records,
    )
    write_report(files["report"], result.to_json())
    return result


def _asked_for(baked: BakeResult) -> list[tuple[str, str]]:
    """Rows of what an error or a time that the bake was asked for has come to."""
    parts = [part for part in (baked.report.sampling, baked.report.budget) if part is not None]
    rows = [(f"  {label}", figures) for part in parts for label, figures in part.table()]
    return [("Samples of the maps", ""), *rows] if rows else []


def _files_in(folder: PathLike, high: Mesh) -> dict[str, Path]:
    folder = make_folder(folder)
    asset = Path(high.name).stem or "mesh"
    files = {name: folder / f"{asset}{ending}" for name, ending in _NAMES.items()}
    for path in files.values():
        check_writable(path)
    return files


def _write_maps(
    baked: BakeResult,
    low: Mesh,
    files: dict[str, Path],
    options: RunOptions,
    progress: ProgressSink | None,
) -> None:
    with Stages(progress).stage("write maps"):
        baked.maps["normal"].write(files["normal"])
        baked.maps["displacement"].write(files["displacement"])
        # glTF has +Y up whatever the user's other programs want, and its viewers keep 8 bits.
        with tempfile.TemporaryDirectory(prefix="texbake-") as folder:
            normal_map = Path(folder) / files["normal"].name
            baked.maps["normal"].write(normal_map, bits=8, convention="opengl")
            color = decode_srgb(np.array(options.base_color)).tolist()
            write_mesh(low, files["glb"], normal_map=normal_map, base_color=color)


def _compared(
    high: Mesh,
    low: Mesh,
    files: dict[str, Path],
    options: RunOptions,
    progress: ProgressSink | None,
) -> Comparison:
    """Compare with the maps as their files have them, and draw both pictures."""
    picture = options.render_options()
    comparison = compare(
        high,
        low,
        normal_map=files["normal"],
        displacement=files["displacement"],
        options=picture,
        threads=options.threads,
        progress=progress,
    )
    # What most viewers show: the light mesh's own shape under the dense mesh's normals.
    with_normals = render(
        low,
        normal_map=files["normal"],
        options=picture,
        camera=Camera.framing(high, low, options=picture),
        threads=options.threads,
        progress=progress,
    )
    dense, bare, displaced = (
        comparison.high_frame,
        comparison.bare_frame,
        comparison.mapped_frame,
    )
    high_name, low_name, _ = comparison.names
    panels = [
        Panel(dense.color, high_name, ""),
        Panel(bare.color, low_name, _off_by(comparison.bare)),
        Panel(with_normals.color, "... with its normal map", ""),
        Panel(displaced.color, "... and displaced as well", _off_by(comparison.mapped)),
    ]
    seen = np.logical_or.reduce([frame.coverage > 0 for frame in (dense, bare, displaced)])
    write_image(side_by_side(panels, seen), files["preview"], color=True)
    write_image(comparison.side_by_side(), files["compare"], color=True)
    return comparison


def _off_by(closeness: Closeness) -> str:
    return f"normals off by {closeness.mean_deg:.2f}° in the mean"
