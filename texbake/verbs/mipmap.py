"""`mipmap`: write the mip levels of an image."""

from __future__ import annotations

from texbake.baking.memory import MB, PROCESS
from texbake.files import PathLike
from texbake.jobs.outputs import JobResult
from texbake.texture.options import MipOptions
from texbake.verbs.step import n_bytes, step_of
from texbake.verbs.verb import THREADS, Options, Reads, Writes, verb


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
    table=lambda done: [],
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
    from texbake.texture.mip_files import write_mip_levels

    files = write_mip_levels(image, output, options, roughness=roughness, threads=threads)
    return JobResult(files=files, report=len(files))


STEP = step_of(
    mipmap_files,
    does="makes the mip levels of an image",
    without=(),
    outputs=lambda settings: {"levels": "levels"},
    figures=lambda done: {"levels": done.report},
    # Per byte of a compressed image: decoded, with mip levels.
    memory=lambda settings, sizes: PROCESS + 64 * MB + 60 * n_bytes(sizes, "image"),
)
