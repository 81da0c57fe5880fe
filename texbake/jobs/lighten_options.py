"""Every option of `lighten`, with its default."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

from texbake.baking.memory import parse_bytes
from texbake.baking.options import PADDING_OPTION, BakeOptions
from texbake.errors import OptionError
from texbake.mapping.options import PADDING_DEFAULT
from texbake.mesh.options import (
    ANGLE_OPTION,
    DEFAULT_ANGLE,
    HIDDEN_PARTS,
    JOIN_OBJECTS_OPTION,
    LOW_NORMALS_OPTION,
    MIN_FACES,
    ORIENTATION_OPTION,
    REMESH_OPTION,
    SimplifyOptions,
    check_angle,
)
from texbake.records import dataclass
from texbake.schema import THREADS_OPTION, CheckedOptions, Size, option, option_of

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

    n_faces: int | None = option(
        None,
        "Number of triangles to reach. With no fewer than the model has, its mesh stays; its "
        "images are coded again, and baked again where `uvs` asks for new coordinates.",
        metavar="N",
        low=MIN_FACES,
        flag="--faces",
        default=f"a tenth, but at least {LEAST_FACES}",
    )
    quality: Annotated[str, option_of(SimplifyOptions, "quality")] = "best"
    remesh: Annotated[str, REMESH_OPTION] = "never"
    uvs: str = option(
        "auto",
        "Texture coordinates: keep them, and the images of each material; make new ones, and bake "
        "all materials into one set of images; or auto, which makes new ones where images lie "
        "on further sets, more than 8 materials have images, or, with fewer triangles, coordinates "
        "overlap.",
        choices=("auto", "keep", "new"),
    )
    stack: bool = option(
        False,
        "Let parts that are copies of one another share their texels, where texture coordinates "
        "are new. Copies may be moved, turned, mirrored or of another size.",
    )
    drop_hidden: bool = option(False, f"{HIDDEN_PARTS}. Transparent materials hide nothing.")
    join: bool = option(False, "Write one node instead of those of the model.")
    join_objects: Annotated[bool, JOIN_OBJECTS_OPTION] = False
    orientation: Annotated[str, ORIENTATION_OPTION] = "keep"
    normals: Annotated[str, LOW_NORMALS_OPTION] = "auto"
    angle: Annotated[float, ANGLE_OPTION] = DEFAULT_ANGLE
    size: Annotated[
        Size | None,
        replace(
            option_of(BakeOptions, "size"),
            default=f"what the images of the model need, {LEAST_SIZE} to {MOST_SIZE}",
        ),
    ] = None
    padding: Annotated[int | None, replace(PADDING_OPTION, default=PADDING_DEFAULT)] = None
    samples: Annotated[int | str, option_of(BakeOptions, "samples")] = 4
    images: str = option(
        "webp",
        "Format of the images. Programs need the extension EXT_texture_webp for webp; every "
        "program reads jpeg and png.",
        choices=ENCODINGS,
    )
    image_quality: int | None = option(
        None,
        "Quality of webp and jpeg images.",
        metavar="N",
        low=1,
        high=100,
        default="the lowest that leaves 40 dB in an image, from 30 to 90",
    )
    target_size: str | int | None = option(
        None,
        "Greatest size of the file, such as 500kB. The number of triangles, and the size and "
        "quality of each image, are those with the best pictures found.",
        metavar="BYTES",
        default="no limit",
    )
    min_psnr: float | None = option(
        None,
        "Least mean PSNR of the pictures of the result in dB, such as 30. The number of triangles, "
        "and the size and quality of each image, are those of the smallest file found.",
        metavar="DB",
        above=0,
        default="no limit",
    )
    compress: bool = option(
        False,
        "Compress vertices and triangles by EXT_meshopt_compression.",
        flag="--compress/--no-compress",
    )
    quantize: bool = option(
        True,
        "Write vertices as 8- and 16-bit integers (KHR_mesh_quantization), unless the model is "
        "over 1,000 times as long as thick.",
        flag="--quantize/--no-quantize",
    )
    views: int = option(
        6,
        "Number of views in which the result is compared with the model; 0 for none.",
        metavar="N",
        low=0,
    )
    threads: Annotated[int | None, THREADS_OPTION] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        check_angle(self.normals, self.angle)
        if self.stack and self.uvs == "keep":
            raise OptionError("stack: parts share texels in new coordinates; set `uvs` to new")
        if self.stack and self.remesh != "never":
            raise OptionError("stack: parts keep their own surface; set `remesh` to never")
        search = "target_size" if self.target_bytes is not None else "min_psnr"
        if self.min_psnr is not None:
            if self.target_bytes is not None:
                raise OptionError("min_psnr, target_size: a search has one goal; omit one of them")
            if self.views == 0:
                raise OptionError("min_psnr: pictures are needed to measure it; increase `views`")
        elif self.target_bytes is None:
            return
        if self.image_quality is not None:
            raise OptionError(
                f"image_quality: `{search}` chooses a quality for each image; leave one of them out"
            )

    @property
    def target_bytes(self) -> int | None:
        """Greatest size of the file."""
        if self.target_size is None:
            return None
        return parse_bytes(
            self.target_size, option="target_size", what="a size of a file", example="500kB",
            thousand=1000,
        )  # fmt: skip

    @property
    def sides(self) -> tuple[int, int]:
        """Greatest width and height of an image."""
        size = MOST_SIZE if self.size is None else self.size
        return (size, size) if isinstance(size, int) else size

    def target_faces(self, n_faces: int) -> int:
        """Return the number of triangles to reach of a model of `n_faces`."""
        return max(round(SHARE * n_faces), LEAST_FACES) if self.n_faces is None else self.n_faces

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
