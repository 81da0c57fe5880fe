"""`bake-lightmap`: bake the lights of a scene into light maps of its objects."""

from __future__ import annotations

from typing import TYPE_CHECKING

from texbake.baking.options import BakeOptions
from texbake.baking.texture.options import TextureBakeOptions
from texbake.files import PathLike
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
    format: str,  # noqa: A002
    uv_set: str | None,
    progress: ProgressSink | None,
) -> JobResult[LightMaps]:
    """Bake the static lights of SCENE into light maps.

    A light map contains the ambient light and the static lights with their shadows. Every object
    that has texture coordinates gets one, which has the object's name.
    """
    from texbake.jobs.light_maps import bake_light_map_files

    return bake_light_map_files(
        scene, output, options, format=format, uv_set=uv_set, progress=progress
    )
