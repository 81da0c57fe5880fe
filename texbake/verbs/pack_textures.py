"""`pack-textures`: pack several images into one."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from texbake.baking.memory import MB, PROCESS
from texbake.errors import OptionError, counted
from texbake.files import PathLike, check_folder, make_folder
from texbake.jobs.outputs import JobResult, check_distinct, check_mesh
from texbake.records import dataclass
from texbake.schema import Option
from texbake.texture.options import PackOptions
from texbake.verbs.step import (
    DECODED,
    FORMAT_OF_IMAGE,
    FORMAT_OF_MESH,
    READ_FACE,
    Job,
    Settings,
    Sizes,
    n_bytes,
    n_faces,
    step_of,
)
from texbake.verbs.verb import THREADS, Extra, Options, Reads, Rows, Writes, paths_of, verb

if TYPE_CHECKING:
    from texbake.progress import Progress
    from texbake.texture.pack import PackedTextures


@dataclass(frozen=True, kw_only=True, eq=False)
class PackedFiles(JobResult["PackedTextures"]):
    """What `pack_textures_file` wrote; `images` are the names of the packed files."""

    images: tuple[str, ...]


def _table(result: PackedFiles) -> Rows:
    packed: PackedTextures = result.report
    height, width = packed.pixels.shape[:2]
    return [
        ("size", f"{width} x {height}, {100 * packed.filled:.1f} % filled"),
        *(
            (f"  {name}", f"{place.width} x {place.height} at {place.left}, {place.top}")
            for name, place in zip(result.images, packed.places, strict=True)
        ),
    ]


@verb(
    Reads("images", "image", many=True, metavar="IMAGE... [OUTPUT]"),
    Writes("output", "image", "The packed image."),
    Reads(
        "meshes",
        "mesh",
        "Move the texture coordinates of this mesh with its image; one per image, in their order.",
        required=False,
        many=True,
        role="mesh",
        flags=("--mesh",),
    ),
    Extra(
        "--meshes-to mesh_outputs",
        "Folder for the moved meshes, which keep their names; made if it is missing.",
        metavar="DIR",
        is_folder=True,
    ),
    Options(PackOptions),
    Extra("--data", "Treat the images as data, such as roughness, not as colors.", is_flag=True),
    THREADS,
    examples="""
      texbake pack-textures wood.png steel.png -o atlas.png
      texbake pack-textures a.png b.png --mesh a.obj --mesh b.obj -o atlas.png --meshes-to packed
    """,
    table=_table,
)
def pack_textures_file(
    images: Sequence[PathLike],
    output: PathLike,
    options: PackOptions | None = None,
    *,
    meshes: Sequence[PathLike] = (),
    mesh_outputs: PathLike | Sequence[PathLike] | None = None,
    data: bool = False,
    threads: int | None = None,
    progress: Progress = None,
) -> PackedFiles:
    """Pack several IMAGEs into one.

    The texture coordinates of their meshes move with them. Texels are copied one to one where
    there is room. All texture coordinates of a mesh must lie in the unit square, because an
    image inside another one cannot tile.
    """
    from texbake.mesh.files import read_mesh, write_mesh
    from texbake.texture.image import read_image, write_image
    from texbake.texture.image_files import bits_for
    from texbake.texture.image_formats import check_image_format
    from texbake.texture.pack import pack_textures

    targets = _mesh_targets(images, meshes, mesh_outputs)
    check_distinct([output, *targets], [*images, *meshes])
    check_image_format(output)
    read = [read_image(path, color=not data, threads=threads) for path in images]
    packed = pack_textures([image.pixels for image in read], options)
    moved = [
        packed.remapped(read_mesh(path, progress=progress), i) for i, path in enumerate(meshes)
    ]
    bits = bits_for(Path(output), packed.pixels, max(read, key=lambda image: image.bits))
    if targets:
        make_folder(targets[0].parent)
    for mesh, path in zip(moved, targets, strict=True):
        write_mesh(mesh, path)
    write_image(packed.pixels, output, color=not data, bits=bits, threads=threads)
    warnings = []
    if packed.scale < 1.0:
        warnings.append(
            f"{output}: the images were scaled down to {100 * packed.scale:.1f} % of their sides; "
            "give a larger `size` to keep them as they are"
        )
    return PackedFiles(
        files=(Path(output), *targets),
        report=packed,
        warnings=tuple(warnings),
        images=tuple(Path(image).name for image in images),
    )


def _mesh_targets(
    images: Sequence[PathLike],
    meshes: Sequence[PathLike],
    outputs: PathLike | Sequence[PathLike] | None,
) -> list[Path]:
    """Return a file for each moved mesh; raise if one could not be written."""
    if (outputs is None) != (not meshes):
        raise OptionError(
            "meshes, mesh_outputs: give both, a mesh for each image and a folder for them"
        )
    if outputs is None:
        return []
    if len(meshes) != len(images):
        raise OptionError(
            f"meshes: {counted(len(meshes), 'is', 'are')} given for "
            f"{counted(len(images), 'image')}; give one for each, in order"
        )
    if isinstance(outputs, str | os.PathLike):
        check_folder(outputs)
        targets = [Path(outputs) / Path(path).name for path in meshes]
    else:
        targets = paths_of(outputs)
    for target in targets:
        check_mesh(target, folder_is_made=True)
    return targets


@dataclass(frozen=True, kw_only=True)
class PackTexturesStep(PackOptions):
    """How images are packed; further options are those of `PackOptions`."""

    data: Annotated[bool, Option("Treat the images as data, not as colors.")] = False
    format: Annotated[str, FORMAT_OF_IMAGE] = "png"
    mesh_format: Annotated[str, FORMAT_OF_MESH] = "obj"
    meshes: Annotated[
        int, Option("Number of meshes that move with the images: none, or one for each.", low=0)
    ] = 0


def _outputs(job: Job) -> dict[str, Any]:
    meshes = [path for name, path in job.outputs.items() if name != "texture"]
    files = job.inputs.get("mesh", ())
    return {"output": job.outputs["texture"], "meshes": files, "mesh_outputs": meshes or None}


def _packed_files(settings: Settings) -> dict[str, str]:
    suffix = settings["mesh_format"]
    meshes = {f"mesh{i}": f"mesh{i}.{suffix}" for i in range(settings["meshes"])}
    return {"texture": f"texture.{settings['format']}", **meshes}


def _check_meshes(settings: Settings, roles: frozenset[str]) -> None:
    if ("mesh" in roles) != (settings["meshes"] > 0):
        raise OptionError("meshes: it is the number of meshes in `mesh`; give both or neither")


def _memory(settings: Settings, sizes: Sizes) -> int:
    pixels = DECODED * n_bytes(sizes, "images")
    return PROCESS + 64 * MB + 2 * pixels + READ_FACE * n_faces(sizes, "mesh")


STEP = step_of(
    pack_textures_file,
    does="packs several images into one, and moves their meshes' texture coordinates",
    options=PackTexturesStep,
    outputs=_packed_files,
    prepare=_outputs,
    figures=lambda result: {"filled": result.report.filled, "scale": result.report.scale},
    memory=_memory,
    check=_check_meshes,
)
