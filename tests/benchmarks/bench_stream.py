"""A bake of a high-poly mesh that stays in its file: rate, and peak memory.

    python tests/benchmarks/bench_stream.py [--triangles N ...] [--size S] [--max-memory M]
                                            [--maps NAME ...] [--measured] [--folder FOLDER]

A displaced sphere is written as a binary PLY file by blocks: 100 million triangles take 1.9 GB. It
is baked onto about 512 triangles, in a process of its own, from files to files. The rate is in
triangles per second of the whole process; memory is its peak resident memory. Ray distances are
given, unless `--measured`, which reads the file twice more. Prints a table in Markdown.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

CHILD = """
import json, sys, time
from texbake.baking.options import BakeOptions
from texbake.jobs.maps import bake_files
from texbake.progress import peak_memory_bytes

folder, size, limit, distance, *maps = sys.argv[1:]
distance = float(distance) or None
options = BakeOptions(size=int(size), max_memory=limit, front=distance, back=distance)
files = {name: f"{folder}/{name}.png" for name in maps}
done = bake_files(f"{folder}/high.ply", f"{folder}/low.obj", files, options)
stages = {stage.name: stage.seconds for stage in done.report.stages}
print(json.dumps({
    "peak": peak_memory_bytes(), "missed": done.report.texels_missed, "stages": stages,
    "cpu": time.process_time(),
}))
"""


def write_sphere(path: Path, n_triangles: int) -> int:
    """Write a displaced unit sphere by rows; return its number of triangles."""
    side = math.isqrt(n_triangles // 2)
    head = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {(side + 1) * side}\n"
        "property float x\nproperty float y\nproperty float z\n"
        f"element face {2 * side * side}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    around = np.arange(side) * (2.0 * np.pi / side)
    here = np.arange(side, dtype=np.int32)
    beside = np.roll(here, -1)
    rows = np.empty((2, side), dtype=[("count", "u1"), ("vertices", "<i4", 3)])
    rows["count"] = 3
    with path.open("wb") as file:
        file.write(head.encode())
        for row in range(side + 1):
            down = np.pi * row / side
            radius = 1.0 + 0.02 * np.sin(9 * down) * np.sin(11 * around)
            ring = np.sin(down) * radius
            points = (ring * np.cos(around), radius * np.cos(down), -ring * np.sin(around))
            file.write(np.stack(points, axis=1).astype("<f4").tobytes())
        for first in range(0, side * side, side):
            a, b, c, d = first + here, first + side + here, first + side + beside, first + beside
            rows["vertices"] = np.stack([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
            file.write(rows.tobytes())
    return 2 * side * side


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--triangles", type=int, nargs="+", default=[10_000_000, 100_000_000])
    parser.add_argument("--size", type=int, default=2048)
    parser.add_argument("--max-memory", default="1.5G")
    parser.add_argument("--maps", nargs="+", default=["normal"])
    parser.add_argument("--measured", action="store_true", help="measure the ray distances")
    parser.add_argument("--folder", type=Path, help="for the files, which then stay")
    options = parser.parse_args()
    from texbake.mesh.files import write_mesh
    from texbake.mesh.shapes import uv_sphere

    print("| triangles | texture | seconds | processor | triangles/s | peak memory | missed |")
    print("|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.folder or Path(temporary)
        write_mesh(uv_sphere(16, 17), folder / "low.obj")
        for wanted in options.triangles:
            n = write_sphere(folder / "high.ply", wanted)
            distance = "0" if options.measured else "0.1"
            given = [str(folder), str(options.size), options.max_memory, distance, *options.maps]
            start = time.perf_counter()
            done = subprocess.run(
                [sys.executable, "-c", CHILD, *given], check=True, capture_output=True, text=True
            )
            seconds = time.perf_counter() - start
            found = json.loads(done.stdout)
            print(
                f"| {n:,} | {options.size}² | {seconds:.1f} | {found['cpu']:.1f} "
                f"| {n / seconds / 1e6:.2f} M | {found['peak'] / 1e9:.2f} GB "
                f"| {found['missed']:,} |",
                flush=True,
            )
            print(
                {name: round(taken, 2) for name, taken in found["stages"].items()}, file=sys.stderr
            )


if __name__ == "__main__":
    main()
