"""Steps that make images: `bake`, `bake-texture`."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Any

from texbake.baking.options import BITS_OPTION, BakeOptions
from texbake.baking.texture.options import SolidOptions
from texbake.building.memory import maps_memory, texture_memory
from texbake.errors import OptionError, quoted
from texbake.schema import Option
from texbake.verbs.step import (
    FORMAT_OF_IMAGE,
    IMAGE_FORMATS,
    Job,
    Settings,
    StepKind,
    check_format,
    stage_seconds,
    steady,
)
from texbake.verbs.verb import Reads


@dataclass(frozen=True, kw_only=True)
class BakeStep(BakeOptions):
    """How maps are baked; further attributes are those of `BakeOptions`.

    Attributes
    ----------
    format : str or dict of str to str
        Image format of all maps, or of each by its name; png for a map without one.
    """

    format: Any = "png"

    def __post_init__(self) -> None:
        super().__post_init__()
        formats = self.format if isinstance(self.format, dict) else {"": self.format}
        for name, value in formats.items():
            if name and name not in self.maps:
                raise OptionError(
                    f"format: {quoted(name)} is not one of the maps, {', '.join(self.maps)}"
                )
            check_format(value, IMAGE_FORMATS)


def _bake(job: Job) -> dict[str, Any]:
    from texbake.baking.bake import why_not_streamed
    from texbake.baking.maps import map_kinds
    from texbake.jobs.maps import bake_files
    from texbake.jobs.outputs import write_report

    options = BAKE.made(job.settings, threads=job.threads)
    # A limit changes no byte; some maps need the high-poly mesh as a whole.
    whole = why_not_streamed(map_kinds(options.maps), options) or job.input("high_texture")
    options = replace(options, max_memory=None if whole else job.most_memory)
    done = bake_files(
        job.file("high"),
        job.file("low"),
        {name: job.outputs[name] for name in job.settings["maps"]},
        options,
        cage=job.input("cage"),
        high_texture=job.input("high_texture"),
        miss_map=job.outputs["misses"],
    )
    report = done.to_json()
    for file in report["files"].values():
        file["path"] = file["path"].name  # the folder is a temporary one
    write_report(job.outputs["report"], steady(report))
    return {
        "faces": done.report.n_low_faces,
        "miss_percent": done.report.miss_percent,
        "texels_covered": done.report.texels_covered,
        "distance_percentiles": {str(k): v for k, v in done.report.distance_percentiles.items()},
        "notes": list(done.report.warnings),
        "stages": stage_seconds(done.report.stages),
    }


def _map_files(settings: Settings) -> dict[str, str]:
    formats = settings["format"]
    suffixes = {
        name: formats.get(name, "png") if isinstance(formats, dict) else formats
        for name in settings["maps"]
    }
    maps = {name: f"{name}.{suffix}" for name, suffix in suffixes.items()}
    return {**maps, "misses": "misses.png", "report": "report.json"}


BAKE = StepKind(
    name="bake",
    does="bakes maps of a high-poly mesh for a low-poly mesh",
    options=BakeStep,
    # What a time budget allows depends on the machine; the same inputs must give the same bytes.
    without=("threads", "max_memory", "keep_hits", "time_budget"),
    inputs=(
        Reads("high"),
        Reads("low"),
        Reads("cage", required=False),
        Reads("high_texture", required=False),
    ),
    outputs=_map_files,
    run=_bake,
    memory=maps_memory,
    revision=4,
)


@dataclass(frozen=True, kw_only=True)
class BakeTextureStep(SolidOptions):
    """How a texture is baked; further options are those of `SolidOptions`."""

    data: Annotated[bool, Option("Treat the values as data, such as roughness, not as colors.")] = (
        False
    )
    bits: Annotated[int | None, BITS_OPTION] = None
    format: Annotated[str, FORMAT_OF_IMAGE] = "png"


def _bake_texture(job: Job) -> dict[str, Any]:
    from texbake.jobs.textures import bake_texture_files

    options: BakeTextureStep = BAKE_TEXTURE.made(job.settings, threads=job.threads)
    done = bake_texture_files(
        job.file("mesh"), job.outputs["texture"], options, data=options.data, bits=options.bits
    )
    return {"notes": list(done.warnings)}


BAKE_TEXTURE = StepKind(
    name="bake-texture",
    does="bakes a procedure, such as marble, into a texture",
    options=BakeTextureStep,
    inputs=(Reads("mesh"),),
    outputs=lambda settings: {"texture": f"texture.{settings['format']}"},
    run=_bake_texture,
    memory=texture_memory,
)
