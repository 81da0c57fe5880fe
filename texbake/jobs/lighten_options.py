"""Options of `lighten`, without loading anything heavy."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

from texbake.baking.options import PADDING_OPTION, THREADS_OPTION, BakeOptions
from texbake.mapping.options.atlas import PADDING_DEFAULT
from texbake.mapping.options.shared import Size
from texbake.mesh.options import (
    ANGLE_OPTION,
    DEFAULT_ANGLE,
    JOIN_OBJECTS_OPTION,
    LOW_NORMALS_OPTION,
    MIN_FACES,
    ORIENTATION_OPTION,
    REMESH_OPTION,
    SimplifyOptions,
    check_angle,
)
from texbake.schema import CheckedOptions, Option, option

LEAST_SIZE, MOST_SIZE = 1024, 2048
ENCODINGS = ("webp", "jpeg", "png")
# Of the triangles, where no number is given, and how many at least: 5,000 compressed triangles take
# less than an image of 1024 x 1024 texels does.
SHARE, LEAST_FACES = 0.1, 5000


@dataclass(frozen=True, kw_only=True)
class LightenOptions(CheckedOptions):
    """How `lighten` makes a model smaller.

    Its faces are neither flipped nor wrapped in a closed surface unless asked for: the
    author of a textured model has seen it as it is.
    """

    n_faces: Annotated[
        int | None,
        Option(
            "Number of triangles to reach. With no fewer than the model has, only its maps and "
            "texture coordinates are made again.",
            metavar="N",
            low=MIN_FACES,
            flag="--faces",
            default=f"a tenth, and {LEAST_FACES} at least",
        ),
    ] = None
    quality: Annotated[str, option(SimplifyOptions, "quality")] = "best"
    remesh: Annotated[str, REMESH_OPTION] = "never"
    join_objects: Annotated[bool, JOIN_OBJECTS_OPTION] = False
    orientation: Annotated[str, ORIENTATION_OPTION] = "keep"
    normals: Annotated[str, LOW_NORMALS_OPTION] = "auto"
    angle: Annotated[float, ANGLE_OPTION] = DEFAULT_ANGLE
    size: Annotated[
        Size | None,
        replace(
            option(BakeOptions, "size"),
            default=f"what the images of the model need, {LEAST_SIZE} to {MOST_SIZE}",
        ),
    ] = None
    padding: Annotated[int | None, replace(PADDING_OPTION, default=PADDING_DEFAULT)] = None
    samples: Annotated[int | str, option(BakeOptions, "samples")] = 4
    images: Annotated[
        str,
        Option(
            "Format of the images. Programs need the extension EXT_texture_webp for webp; every "
            "program reads jpeg and png.",
            choices=ENCODINGS,
        ),
    ] = "webp"
    image_quality: Annotated[
        int,
        Option("Quality of webp and jpeg images.", metavar="N", low=1, high=100),
    ] = 90
    compress: Annotated[
        bool,
        Option(
            "Compress vertices and triangles by EXT_meshopt_compression.",
            flag="--compress/--no-compress",
        ),
    ] = False
    quantize: Annotated[
        bool | None,
        Option(
            "Write vertices as 8- and 16-bit integers (KHR_mesh_quantization).",
            flag="--quantize/--no-quantize",
            default="with --compress",
        ),
    ] = None
    views: Annotated[
        int,
        Option(
            "Number of views in which the result is compared with the model; 0 for none.",
            metavar="N",
            low=0,
        ),
    ] = 12
    threads: Annotated[int | None, THREADS_OPTION] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        check_angle(self.normals, self.angle)

    def bake_options(self, maps: tuple[str, ...], size: Size, padding: int | None) -> BakeOptions:
        """Return options for the bake, with the padding of the atlas."""
        return BakeOptions(
            maps=maps,
            size=size,
            padding=padding or 0,
            samples=self.samples,
            fill="push-pull",
            on_miss="closest",
            orientation="keep",
            threads=self.threads,
        )
