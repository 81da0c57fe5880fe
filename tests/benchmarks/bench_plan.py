"""What an effect costs a scene that does not call for it.

    python tests/benchmarks/bench_plan.py [--runs 41] [--threads 1] [--size 640 360]

An unlit sphere of one color is drawn with all effects, with a list that lacks one effect that it
does not call for, and with only the effects that it calls for. The pictures take turns after a
first round that does not count. Prints a table in Markdown: the median time without the effect,
and the ratio of the medians with and without it; 1.00 is no cost. The last column is the spread of
one list against itself: the first half of its pictures against the second.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Sequence

from texbake.mesh.shapes import uv_sphere
from texbake.rendering.camera import Camera
from texbake.rendering.draw import (
    Prepared,
    draw,
    plan_of,
    prepare,
)
from texbake.rendering.effect import Effect
from texbake.rendering.effects import EFFECTS
from texbake.rendering.options import RenderOptions
from texbake.rendering.scene.material import Material
from texbake.rendering.scene.scene import Scene, SceneObject


def timed(prepared: Prepared, camera: Camera) -> float:
    """Seconds of one picture, of all threads."""
    start = time.process_time()
    draw(prepared, camera)
    return time.process_time() - start


def compared(
    scene: Scene, options: RenderOptions, effects: Sequence[Effect], runs: int, threads: int
) -> tuple[list[float], list[float]]:
    """Seconds of pictures with all effects, and with fewer, in turns."""
    full, fewer = (
        prepare(scene, options, effects=chosen, threads=threads) for chosen in (EFFECTS, effects)
    )
    camera = Camera.framing(scene.objects[0].mesh, options=options)
    with_all: list[float] = []
    without: list[float] = []
    timed(full, camera), timed(fewer, camera)
    for run in range(runs):
        pair = [(full, with_all), (fewer, without)]
        for prepared, seconds in pair if run % 2 == 0 else reversed(pair):
            seconds.append(timed(prepared, camera))
    return with_all, without


def row(name: str, with_all: list[float], without: list[float]) -> str:
    """Return a line of the table."""
    ratio = statistics.median(with_all) / statistics.median(without)
    spread = statistics.median(without[::2]) / statistics.median(without[1::2])
    return f"| {name} | {1e3 * statistics.median(without):.2f} | {ratio:.3f} | {spread:.3f} |"


def main() -> None:
    """Run all comparisons and print them."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--runs", type=int, default=41)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--size", type=int, nargs=2, default=(640, 360))
    arguments = parser.parse_args()
    width, height = arguments.size
    options = RenderOptions(width=width, height=height)
    material = Material(shading="unlit", base_color=(0.8, 0.4, 0.2))
    scene = Scene(objects=(SceneObject(mesh=uv_sphere(64, 128), material=material),))
    camera = Camera.framing(scene.objects[0].mesh, options=options)
    plan = plan_of(prepare(scene, options), camera)
    used = {item.name for item in plan.passes}
    print("| without | ms | with all / without | of itself |\n|---|---|---|---|")
    for name in [effect.name for effect in EFFECTS if effect.name not in used]:
        fewer = tuple(effect for effect in EFFECTS if effect.name != name)
        print(row(name, *compared(scene, options, fewer, arguments.runs, arguments.threads)))
    bare = tuple(effect for effect in EFFECTS if effect.name in used)
    print(
        row(
            f"all but {', '.join(effect.name for effect in bare)}",
            *compared(scene, options, bare, arguments.runs, arguments.threads),
        )
    )


if __name__ == "__main__":
    main()
