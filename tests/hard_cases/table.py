"""Write the page about hard cases: what a naive formula makes of each, ours, and the cost.

    python tests/hard_cases/table.py [-o docs/explanation/hard-cases.md]

Errors are the same on every machine. Times are the least of several alternating rounds, each in a
single thread, and differ from machine to machine.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

from catalog.case import Case
from catalog.contrast import Contrast
from catalog.geometry import GEOMETRY
from catalog.geometry_contrasts import GEOMETRY_CONTRASTS
from catalog.images import IMAGES
from catalog.mappings import MAPPINGS
from catalog.pairs import PAIRS
from catalog.rays import RAYS
from catalog.render_contrasts import RENDER_CONTRASTS
from catalog.scenes import SCENES
from catalog.texture_contrasts import TEXTURE_CONTRASTS
from catalog.texture_space import TEXTURE_SPACE

INTRODUCTION = """\
# Hard cases

This page lists meshes, images and scenes that break naive code. `tests/hard_cases/catalog/`
generates them, and every stage of the program is tested with every case that it accepts: files,
normals, tangents, simplification, all mappings, atlases, measurements, bakes, previews, mip levels,
lookups, encodings, cube maps, heights and normals, padding, light maps, checks and the study.

The tests require:

- finite results, unit vectors, and counts from exact integers
- the same bytes at any scale by a power of two, and on any number of threads
- exact round trips, and no ray that passes through a closed mesh
- that `texbake check` names the fault
- an error that falls with each step of a setting: texture size, high-poly mesh, bit depth,
  tessellation, filter, octaves, subdivisions

Random triangle soups, random scenes and damaged files of every format are tested in the same way.

## What each remedy gains and costs

The tests run a naive formula beside ours, and measure the error of both in the same way. An error
of 0 is exact. Times are the shortest of several rounds that alternate between the two. Ours is the
time of the whole stage, and the other that of the numpy formula alone; a factor below 1 means that
ours is faster. `TEXBAKE_FUZZ=10` lets the tests run for ten minutes in each file format, and for a
hundred times as many random meshes.
"""

LIMITS = """\
## Limits

These cases are refused with one clear error, or cannot be handled better.

- Areas of meshes beyond about 1e±150 model units cannot be computed in float64: mapping refuses
  such meshes. Normals, files (OBJ, PLY, OFF) and distances still work.
- Maps are float32: a bake of meshes below 1e-30 or above 1e37 model units is refused.
- Areas of texture coordinates farther out than 1e75 tiles cannot be computed either. They are
  neither measured nor drawn, and `texbake check` only reports that they lie outside.
- STL and GLB store float32: larger values are refused, and no file is written.
- Walls 1e-5 of the size thick are resolved to 1 % of their thickness, which leaves smooth normals
  off by up to a degree at their edges.
- Faces that cross by less than a millionth of the mesh's size count as touching.
- An atlas is made on a grid of 2^-20 of the mesh's size: thinner faces are reduced to a point.
- Where faces lie on one another, or normals around a vertex cancel, the first face of the file
  counts.
- Of coplanar faces of two objects, the one drawn first is visible, at every pixel.
- `mip_chain(kind="normal")` accepts vectors up to a length of 1e19; squares of longer ones overflow
  float32.
"""


def contrast_rows(contrasts: Sequence[Contrast]) -> Iterator[str]:
    """Rows of a table of contrasts, measured now."""
    yield "| case | what goes wrong | measured in | naive | ours | time, naive | ours | times |"
    yield "|---|---|---|---|---|---|---|---|"
    for contrast in contrasts:
        naive, ours = contrast.measured()
        seconds = contrast.seconds()
        ratio = f"{seconds[1] / seconds[0]:.2g}" if contrast.alike else "(a whole picture)"
        times = f"{_time(seconds[0])} | {_time(seconds[1])} | {ratio}"
        errors = f"{_figure(naive)} | {_figure(ours)}"
        yield f"| {contrast.name} | {contrast.wrong} | {contrast.unit} | {errors} | {times} |"


def case_rows(cases: Sequence[Case[Any]]) -> Iterator[str]:
    """Rows of a list of cases."""
    yield "| case | what goes wrong in naive code | refused, by one clear error |"
    yield "|---|---|---|"
    for case in cases:
        stages = ", ".join(case.refused) or ""
        yield f"| {case.name} | {case.wrong} | {stages} |"


def _figure(value: float) -> str:
    return f"{value:.0f}" if value == round(value) else f"{value:.3g}"


def _time(seconds: float) -> str:
    return f"{seconds * 1e3:.3g} ms"


def document() -> str:
    """Return the whole page."""
    parts = [INTRODUCTION]
    for title, contrasts in (
        ("In space", GEOMETRY_CONTRASTS),
        ("In the texture", TEXTURE_CONTRASTS),
        ("On the screen", RENDER_CONTRASTS),
    ):
        parts.append(f"### {title}\n\n" + "\n".join(contrast_rows(contrasts)) + "\n")
    parts.append(LIMITS)
    parts.append("## The catalog\n")
    for title, cases in (
        ("Geometry", GEOMETRY),
        ("Pairs to bake", PAIRS),
        ("Rays", RAYS),
        ("Texture space and tangents", TEXTURE_SPACE),
        ("Mappings", MAPPINGS),
        ("Images", IMAGES),
        ("Scenes", SCENES),
    ):
        parts.append(f"### {title}\n\n" + "\n".join(case_rows(cases)) + "\n")
    return "\n".join(parts)


def main() -> None:
    """Parse the command line and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    root = Path(__file__).parents[2]
    parser.add_argument(
        "-o", "--output", type=Path, default=root / "docs" / "explanation" / "hard-cases.md"
    )
    parser.parse_args().output.write_text(document(), encoding="utf-8")


if __name__ == "__main__":
    main()
