"""`lighten`: fewer triangles and one set of images, all materials kept."""

from __future__ import annotations

from typing import TYPE_CHECKING

from texbake.files import PathLike
from texbake.jobs.options import LightenOptions
from texbake.verbs.verb import PAGE, REPORT, Options, Reads, Writes, verb

if TYPE_CHECKING:
    from texbake.jobs.lighten import LightenReport
    from texbake.jobs.outputs import JobResult
    from texbake.progress import ProgressSink


@verb(
    Reads("model"),
    Writes("output", "image", "The lightened model.", suffixes=(".glb",)),
    Options(LightenOptions),
    REPORT,
    PAGE,
    examples="""
      texbake lighten model.glb -o light.glb --html light.html
      texbake lighten model.fbx -o light.glb --faces 5000 --size 1024
    """,
)
def lighten_file(
    model: PathLike,
    output: PathLike,
    options: LightenOptions | None = None,
    *,
    report: PathLike | None = None,
    html: PathLike | None = None,
    command: str = "",
    progress: ProgressSink | None = None,
) -> JobResult[LightenReport]:
    """Make MODEL smaller, with all of its materials.

    MODEL is simplified, unwrapped once, and every channel of its materials is baked into one set of
    images: base color and alpha, metallic, roughness, occlusion, emissive, normal, clearcoat,
    transmission, sheen and specular. Its own normal maps are part of the new one.
    """
    from texbake.jobs.lighten import lighten

    return lighten(model, output, options or LightenOptions(), html, command, progress)
