"""Turn the light and the viewer around an orange, and measure what looks wrong.

A photograph, a bump map, a normal map and a displacement map of the high-poly orange are put on a
smooth sphere, and their pictures are compared with its own.

python orange_angles.py [FOLDER]   # writes orange_angles.svg, orange_angles.csv, orange_angles.png
"""

import sys
from pathlib import Path

import numpy as np

import texbake
from texbake.jobs.orange_turns import METHODS, TRUTH, measure_turns, turns_svg
from texbake.pages.plots import write_svg
from texbake.rendering.panels import Panel, side_by_side

# What is shown: (what turns, degrees).
ROWS = (("light", 0), ("light", 60), ("viewer", 60))


def main(folder: Path) -> None:
    """Measure, and write the plots, the figures and some of the pictures."""
    turns = measure_turns()
    write_svg(turns_svg(turns), folder / "orange_angles.svg")
    turns.write_csv(folder / "orange_angles.csv")
    errors = {(e.turned, e.method, e.angle_deg): e.error for e in turns.errors}
    rows = []
    for turned, angle in ROWS:
        panels = [
            Panel(
                turns.pictures[turned, name, angle],
                name,
                f"error {errors[turned, name, angle]:.1f}"
                if name != TRUTH
                else f"{turned} turned by {angle}°"
                if angle
                else "as photographed",
            )
            for name in (TRUTH, *METHODS)
        ]
        rows.append(side_by_side(panels, np.ones(panels[0].color.shape[:2], bool)))
    texbake.write_image(np.concatenate(rows), folder / "orange_angles.png", color=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
