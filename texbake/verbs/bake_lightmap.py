"""`bake-lightmap`: bake the lights of a scene into light maps of its objects."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from texbake.baking.options import BakeOptions
from texbake.baking.texture.options import TextureBakeOptions
from texbake.files import PathLike, make_folder
from texbake.verbs.step import IMAGE_FORMATS
from texbake.verbs.verb import Extra, Options, Reads, Writes, verb

if TYPE_CHECKING:
    from texbake.jobs.light_maps import LightMaps
    from texbake.jobs.outputs import JobResult
    from texbake.progress import ProgressSink


@verb(
    Reads("scene", "scene"),
    Writes("output", "folder", "Folder of the maps, which is made if it is missing."),
    Options(BakeOptions, "size"),
    Options(TextureBakeOptions, "samples", defaults={"samples": BakeOptions.samples}, apart=True),
    Extra(
        "--format",
        "File format of the maps; exr and tif store light as floats.",
        choices=IMAGE_FORMATS,
        default="exr",
        show_default=True,
    ),
    Extra(
        "--set uv_set",
        "Texture coordinates of the maps, for objects that have them; see: texbake unwrap --set. "
        " [default: the first]",
        metavar="NAME",
    ),
    Options(BakeOptions, "bits", "padding", "fill", "threads"),
    examples="""
      texbake bake-lightmap room.toml -o maps --size 512 --samples 16
    """,
)
def bake_lightmap(
    scene: PathLike,
    output: PathLike,
    options: BakeOptions,
    *,
    format: str = "exr",  # noqa: A002
    uv_set: str | None = None,
    progress: ProgressSink | None = None,
) -> JobResult[LightMaps]:
    """Bake the static lights of SCENE into light maps.

    A light map contains the ambient light and the static lights with their shadows. Every object
    that has texture coordinates gets one, which has the object's name.
    """
    from texbake.jobs.light_maps import bake_light_maps, file_names, light_map_images
    from texbake.jobs.outputs import JobResult, check_distinct
    from texbake.progress import Stages
    from texbake.rendering.scene.read import read_scene
    from texbake.texture.image_formats import check_image_format

    folder = Path(output)
    check_image_format(folder / f"map.{format}", options.bits, color=True, channels=3)
    stages = Stages(progress)
    with stages.part("read scene"):
        read = read_scene(scene, progress=progress)
    baked = bake_light_maps(read, options, uv_set=uv_set, progress=progress)
    with stages.stage("write maps"):
        make_folder(folder)
        names = file_names([item.name for item in baked.maps])
        files = [folder / f"{name}.{format}" for name in names]
        check_distinct(files, [path for path in read.files if path not in light_map_images(read)])
        for item, path in zip(baked.maps, files, strict=True):
            item.write(path, bits=options.bits, threads=options.threads)
    return JobResult(files=tuple(files), report=baked, warnings=baked.warnings)
