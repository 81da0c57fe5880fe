"""`cubemap`: convert latitude-longitude images to cube maps and back."""

from __future__ import annotations

from typing import TYPE_CHECKING

from texbake.files import PathLike
from texbake.jobs.outputs import JobResult
from texbake.texture.options import CubeOptions
from texbake.verbs.verb import THREADS, Options, Reads, Writes, verb

if TYPE_CHECKING:
    from texbake.texture.cube_files import CubeConversion


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
    table=lambda done: [
        ("from", done.report.source_layout),
        ("to", f"{done.report.layout} of {done.report.size:,} px"),
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

    done = convert_cube(source, output, options, threads=threads)
    warnings: tuple[str, ...] = ()
    if done.clipped:
        warnings = (
            f"{output}: {done.clipped:.2%} of the values lie outside of 0 to 1 and were clipped; "
            "EXR and HDR files keep them",
        )
    return JobResult(files=done.files, report=done, warnings=warnings)
