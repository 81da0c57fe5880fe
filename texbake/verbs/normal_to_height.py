"""`normal-to-height`: convert a normal map to a height map."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from texbake.errors import counted
from texbake.files import PathLike
from texbake.jobs.outputs import JobResult, present_paths
from texbake.texture.options import NormalToHeightOptions
from texbake.verbs.height_to_normal import DATA_SUFFIXES
from texbake.verbs.verb import BITS, THREADS, Options, Reads, Rows, Writes, verb

if TYPE_CHECKING:
    from texbake.texture.heights_and_normals import HeightField


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
    BITS,
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
