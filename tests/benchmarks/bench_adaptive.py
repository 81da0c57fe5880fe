"""Error against time of fixed and adaptive samples, on the real pairs.

    python tests/benchmarks/bench_adaptive.py [PAIR ...] [--rounds N] [--size PX]

The error is the angle to a bake with 64 rays per texel, over the texels that both cover. The time
is the processor time of one thread, the fastest of several interleaved rounds. Ray distances are
given, so they are not measured each time. Prints two tables in Markdown: every setting; and for
each measure of the error, the time and the rays that reach the error of 16 rays per texel, as
shares of their cost. Between two bounds the error is taken to fall as a power of the cost. The
check of the error, 1 % of the texels, is part of the time.
"""

from __future__ import annotations

import argparse
import os
import time
from pathlib import Path

import numpy as np

import texbake

DATA = Path(os.environ.get("TEXBAKE_DATA", Path(__file__).parents[3] / "shared" / "data"))
PAIRS = ("koala", "skull", "spot", "penguin")
BOUNDS = ("4deg", "2deg", "1deg", "0.7deg", "0.5deg", "0.35deg", "0.25deg", "0.12deg",
          "0.06deg", "0.03deg")  # fmt: skip
FIGURES = ("mean", "rms", "99 %", "99.9 %", "greatest")


def degrees_apart(result, truth):
    """Angle between a bake and the reference for each texel that both cover."""
    both = result.has_data & truth.has_data
    a, b = (bake.maps["normal"].values[both].astype(float) for bake in (result, truth))
    return np.degrees(2 * np.arcsin(np.minimum(np.linalg.norm(a - b, axis=1) / 2, 1)))


def figures_of(degrees):
    """Mean, root mean square, percentiles and maximum."""
    return (degrees.mean(), np.sqrt((degrees**2).mean()), *np.percentile(degrees, [99, 99.9, 100]))


def measure(name, size, n_rounds):
    """Seconds, rays per texel and errors of every setting."""
    folder = DATA / "pairs" / name
    high, low = texbake.read_mesh(folder / "high.obj"), texbake.read_mesh(folder / "low_uv.obj")
    reach = texbake.bake(high, low, texbake.BakeOptions(size=64)).report
    same = {"size": size, "front": reach.front, "back": reach.back, "threads": 1}
    truth = texbake.bake(high, low, texbake.BakeOptions(**same, samples=64))
    settings = {f"{n}": {"samples": n} for n in (1, 4, 16)}
    settings |= {bound: {"max_error": bound} for bound in BOUNDS}
    seconds = {setting: [] for setting in settings}
    rows = {}
    for _ in range(n_rounds):
        for setting, changes in settings.items():
            start = time.process_time()
            result = texbake.bake(high, low, texbake.BakeOptions(**same, **changes))
            seconds[setting].append(time.process_time() - start)
            rays = result.report.counts.rays_cast / truth.has_data.sum()
            rows[setting] = (rays, *figures_of(degrees_apart(result, truth)))
    return {setting: (min(seconds[setting]), *row) for setting, row in rows.items()}


def print_tables(name, rows):
    """Print every setting, and what equals 16 rays per texel."""
    full = rows["16"][0]
    print(f"\n{name}\n\n| samples | seconds | of 16 | rays per texel | {' | '.join(FIGURES)} |")
    print("|---" * (4 + len(FIGURES)) + "|")
    for setting, (seconds, rays, *errors) in rows.items():
        columns = " | ".join(f"{error:.3g}°" for error in errors)
        print(f"| {setting} | {seconds:.2f} | {seconds / full:.2f} | {rays:.2f} | {columns} |")
    print("\n| error as of 16 samples | time of 16 | rays of 16 |\n|---|---|---|")
    for i, figure in enumerate(FIGURES):
        errors = [rows[bound][2 + i] for bound in BOUNDS]
        shares = [
            share_at(errors, [rows[bound][column] / rows["16"][column] for bound in BOUNDS], goal)
            for column, goal in ((0, rows["16"][2 + i]), (1, rows["16"][2 + i]))
        ]
        print(f"| {figure} | {shares[0]} | {shares[1]} |")


def share_at(errors, shares, goal):
    """Share of the cost at which the error falls to a goal, as text."""
    if errors[0] <= goal:
        return f"below {shares[0]:.2f}"
    for k in range(1, len(errors)):
        if errors[k] <= goal:
            part = np.log(errors[k - 1] / goal) / np.log(errors[k - 1] / errors[k])
            return f"{shares[k - 1] * (shares[k] / shares[k - 1]) ** part:.2f}"
    return "not reached"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("pairs", nargs="*", default=PAIRS)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--size", type=int, default=1024)
    arguments = parser.parse_args()
    for name in arguments.pairs:
        print_tables(name, measure(name, arguments.size, arguments.rounds))


if __name__ == "__main__":
    main()
