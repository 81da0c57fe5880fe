"""What `convert` and `transform` share: the job, and what they print."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import texbake

from .terminal import Terminal

if TYPE_CHECKING:
    from texbake import TransformOptions


def moved(mesh: Path, output: Path, options: TransformOptions, terminal: Terminal) -> None:
    """Transform a mesh file, and print its size."""
    with terminal.progress() as progress:
        done = texbake.transform_file(mesh, output, options, progress=progress)
    for warning in done.warnings:
        terminal.warn(warning)
    low, high = done.report.bounds
    terminal.summary(
        [
            ("faces", f"{done.report.n_polygons:,}"),
            ("vertices", f"{done.report.n_vertices:,}"),
            ("size", " x ".join(f"{side:.6g}" for side in high - low)),
            (
                "bounds",
                " to ".join(f"({', '.join(f'{x:.6g}' for x in end)})" for end in (low, high)),
            ),
        ]
    )
    terminal.wrote(done.files)
