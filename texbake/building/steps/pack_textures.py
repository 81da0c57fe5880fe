"""Several images in one, and meshes whose coordinates move with their image."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from texbake.building.memory import (
    IDLE_WORKER,
    MB,
    READ_FACE,
    faces_of,
)
from texbake.building.step import (
    InputRole,
    Job,
    Settings,
    Sizes,
    StepKind,
)
from texbake.building.steps.formats import IMAGE_FORMATS, MESH_FORMATS, check_format
from texbake.errors import OptionError
from texbake.texture.pack_options import PackOptions

# Floats that a byte of a compressed image may become.
_INFLATED = 40


@dataclass(frozen=True, kw_only=True)
class PackTexturesStep(PackOptions):
    """How images are packed; further attributes are those of `PackOptions`.

    Attributes
    ----------
    data : bool
        The images hold data and not colors.
    format, mesh_format : str
    meshes : int
        How many meshes move with the images: none, or one for each.
    """

    data: bool = False
    format: str = "png"
    mesh_format: str = "obj"
    meshes: int = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        check_format(self.format, IMAGE_FORMATS)
        check_format(self.mesh_format, MESH_FORMATS)


def _run(job: Job) -> dict[str, Any]:
    from texbake.mesh.files import read_mesh, write_mesh
    from texbake.texture.image import read_image, write_image
    from texbake.texture.image_files import bits_for
    from texbake.texture.pack import pack_textures

    options: PackTexturesStep = PACK_TEXTURES.made(job.settings)
    files, meshes = job.inputs["images"], job.inputs.get("mesh", ())
    if meshes and len(meshes) != len(files):
        raise OptionError(
            f"mesh: {len(meshes)} are given for {len(files)} images; give one for each, in order"
        )
    images = [read_image(path, color=not options.data, threads=job.threads) for path in files]
    packed = pack_textures([image.pixels for image in images], options)
    texture = job.outputs["texture"]
    bits = bits_for(texture, packed.pixels, max(images, key=lambda image: image.bits))
    write_image(packed.pixels, texture, color=not options.data, bits=bits, threads=job.threads)
    for index, path in enumerate(meshes):
        write_mesh(packed.remapped(read_mesh(path), index), job.outputs[f"mesh{index}"])
    return {"filled": packed.filled, "scale": packed.scale}


def _outputs(settings: Settings) -> dict[str, str]:
    suffix = settings["mesh_format"]
    meshes = {f"mesh{i}": f"mesh{i}.{suffix}" for i in range(settings["meshes"])}
    return {"texture": f"texture.{settings['format']}", **meshes}


def _check(settings: Settings, roles: frozenset[str]) -> None:
    if ("mesh" in roles) != (settings["meshes"] > 0):
        raise OptionError("meshes: it is the number of names in mesh; give both or neither")


def _memory(settings: Settings, sizes: Sizes) -> int:
    pixels = sum(_INFLATED * size.n_bytes for size in sizes.get("images", ()))
    return IDLE_WORKER + 64 * MB + 2 * pixels + READ_FACE * faces_of(sizes, "mesh")


PACK_TEXTURES = StepKind(
    name="pack-textures",
    does="puts several images into one, and moves their meshes' coordinates",
    options=PackTexturesStep,
    inputs=(InputRole(name="images", many=True), InputRole(name="mesh", required=False, many=True)),
    outputs=_outputs,
    run=_run,
    memory=_memory,
    check=_check,
)
