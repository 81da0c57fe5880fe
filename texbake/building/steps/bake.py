"""A dense and a light mesh to maps, by one trace."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from texbake.baking.map_names import MAP_NAMES
from texbake.baking.memory import bake_memory
from texbake.baking.options import BakeOptions
from texbake.building.memory import faces_of
from texbake.building.step import (
    InputRole,
    Job,
    Settings,
    Sizes,
    StepKind,
)
from texbake.building.steps.figures import stage_seconds, steady
from texbake.building.steps.formats import IMAGE_FORMATS, check_format
from texbake.errors import OptionError

# Maps that are made of the dense mesh's materials.
OF_MATERIALS = frozenset({"texture", "material-id"})


@dataclass(frozen=True, kw_only=True)
class BakeStep(BakeOptions):
    """How maps are baked; further attributes are those of `BakeOptions`.

    Attributes
    ----------
    format : str or dict of str to str
        Of all maps, or of each by its name, png where it has none.
    """

    format: Any = "png"

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in self.maps:
            if name not in MAP_NAMES:
                raise OptionError(f"maps: {name!r} is not one of {', '.join(MAP_NAMES)}")
        formats = self.format if isinstance(self.format, dict) else {"": self.format}
        for name, value in formats.items():
            if name and name not in self.maps:
                raise OptionError(f"format: {name!r} is none of the maps, {', '.join(self.maps)}")
            check_format(value, IMAGE_FORMATS)


def _run(job: Job) -> dict[str, Any]:
    from texbake.baking.bake import bake
    from texbake.baking.maps import map_kinds
    from texbake.jobs.report import write_report
    from texbake.mesh.files import read_mesh
    from texbake.mesh.materials import Materials, read_materials
    from texbake.texture.image import write_image

    high, low = read_mesh(job.file("high")), read_mesh(job.file("low"))
    cage = job.input("cage")
    # The same bytes with a limit and without; some maps need the dense mesh as a whole.
    whole = any(kind.needs != "hits" for kind in map_kinds(job.settings["maps"]))
    limit = None if whole else job.most_memory
    options = BAKE.made(job.settings, threads=job.threads, max_memory=limit)
    materials, image = None, job.input("high_texture")
    if not OF_MATERIALS.isdisjoint(options.maps):
        path = job.file("high")
        materials = read_materials(path, high) if image is None else Materials.of_image(high, image)
    cage_mesh = None if cage is None else read_mesh(cage)
    result = bake(high, low, options, cage=cage_mesh, materials=materials)
    written = {name: result.maps[name].write(job.outputs[name]) for name in options.maps}
    report = result.report
    coded = {
        name: {**asdict(file), "path": file.path.name, "metadata": dict(file.metadata)}
        for name, file in written.items()
    }
    write_image(result.miss_map(), job.outputs["misses"])
    write_report(job.outputs["report"], steady({**report.to_json(), "files": coded}))
    return {
        "faces": low.n_faces,
        "miss_percent": report.miss_percent,
        "texels_covered": report.texels_covered,
        "distance_percentiles": {str(k): v for k, v in report.distance_percentiles.items()},
        "notes": report.warnings,
        "stages": stage_seconds(report.stages),
    }


def _outputs(settings: Settings) -> dict[str, str]:
    formats = settings["format"]
    suffixes = {
        name: formats.get(name, "png") if isinstance(formats, dict) else formats
        for name in settings["maps"]
    }
    maps = {name: f"{name}.{suffix}" for name, suffix in suffixes.items()}
    return {**maps, "misses": "misses.png", "report": "report.json"}


def _memory(settings: Settings, sizes: Sizes) -> int:
    side = settings["size"]
    texels = side[0] * side[1] if isinstance(side, list) else side * side
    light = faces_of(sizes, "low") + faces_of(sizes, "cage")
    return bake_memory(faces_of(sizes, "high"), light, texels, len(settings["maps"]))


BAKE = StepKind(
    name="bake",
    does="bakes maps of a dense mesh onto a light one",
    options=BakeStep,
    # What a time allows depends on the machine, and the same inputs must give the same bytes.
    without=("threads", "max_memory", "keep_hits", "time_budget"),
    inputs=(
        InputRole(name="high"),
        InputRole(name="low"),
        InputRole(name="cage", required=False),
        InputRole(name="high_texture", required=False),
    ),
    outputs=_outputs,
    run=_run,
    memory=_memory,
    revision=3,
)
