"""Primary rays of a bake: the tree, the rays and the hits, against an older checkout of texbake.

    python tests/benchmarks/bench_rays.py [--peer FOLDER] [--triangles N ...] [--sizes S ...]

A displaced sphere is cast onto about 512 triangles, one ray per texel. Each program runs in a
process of its own; what is measured is its processor time, user and system, from both meshes in
memory to all hits. The rounds of both take turns, and the least of each counts. `--peer` is a
folder with an older checkout; with it, the last columns are the share of the rays that hit the same
face, and the old time over the new. Prints a table in Markdown.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

HERE = Path(__file__).parents[2]
CHILD = """
import json, sys, time
import numpy as np
from texbake.baking.rays import RayField
from texbake.baking.texels import SampleGrid, owned_samples, rasterize_uv, snap_uvs
from texbake.mesh.frame import LocalFrame
from texbake.mesh.shapes import uv_sphere
from texbake.parallel import run_bands
from texbake.raycast.scene import RayScene

side, size, out = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3]

def samples_of(low, size):
    grid = SampleGrid(size, size, 1)
    faces = snap_uvs(low, grid)
    return owned_samples(rasterize_uv(faces, grid)[0], faces, grid, 0), grid

def cast(high, frame, field, samples, grid, clock):
    scene = RayScene.build(high, frame)
    tree = clock()
    field.layout
    faces = np.empty(len(samples), dtype=np.int32)
    def cast_some(start, stop):
        some = samples.where(slice(start, stop))
        rays = field.rays(some, threads=1)
        found = scene.cast_band(rays, field.places(some, grid), cull_back_faces=True)
        faces[start:stop] = found.faces
    run_bands(cast_some, len(samples), band=1 << 14)
    return faces, tree

low = uv_sphere(16, 17)
def run(side, size):
    high = uv_sphere(side, side, lambda t, p: 1 + 0.02 * np.sin(9 * t) * np.sin(11 * p))
    frame = LocalFrame.around(high, low)
    samples, grid = samples_of(low, size)
    field = RayField(low, frame, kind="smooth", front=0.1, back=0.1)
    start = time.process_time()
    faces, tree = cast(high, frame, field, samples, grid, time.process_time)
    return high, samples, faces, tree - start, time.process_time() - start

run(20, 64)  # compiles what is compiled when first called
high, samples, faces, tree, total = run(side, size)
order = np.argsort(samples.texel_ids, kind="stable")
np.save(out, faces[order])
print(json.dumps({"triangles": high.n_faces, "rays": len(faces), "tree": tree, "total": total}))
"""


def measure(checkout: Path, side: int, size: int, out: Path) -> dict[str, Any]:
    """Run one program once; return what it printed."""
    done = subprocess.run(
        [sys.executable, "-c", CHILD, str(side), str(size), str(out)],
        cwd=checkout,  # which Python searches first
        env={**os.environ, "PYTHONPATH": str(checkout)},
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise SystemExit(f"bench_rays: {checkout}: {done.stderr[-2000:]}")
    result: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return result


def row(checkouts: list[Path], side: int, size: int, rounds: int, folder: Path) -> list[str]:
    """One row of the table."""
    import numpy as np

    runs: list[list[dict[str, Any]]] = [[] for _ in checkouts]
    files = [folder / f"{i}.npy" for i in range(len(checkouts))]
    for _ in range(rounds):
        for checkout, file, done in zip(checkouts, files, runs, strict=True):
            done.append(measure(checkout, side, size, file))
    best = [min(done, key=lambda run: run["total"]) for done in runs]
    cells = [f"{best[0]['triangles']:,}", f"{size}²", f"{best[0]['rays']:,}"]
    for each in best:
        cells += [f"{each['tree']:.2f}", f"{each['total']:.2f}"]
    if len(best) == 2:
        same = float(np.mean(np.load(files[0]) == np.load(files[1])))
        cells += [f"{100.0 * same:.4f} %", f"{best[1]['total'] / best[0]['total']:.2f}"]
    return cells


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--peer", type=Path, help="an older checkout")
    parser.add_argument("--triangles", type=int, nargs="+", default=[100_000, 1_000_000, 4_000_000])
    parser.add_argument("--sizes", type=int, nargs="+", default=[2048, 4096])
    parser.add_argument("--rounds", type=int, default=2)
    options = parser.parse_args()
    checkouts = [HERE] if options.peer is None else [HERE, options.peer]
    head = ["triangles", "texture", "rays", "tree, s", "tree, rays and hits, s"]
    if options.peer is not None:
        head += ["tree before", "all before", "same face", "ratio"]
    print("|", " | ".join(head), "|")
    print("|" + "---|" * len(head))
    with tempfile.TemporaryDirectory() as folder:
        for n in options.triangles:
            for size in options.sizes:
                side = math.isqrt(n // 2)
                cells = row(checkouts, side, size, options.rounds, Path(folder))
                print("|", " | ".join(cells), "|", flush=True)


if __name__ == "__main__":
    main()
