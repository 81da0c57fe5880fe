"""`height-to-normal`: convert a height map to a normal map."""

from __future__ import annotations

from dataclasses import dataclass

from texbake.baking.options import BakeOptions
from texbake.files import PathLike
from texbake.jobs.outputs import JobResult, present_paths
from texbake.texture.options import HeightToNormalOptions
from texbake.verbs.verb import THREADS, Options, Reads, Rows, Writes, verb

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
    scale = height_scale(image, options)
    report = NormalMapReport(n_columns, n_rows, scale, options.width)
    return JobResult(files=present_paths(output), report=report)
