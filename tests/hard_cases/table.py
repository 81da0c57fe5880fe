"""Write docs/hard_cases.md: every case, what a naive formula makes of it, ours, and the price.

    python tests/hard_cases/table.py [-o docs/hard_cases.md]

Errors are the same on every machine; times are the least of several rounds that take turns, each in
a single thread, and change from machine to machine.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

os.environ.setdefault("NUMBA_NUM_THREADS", "1")
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

Meshes, images and scenes that break naive code, made by code in `tests/hard_cases/catalog/`. Every
stage runs over every case that it can take: files, normals, tangents, simplification, all mappings,
atlases, measures, bakes, previews, mip levels, lookups, codes, cube maps, heights and normals,
padding, light maps, the preflight and the study. What must hold is finite results, unit vectors,
counts from exact integers, the same bytes at any scale by a power of two and on any number of
threads, round trips, no ray through a closed mesh, the fault named by `texbake check`, and an error
that falls with each step of a knob: texture size, dense mesh, bit depth, tessellation, filter,
octaves, subdivisions. Random triangle soups, random scenes and damaged files of every format go the
same way.

## What a cure buys, and what it costs

The naive formula stands beside ours in the tests, and fails there by the same measure by which ours
holds. 0 is right. Times are the least of several rounds in turns, of the whole stage on our side
against the bare formula in numpy on the other; below 1, ours is the faster. `TEXBAKE_FUZZ=10` makes
the tests go on for ten minutes in each file format, and for a hundred times the random meshes.
"""

LIMITS = """\
## Limits

Named here because they are refused by one clear error, or because they cannot be better.

- Areas of meshes beyond about 1e±150 model units cannot be computed in float64: mapping refuses
  them. Normals, files (OBJ, PLY, OFF) and distances still work.
- Maps are float32: a bake of meshes below 1e-30 or above 1e37 model units is refused.
- Areas of texture coordinates farther out than 1e75 tiles cannot be computed either: they are
  neither measured nor drawn, and all that `texbake check` says of them is that they lie outside.
- STL and GLB hold float32: what lies beyond it is refused, and no file is left.
- Which triangle a ray hits is found in float32 of the joint box. Walls of 1e-5 of the size are told
  apart to 1 % of their thickness, which leaves smooth normals off by up to a degree at their edges;
  where on a triangle it is hit is found in float64.
- Rays that hit nothing are looked at again by an exact test. With back faces not culled, a ray that
  slips through a vertex of a closed mesh finds the back of the far side, and is believed.
- Faces that cross by less than a millionth of the mesh's size count as touching.
- An atlas is made on a grid of 2^-20 of the mesh's size: thinner faces get one point each.
- Coplanar faces of two objects: the one drawn first is seen, on every pixel.
- `mip_chain(kind="normal")` takes vectors up to 1e19 long; squares of longer ones overflow float32.
"""


def contrast_rows(contrasts: Sequence[Contrast]) -> Iterator[str]:
    """Rows of the first table, measured now."""
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
    parts.append("## The catalogue\n")
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
    parser.add_argument("-o", "--output", type=Path, default=root / "docs" / "hard_cases.md")
    parser.parse_args().output.write_text(document(), encoding="utf-8")


if __name__ == "__main__":
    main()
