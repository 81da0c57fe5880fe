"""Conversions of images: heights and normals, mip levels, cube maps."""

from __future__ import annotations

from typing import TYPE_CHECKING

from texbake.baking.memory import MB, PROCESS
from texbake.baking.options import BakeOptions
from texbake.errors import counted
from texbake.files import PathLike
from texbake.jobs.outputs import JobResult, present_paths
from texbake.records import dataclass
from texbake.texture.options import (
    CubeOptions,
    HeightToNormalOptions,
    MipOptions,
    NormalToHeightOptions,
)
from texbake.verbs.step import n_bytes, step_of
from texbake.verbs.verb import THREADS, Options, Reads, Rows, Writes, verb

if TYPE_CHECKING:
    from texbake.texture.cube_files import CubeConversion
    from texbake.texture.heights_and_normals import HeightField

DATA_SUFFIXES = (".png", ".exr", ".tif", ".tiff", ".tga")


@dataclass(frozen=True)
class NormalMapReport:
    """The normal map that `height_to_normal_file` made."""

    width: int  # texels
    height: int
    scale: float  # height that a change of 1 in the image stood for
    image_width: float  # width of the image in the units of the heights

    def table(self) -> Rows:
        """Return rows of a label and a figure."""
        return [
            ("size", f"{self.width} x {self.height}"),
            ("scale", f"{self.scale:.6g}, width {self.image_width:g}"),
        ]


@verb(
    Reads("height", "image"),
    Writes("output", "image", "The normal map, in tangent space.", suffixes=DATA_SUFFIXES),
    Options(HeightToNormalOptions),
    Options(BakeOptions, "convention", "bits", apart=True),
    THREADS,
    examples="""
      texbake height-to-normal bricks.png -o bricks_normal.png --scale 0.02
      texbake height-to-normal displacement.exr -o normal.png --width 3.5 --wrap clamp
    """,
)
def height_to_normal_file(
    height: PathLike,
    output: PathLike,
    options: HeightToNormalOptions | None = None,
    *,
    convention: str = "opengl",
    bits: int | None = None,
    threads: int | None = None,
) -> JobResult[NormalMapReport]:
    """Make a normal map from the heights in HEIGHT.

    Heights are read from the first channel. The file of a map that texbake baked contains the scale
    of its heights in model units; give the width of the image in model units then.
    """
    from texbake.texture.heights_and_normals import height_scale, height_to_normal
    from texbake.texture.image import read_image
    from texbake.texture.image_files import write_normals
    from texbake.texture.image_formats import check_image_format

    options = options or HeightToNormalOptions()
    check_image_format(output, bits, channels=3, lossless=True)
    image = read_image(height, color=False, threads=threads)
    normals = height_to_normal(image, options)
    write_normals(normals, output, convention=convention, bits=bits, threads=threads)
    n_rows, n_columns = normals.shape[:2]
    report = NormalMapReport(n_columns, n_rows, height_scale(image, options), options.width)
    return JobResult(files=present_paths(output), report=report)


@dataclass(frozen=True, eq=False)
class HeightMapReport:
    """The heights that `normal_to_height_file` made."""

    field: HeightField
    mid: float  # of the file: a value v means the height (v - mid) * scale
    scale: float

    def table(self) -> Rows:
        """Return rows of a label and a figure."""
        low, high = float(self.field.heights.min()), float(self.field.heights.max())
        return [
            ("heights", f"{low:.6g} to {high:.6g}"),
            ("in the file", f"mid {self.mid:g}, scale {self.scale:g}"),
            ("slope error, RMS", f"{self.field.rms_slope_error:.4g}  (0 for a true surface)"),
        ]


@verb(
    Reads("normal", "image"),
    Writes("output", "image", "The height map.", suffixes=DATA_SUFFIXES),
    Options(NormalToHeightOptions),
    Options(BakeOptions, "bits", apart=True),
    THREADS,
    examples="""
      texbake normal-to-height bricks_normal.png -o bricks.exr
      texbake normal-to-height normal.png -o height.png --method frankot-chellappa --wrap clamp
    """,
)
def normal_to_height_file(
    normal: PathLike,
    output: PathLike,
    options: NormalToHeightOptions | None = None,
    *,
    bits: int | None = None,
    threads: int | None = None,
) -> JobResult[HeightMapReport]:
    """Make a height map from the normals in NORMAL.

    NORMAL is a normal map in tangent space. The mean of the heights is 0, because normals do
    not determine it. The file contains the scale of the heights.
    """
    from texbake.texture.heights_and_normals import normal_to_height
    from texbake.texture.image import read_image
    from texbake.texture.image_files import write_heights
    from texbake.texture.image_formats import check_image_format

    check_image_format(output, bits, channels=1, lossless=True)
    image = read_image(normal, color=False, threads=threads)
    field = normal_to_height(image, options or NormalToHeightOptions())
    mid, scale = write_heights(field.heights, output, bits=bits, threads=threads)
    warnings: tuple[str, ...] = ()
    if field.n_steep:
        warnings = (
            f"{normal}: the slope of {counted(field.n_steep, 'normal')} was limited to 100; "
            "steeper ones have no heights",
        )
    report = HeightMapReport(field, mid, scale)
    return JobResult(files=present_paths(output), report=report, warnings=warnings)


@verb(
    Reads("image", "image"),
    Writes(
        "output",
        "images",
        "A folder for one file per level, made if it is missing, or one picture of all levels.",
    ),
    Options(MipOptions),
    Writes(
        "roughness",
        "images",
        "Also write the roughness of each level, from how much its normals vary.",
    ),
    THREADS,
    examples="""
      texbake mipmap wood.png -o levels/
      texbake mipmap wood.png -o levels.png --filter kaiser --wrap clamp
      texbake mipmap normal.png -o levels/ --kind normal --roughness rough/
    """,
    table=lambda result: [],
)
def mipmap_files(
    image: PathLike,
    output: PathLike,
    options: MipOptions | None = None,
    *,
    roughness: PathLike | None = None,
    threads: int | None = None,
) -> JobResult[int]:
    """Write the mip levels of IMAGE, down to one texel."""
    from texbake.texture.mipmaps import write_mip_levels

    files = write_mip_levels(image, output, options, roughness=roughness, threads=threads)
    return JobResult(files=files, report=len(files))


MIPMAP = step_of(
    mipmap_files,
    does="makes the mip levels of an image",
    without=(),
    outputs=lambda settings: {"levels": "levels"},
    figures=lambda result: {"levels": result.report},
    # Per byte of a compressed image: decoded, with mip levels.
    memory=lambda settings, sizes: PROCESS + 64 * MB + 60 * n_bytes(sizes, "image"),
)


@verb(
    Reads("source", "image"),
    Writes(
        "output",
        "images",
        "A folder for six faces, made if it is missing, or one image.",
        metavar="DIR|FILE",
    ),
    Options(CubeOptions),
    THREADS,
    examples="""
      texbake cubemap studio.hdr -o faces/
      texbake cubemap studio.hdr -o cross.exr --size 512
      texbake cubemap faces/ -o pano.hdr
      texbake cubemap skybox/ -o sky.png --convention inside
    """,
    table=lambda result: [
        ("from", result.report.source_layout),
        ("to", f"{result.report.layout} of {result.report.size:,} px"),
    ],
)
def cubemap_files(
    source: PathLike,
    output: PathLike,
    options: CubeOptions | None = None,
    *,
    threads: int | None = None,
) -> JobResult[CubeConversion]:
    """Convert SOURCE to a cube map, or from one.

    SOURCE is a latitude-longitude image (twice as wide as high, its middle along -z), a cross of
    4 x 3 faces, or a folder with the files px, nx, py, ny, pz and nz. Each output texel is the mean
    of the area that it covers.
    """
    from texbake.texture.cube_files import convert_cube

    result = convert_cube(source, output, options, threads=threads)
    warnings: tuple[str, ...] = ()
    if result.clipped:
        warnings = (
            f"{output}: {result.clipped:.2%} of the values lie outside of 0 to 1 and were clipped; "
            "EXR and HDR files keep them",
        )
    return JobResult(files=result.files, report=result, warnings=warnings)
