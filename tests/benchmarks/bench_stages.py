"""Where the time of a bake goes, and how near each stage is to what the machine can do: a roofline.

    python tests/benchmarks/bench_stages.py [--triangles N] [--sizes S ...] [--rounds N] [--page]

A displaced sphere, as binary PLY, is baked onto 512 triangles: a normal map as 16-bit PNG with 16
texels of padding. All seconds are processor time of one thread, the least of the rounds. The
machine is measured in the same run: the bandwidth of a copy of arrays far larger than the caches,
as STREAM has it, and the operations of a product of matrices in float64.

The bytes of a stage are those that it must move at the least: all that goes in and all that comes
out, once. The operations are estimates, from counts of the inner loops (`OPERATIONS`). The greater
of the two shares says what bounds a stage; where both are low, it is bound by what neither counts:
cache misses, branches, integers, or Python. Prints a table in Markdown; `--page` puts it into
docs/explanation/performance.md.
"""

from __future__ import annotations

import os

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # before numpy is loaded

import argparse
import math
import platform
import re
import tempfile
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np

import texbake
from texbake import progress
from texbake.mesh.shapes import grid_sphere, uv_sphere

PAGE = Path(__file__).parents[2] / "docs" / "explanation" / "performance.md"
MARKS = ("<!-- bench_stages -->", "<!-- /bench_stages -->")
COPIED = 256 << 20
MATRIX = 768
# Arithmetic operations in floating point of one item. A triangle: its corners into the local frame,
# its Morton code, a box. A ray: position and direction from the low-poly corners, its share of the
# nodes and triangles that its bundle tests, 2.7 exact tests of 60 each. A hit: the normal of the
# high-poly mesh, the tangent frame, its inverse. A texel that is written: scale and round.
OPERATIONS = {"triangle": 60, "ray": 430, "hit": 130, "texel": 9}


def seconds_of(work):
    """Processor seconds of a call."""
    start = time.process_time()
    work()
    return time.process_time() - start


def measure_machine(rounds):
    """Bytes per second of a copy, read and written, and operations per second of one thread."""
    source, target = np.ones(COPIED, np.uint8), np.empty(COPIED, np.uint8)
    matrix = np.ones((MATRIX, MATRIX))
    copy = min(seconds_of(lambda: np.copyto(target, source)) for _ in range(2 * rounds + 1))
    product = min(seconds_of(lambda: matrix @ matrix) for _ in range(4 * rounds + 1))
    return 2 * COPIED / copy, 2 * MATRIX**3 / product


def processor():
    """Name of the processor."""
    try:
        found = re.search(r"model name\s*: (.*)", Path("/proc/cpuinfo").read_text("utf-8"))
    except OSError:
        found = None
    return found[1].strip() if found else platform.processor()


def bake_once(folder, size):
    """Processor seconds of each stage of one bake from file to file, and what it worked on."""
    options = texbake.BakeOptions(size=size, front=0.1, back=0.1, padding=16, bits=16, threads=1)
    seconds, files = {}, (folder / "high.ply", folder / "low.obj")
    start = time.process_time()
    high, low = map(texbake.read_mesh, files)
    seconds["read"] = time.process_time() - start
    result = texbake.bake(high, low, options)
    stages = {record.name: record.seconds for record in result.report.stages}
    seconds["tree"] = stages.pop("build ray tree")
    seconds["pad"] = stages.pop("pad")
    seconds["maps"] = stages.pop("make maps")
    seconds["rays and hits"] = sum(stages.values())
    out = folder / "map.png"
    whole = seconds_of(lambda: result.write(out))
    content = out.read_bytes()
    seconds["write"] = seconds_of(lambda: (folder / "copy.png").write_bytes(content))
    seconds["encode"] = max(whole - seconds["write"], 0.0)
    counts = {
        "triangle": high.n_faces,
        "ray": result.report.counts.rays_cast,
        "hit": result.report.counts.rays_cast,
        "texel": size * size,
        "vertex": high.n_vertices,
        "read": sum(path.stat().st_size for path in files),
        "written": len(content),
    }
    return seconds, counts


def moved_bytes(counts):
    """Bytes that go into each stage and come out of it."""
    mesh = 24 * counts["vertex"] + 12 * counts["triangle"]
    # A leaf of eight holds 9 float64 and a face number for each, a node 6 float32 for each of 8.
    tree = (72 + 4 + 24 / 7) * counts["triangle"]
    hits = (4 + 4 + 4 + 8 + 8 + 12) * counts["hit"]  # texel, faces, barycentrics, offset
    values = 12 * counts["texel"]
    return {
        "read": counts["read"] + mesh,
        "tree": mesh + tree,
        "rays and hits": tree + hits,
        "maps": hits + 12 * counts["vertex"] + values,
        "pad": 2 * values,
        "encode": values + counts["written"],
        "write": 2 * counts["written"],
    }


def operations(counts):
    """Arithmetic operations of each stage that has any."""
    items = {"tree": "triangle", "rays and hits": "ray", "maps": "hit", "encode": "texel"}
    return {stage: OPERATIONS[item] * counts[item] for stage, item in items.items()}


def rows(seconds, counts, bandwidth, arithmetic):
    """Rows of the table of one size."""
    moved, done = moved_bytes(counts), operations(counts)
    for stage, bytes_ in moved.items():
        taken = max(seconds[stage], 1e-9)
        share = f"{done[stage] / taken / arithmetic:.0%}" if stage in done else ""
        count = f"{done[stage] / 1e9:.2f}" if stage in done else ""
        yield (
            f"| {stage} | {taken:.3f} | {bytes_ / 1e6:.0f} | {bytes_ / taken / bandwidth:.0%} "
            f"| {count} | {share} |"
        )
    whole = sum(seconds.values())
    at_best = sum(
        max(moved[stage] / bandwidth, done.get(stage, 0.0) / arithmetic) for stage in moved
    )
    yield f"| all | {whole:.3f} | {sum(moved.values()) / 1e6:.0f} | | | |"
    yield (
        f"\nAt the machine's limits, all stages together would take {at_best:.2f} s, "
        f"{whole / at_best:.1f} times less."
    )


def report(folder, options):
    """Text of all tables."""
    bandwidth, arithmetic = measure_machine(options.rounds)
    yield (
        f"One thread of {processor()} copies {bandwidth / 1e9:.1f} GB/s, read and written,\n"
        f"and does {arithmetic / 1e9:.0f} billion operations in float64 per second."
    )
    for size in options.sizes:
        found = [bake_once(folder, size) for _ in range(options.rounds)]
        best = {stage: min(seconds[stage] for seconds, _ in found) for stage in found[0][0]}
        counts = found[0][1]
        yield f"\n{counts['triangle']:,} triangles at {size}², {counts['ray']:,} rays:\n"
        yield "| stage | seconds | MB moved | of the bandwidth | billion operations | of the peak |"
        yield "|---|---|---|---|---|---|"
        yield from rows(best, counts, bandwidth, arithmetic)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--triangles", type=int, default=4_000_000)
    parser.add_argument("--sizes", type=int, nargs="+", default=[2048, 4096])
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--page", action="store_true", help="put the tables into the docs")
    options = parser.parse_args()
    if hasattr(os, "sched_setaffinity"):  # readers take no number of threads
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    progress.time = SimpleNamespace(perf_counter=time.process_time)  # of the stages of a bake
    with tempfile.TemporaryDirectory() as name:
        folder, n_rows = Path(name), math.isqrt(options.triangles // 4)
        high = grid_sphere(
            n_rows, 2 * n_rows, lambda t, p: 1 + 0.02 * np.sin(40 * t) * np.sin(40 * p)
        )
        high = high.replace(positions=high.positions.astype(np.float32))
        texbake.write_mesh(high, folder / "high.ply")
        texbake.write_mesh(uv_sphere(17, 16), folder / "low.obj")
        text = "\n".join(report(folder, options))
    print(text)
    if options.page:
        old = PAGE.read_text(encoding="utf-8")
        new = f"{MARKS[0]}\n\n{text}\n\n{MARKS[1]}"
        pattern = f"{re.escape(MARKS[0])}.*{re.escape(MARKS[1])}"
        PAGE.write_text(re.sub(pattern, lambda _: new, old, flags=re.DOTALL), encoding="utf-8")


if __name__ == "__main__":
    main()
