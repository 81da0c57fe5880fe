"""`texbake lighten`: fewer triangles and one set of images, all materials kept."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import texbake
from texbake import LightenOptions

from ..options import mesh_argument, options_of, output_file, report_option
from ..terminal import Terminal, terminal_options

if TYPE_CHECKING:
    from texbake import LightenReport


@click.command(
    epilog="""
    \b
    Example:
      texbake lighten model.glb -o light.glb
      texbake lighten model.fbx -o light.glb --faces 5000 --size 1024
    """
)
@mesh_argument("model")
@output_file("The lightened model.", (".glb",))
@options_of(LightenOptions)
@report_option
@terminal_options
def lighten(
    model: Path, output: Path, report: Path | None, terminal: Terminal, **choices: Any
) -> None:
    """Make MODEL smaller, with all of its materials.

    MODEL is simplified, unwrapped once, and every channel of its materials is baked into one set of
    images: base color and alpha, metallic, roughness, occlusion, emissive, normal, clearcoat,
    transmission, sheen and specular. Its own normal maps are part of the new one.
    """
    options = LightenOptions(**choices)
    with terminal.progress() as progress:
        done = texbake.lighten_file(model, output, options, report=report, progress=progress)
    for warning in done.warnings:
        terminal.warn(warning)
    terminal.summary(_rows(done.report))
    terminal.wrote(done.files)


def _rows(report: LightenReport) -> list[tuple[str, str]]:
    rows = [
        ("triangles", f"{report.n_faces_before:,} to {report.n_faces:,}"),
        ("materials", f"{report.n_materials_before:,} to {report.n_materials:,}"),
        (
            "size",
            f"{report.n_bytes_before:,} bytes to {report.n_bytes:,}, "
            f"{100.0 * report.n_bytes / max(report.n_bytes_before, 1):.1f} %",
        ),
        ("images", ", ".join(report.images) or "none"),
    ]
    if report.size is not None:
        rows.append(("texels", "{} x {}".format(*report.size)))
    if report.simplified is not None:
        distance = report.simplified.distance
        rows.append(
            (
                "distance of the surfaces",
                f"RMS {100 * distance.rms_relative:.3f} %, "
                f"greatest {100 * distance.max_relative:.3f} % of the diagonal",
            )
        )
    seconds = sum(stage.seconds for stage in report.stages)
    return [*rows, ("time", f"{seconds:.2f} s")]
