"""Error against time of pictures with fixed and adaptive samples, on scenes of `samples/`.

    python tests/benchmarks/bench_picture_samples.py [SCENE ...] [--rounds N] [--width PX]

The error is the greatest difference in any channel of the sRGB-coded picture, in steps of 255,
over the pixels that show a surface, from 13 x 13 plus 15 x 15 shaded samples per pixel. No setting
has any of these samples but the middle one. The time is the processor time of one thread, the
fastest of the interleaved rounds, with the check of 1 % of the pixels. Prints tables in Markdown:
every setting; and for each measure of the error and each bound, the cheapest fixed setting that is
not worse, with its time as a multiple of the adaptive picture's.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

import texbake
from texbake.jobs.preview_scene import with_lighting
from texbake.progress import Stages
from texbake.rendering.adaptive_pixels.pixel_statistics import PixelSums
from texbake.rendering.adaptive_pixels.sampler import PixelSampler, Sides
from texbake.rendering.draw import lay_out, prepare
from texbake.rendering.request import RenderRequest
from texbake.rendering.scene.scene import camera_of
from texbake.texture.encoding import encode_srgb

SCENES = Path(__file__).parents[2] / "samples" / "scenes"
NAMES = ("orange_bump", "shadow_spot", "reflection", "transparency", "normal_map", "checker")
BOUNDS = ("16/255", "8/255", "4/255", "2/255", "1/255")
FIXED = [(side, edges) for edges in ("multisample", "supersample") for side in (1, 2, 4, 8, 16)]
TRUTH = (13, 15)
FIGURES = ("rms", "99 %", "99.9 %", "greatest")


def truth_of(scene, options):
    """Light (H, W, 3) of 394 samples per pixel, and which pixels show a surface."""
    asked = replace(options, max_error=0.5)
    request = RenderRequest(scene, asked, camera_of(scene, asked))
    state = lay_out(prepare(scene, asked), request, Stages(), all_objects=True)
    grids = [PixelSums.empty(options.height, options.width) for _ in TRUTH]
    for sums, side in zip(grids, TRUTH, strict=True):
        PixelSampler(state).take(np.ones(sums.counts.shape, bool), Sides(side, side), sums)
    light = sum(sums.light[..., :3] for sums in grids) / sum(side**2 for side in TRUTH)
    return light, grids[-1].coverage > 0.0


def figures_of(color, truth, shows):
    """Root mean square, percentiles and maximum."""
    off = np.abs(encode_srgb(color[..., :3]) - encode_srgb(truth)).max(axis=-1)[shows]
    return 255.0 * np.array([np.sqrt((off**2).mean()), *np.percentile(off, [99, 99.9, 100])])


def measure(name, width, n_rounds):
    """Seconds, shadings per pixel and errors of every setting."""
    scene = with_lighting(texbake.read_scene(SCENES / f"{name}.toml"))
    own = scene.options(interpolation="perspective", buffer=None)
    options = replace(own, width=width, height=max(1, width * own.height // own.width))
    truth, shows = truth_of(scene, options)
    settings = {
        f"{side} x {side} {edges}": replace(options, supersampling=side, edges=edges)
        for side, edges in FIXED
    }
    settings |= {bound: replace(options, max_error=bound) for bound in BOUNDS}
    seconds = {setting: [] for setting in settings}
    rows = {}
    for _ in range(n_rounds):
        for setting, changed in settings.items():
            start = time.process_time()
            frame = texbake.render_scene(scene, changed, threads=1)
            seconds[setting].append(time.process_time() - start)
            shadings = frame.sampling.shadings_per_pixel if frame.sampling else np.nan
            rows[setting] = (shadings, *figures_of(frame.color, truth, shows))
    return {setting: (min(seconds[setting]), *row) for setting, row in rows.items()}


def print_tables(name, rows):
    """Print every setting, and the fixed setting that equals each bound."""
    print(f"\n{name}\n\n| setting | seconds | shadings | {' | '.join(FIGURES)} |")
    print("|---" * (3 + len(FIGURES)) + "|")
    for setting, (seconds, shadings, *errors) in rows.items():
        columns = " | ".join(f"{error:.3g}" for error in errors)
        print(f"| {setting} | {seconds:.2f} | {shadings:.2f} | {columns} |")
    print(f"\n| bound | {' | '.join(FIGURES)} |\n" + "|---" * (1 + len(FIGURES)) + "|")
    fixed = [setting for setting in rows if setting not in BOUNDS]
    for bound in BOUNDS:
        cells = []
        for i in range(len(FIGURES)):
            equal = [s for s in fixed if rows[s][2 + i] <= rows[bound][2 + i]]
            best = min(equal, key=lambda s: rows[s][0], default=None)
            cells.append(
                "not reached" if best is None else f"{rows[best][0] / rows[bound][0]:.2f} ({best})"
            )
        print(f"| {bound} | {' | '.join(cells)} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", nargs="*", default=NAMES)
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--width", type=int, default=480)
    arguments = parser.parse_args()
    for name in arguments.scenes:
        print_tables(name, measure(name, arguments.width, arguments.rounds))


if __name__ == "__main__":
    main()
