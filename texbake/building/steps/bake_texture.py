"""A procedure over space to a texture of a mesh's own atlas."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from texbake.baking.texture.options import SolidOptions
from texbake.building.memory import (
    IDLE_WORKER,
    READ_FACE,
    TEXEL,
    faces_of,
)
from texbake.building.step import (
    InputRole,
    Job,
    Settings,
    Sizes,
    StepKind,
)
from texbake.building.steps.formats import IMAGE_FORMATS, check_format


@dataclass(frozen=True, kw_only=True)
class BakeTextureStep(SolidOptions):
    """How a texture is made; further attributes are those of `SolidOptions`.

    Attributes
    ----------
    data : bool
        The values are data, such as roughness, and not color.
    bits : int, optional
    format : str
    """

    data: bool = False
    bits: int | None = None
    format: str = "png"

    def __post_init__(self) -> None:
        super().__post_init__()
        check_format(self.format, IMAGE_FORMATS)


def _run(job: Job) -> dict[str, Any]:
    from texbake.baking.texture.solid import bake_solid
    from texbake.mesh.files import read_mesh

    options = BAKE_TEXTURE.made(job.settings, threads=job.threads)
    result = bake_solid(read_mesh(job.file("mesh")), options)
    result.write(job.outputs["texture"], color=not options.data, bits=options.bits)
    return {"notes": list(result.report.warnings)}


def _memory(settings: Settings, sizes: Sizes) -> int:
    side = settings["size"]
    texels = side[0] * side[1] if isinstance(side, list) else side * side
    mesh = READ_FACE * faces_of(sizes, "mesh")
    return int(IDLE_WORKER + mesh + TEXEL * texels)


BAKE_TEXTURE = StepKind(
    name="bake-texture",
    does="bakes a procedure, such as marble, into a texture",
    options=BakeTextureStep,
    inputs=(InputRole(name="mesh"),),
    outputs=lambda settings: {"texture": f"texture.{settings['format']}"},
    run=_run,
    memory=_memory,
)
