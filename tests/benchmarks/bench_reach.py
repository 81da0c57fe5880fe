"""What fitted ray distances cost a bake, beside one distance given by front and back.

    python tests/benchmarks/bench_reach.py [--runs 5] [--size 1024] [--threads 1] [--pairs koala]

Both bake the same normal map. The one distance is the greatest of those fitted, so that both reach
everything. The bakes take turns after a first round that does not count. Prints a table in
Markdown: the median processor seconds with one distance; the median ratio of a bake with fitted
distances to the one beside it, with its least and greatest; the share of rays that were lengthened;
and misses with one distance and with fitted ones. The last column is the noise of the machine: the
ratio of one distance in a round to itself in the round before. The meshes are those of
TEXBAKE_DATA, or of ../shared/data beside the project, and a sphere of 4 million triangles over one
of 510.
"""

from __future__ import annotations

import argparse
import os
import statistics
import time
from pathlib import Path

import texbake
from texbake.baking.report import BakeReport
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import grid_sphere, uv_sphere

DATA = Path(os.environ.get("TEXBAKE_DATA", Path(__file__).parents[3] / "shared" / "data"))
PAIRS = ("koala", "skull", "spot", "penguin")
SPHERE = "sphere"
HEADS = (
    "pair", "triangles", "one distance", "fitted / one", "least to greatest", "lengthened",
    "misses, one", "misses, fitted", "one / one",
)  # fmt: skip


def meshes(name: str) -> tuple[Mesh, Mesh]:
    """High-poly and low-poly mesh of a pair."""
    if name == SPHERE:
        return grid_sphere(1000, 2000), uv_sphere(16, 17)
    folder = DATA / "pairs" / name
    return texbake.read_mesh(folder / "high.obj"), texbake.read_mesh(folder / "low_uv.obj")


def timed(pair: tuple[Mesh, Mesh], options: texbake.BakeOptions) -> tuple[float, BakeReport]:
    """Processor seconds of a bake, of all threads, and its report."""
    start = time.process_time()
    result = texbake.bake(*pair, options)
    return time.process_time() - start, result.report


def row(name: str, size: int, runs: int, threads: int) -> str:
    """Return a line of the table."""
    pair = meshes(name)
    fitted = texbake.BakeOptions(size=size, threads=threads)
    _, report = timed(pair, fitted)
    one = texbake.BakeOptions(size=size, threads=threads, front=report.front, back=report.back)
    _, wide = timed(pair, one)
    seconds: dict[texbake.BakeOptions, list[float]] = {fitted: [], one: []}
    for run in range(runs):
        for options in (fitted, one) if run % 2 == 0 else (one, fitted):
            seconds[options].append(timed(pair, options)[0])
    ratios = [a / b for a, b in zip(seconds[fitted], seconds[one], strict=True)]
    noise = [a / b for a, b in zip(seconds[one][1:], seconds[one], strict=False)]
    cells = (
        name,
        f"{pair[0].n_faces:,}",
        f"{statistics.median(seconds[one]):.2f} s",
        f"{statistics.median(ratios):.2f}",
        f"{min(ratios):.2f} to {max(ratios):.2f}",
        f"{100.0 * report.counts.rays_lengthened / report.counts.rays_cast:.2f} %",
        f"{wide.miss_percent:.3f} %",
        f"{report.miss_percent:.3f} %",
        f"{min(noise, default=1.0):.2f} to {max(noise, default=1.0):.2f}",
    )
    return "| " + " | ".join(cells) + " |"


def main() -> None:
    """Compare all pairs and print them."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--size", type=int, default=1024)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--pairs", nargs="+", default=[*PAIRS, SPHERE])
    arguments = parser.parse_args()
    print("| " + " | ".join(HEADS) + " |")
    print("|" + "---|" * len(HEADS))
    for name in arguments.pairs:
        print(row(name, arguments.size, arguments.runs, arguments.threads), flush=True)


if __name__ == "__main__":
    main()
