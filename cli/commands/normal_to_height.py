"""`texbake normal-to-height`: normals to heights."""

from __future__ import annotations

from pathlib import Path

import click

from texbake.files import check_writable
from texbake.jobs.outputs import check_distinct
from texbake.texture.height_options import CONVENTIONS, METHODS, WRAPS, NormalToHeightOptions

from ..options import IMAGE_SUFFIXES, choice_option, number_option, output_file, threads_option
from ..terminal import Terminal, terminal_options
from ..types import FileOf


@click.command(
    epilog="""
    \b
    Example:
      texbake normal-to-height bricks_normal.png -o bricks.exr
      texbake normal-to-height normal.png -o height.png --method frankot-chellappa --wrap clamp
    """
)
@click.argument("normal", type=FileOf(IMAGE_SUFFIXES))
@output_file("The heights.", (".png", ".exr", ".tif", ".tiff", ".tga"))
@choice_option(
    "--method",
    METHODS,
    NormalToHeightOptions.method,
    "poisson fits steps from texel to texel; frankot-chellappa fits waves that tile.",
)
@choice_option("--wrap", WRAPS, NormalToHeightOptions.wrap, "The map tiles, or it ends.")
@number_option(
    "--width",
    float,
    NormalToHeightOptions.width,
    "W",
    "How wide the image is, in the unit that heights come in.",
)
@choice_option(
    "--convention",
    CONVENTIONS,
    NormalToHeightOptions.convention,
    "Green channel: +Y up or down.  [default: what the file says of itself, else opengl]",
)
@number_option(
    "--bits",
    int,
    None,
    "8|16|32",
    "Bits; 32 is float.  [default: the most that the format holds]",
)
@threads_option
@terminal_options
def normal_to_height(
    normal: Path,
    output: Path,
    method: str,
    wrap: str,
    width: float,
    convention: str | None,
    bits: int | None,
    threads: int | None,
    terminal: Terminal,
) -> None:
    """Find the heights of the normal map NORMAL.

    It is in tangent space.

    Their mean is 0, since normals do not tell it. The file says their scale.
    """
    options = NormalToHeightOptions(method=method, wrap=wrap, width=width, convention=convention)
    check_distinct([output], [normal])
    check_writable(output)
    import texbake
    from texbake.texture.image_files import write_heights
    from texbake.texture.image_formats import check_image_format

    check_image_format(output, bits, channels=1, lossless=True)
    image = texbake.read_image(normal, color=False, threads=threads)
    field = texbake.normal_to_height(image, options)
    mid, scale = write_heights(field.heights, output, bits=bits, threads=threads)
    if field.n_steep:
        terminal.warn(
            f"{normal}: {field.n_steep:,} normals are too steep for heights, and are cut at a "
            "slope of 100"
        )
    low, high = float(field.heights.min()), float(field.heights.max())
    terminal.summary(
        [
            ("heights", f"from {low:.6g} to {high:.6g}, in a file of mid {mid:g}, scale {scale:g}"),
            ("slopes left over", f"{field.rms_slope_error:.4g}  (0 for a true surface)"),
        ]
    )
    terminal.wrote([output])
