"""All maps without secondary rays in one bake, against the normal map alone.

    python tests/benchmarks/bench_maps.py [PAIR ...] [--rounds N] [--size PX ...] [--samples N]

The high-poly mesh of a pair gets colors, texture coordinates, an image and groups, so that every
map has values. Bakes take turns. The time is the processor time of one thread, the fastest of the
rounds: of the bake alone, from meshes in memory to maps in memory, and with all maps written as
PNG. Prints tables in Markdown: the two bakes, and what each map adds.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from pathlib import Path

import numpy as np

import texbake
from texbake.baking.bake import bake
from texbake.baking.maps import MAPS
from texbake.mesh.materials import Materials

DATA = Path(os.environ.get("TEXBAKE_DATA", Path(__file__).parents[3] / "shared" / "data"))
PAIRS = ("koala", "skull")
ALL = tuple(
    name for name, kind in MAPS.items() if kind.needs == "hits" and name != "world-position"
)
GROUPS = 7
REACH = 1.4


def equipped(mesh):
    """Give a mesh colors, texture coordinates and groups, and materials with an image."""
    least, greatest = mesh.bounds
    shares = (mesh.positions - least) / (greatest - least)
    mesh = mesh.replace(
        colors=shares.astype(np.float32),
        uvs=shares[:, :2],
        uv_faces=mesh.faces,
        face_groups=(np.arange(mesh.n_faces) * GROUPS // mesh.n_faces).astype(np.int32),
        group_names=tuple(f"part {i}" for i in range(GROUPS)),
    )
    return mesh, Materials.of_image(mesh, DATA / "textures" / "earth.ppm")


def seconds_of(meshes, materials, maps, **options):
    """Seconds of a bake, and of writing its maps."""
    options = texbake.BakeOptions(maps=maps, threads=1, **options)
    start = time.process_time()
    result = bake(*meshes, options, materials=materials)
    made = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        result.write(folder)
    return made - start, time.process_time() - made


def measure(name, size, samples, n_rounds):
    """Least seconds of each set of maps: baked, and written."""
    folder = DATA / "pairs" / name
    high, materials = equipped(texbake.read_mesh(folder / "high.obj"))
    low = texbake.read_mesh(folder / "low_uv.obj")
    sets = {"normal": ("normal",), "all": ALL}
    sets |= {f"+ {other}": ("normal", other) for other in ALL[1:]}
    times = {label: [] for label in sets}
    for _ in range(n_rounds + 1):  # the first compiles
        for label, maps in sets.items():
            pair = seconds_of((high, low), materials, maps, size=size, samples=samples)
            times[label].append(pair)
    return {label: np.min(found[1:], axis=0) for label, found in times.items()}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("pairs", nargs="*", default=PAIRS)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--size", type=int, nargs="+", default=[1024, 2048])
    parser.add_argument("--samples", type=int, default=1)
    options = parser.parse_args()
    print(f"{len(ALL)} maps: {', '.join(ALL)}\n")
    print("| pair | size | normal s | all s | times | with files, normal s | all s | times |")
    print("|---|---|---|---|---|---|---|---|")
    added = {}
    for name in options.pairs:
        for size in options.size:
            found = measure(name, size, options.samples, options.rounds)
            (one, one_written), (everything, all_written) = found["normal"], found["all"]
            whole, all_whole = one + one_written, everything + all_written
            added[f"{name} {size}"] = {
                label: seconds[0] - one for label, seconds in found.items() if label[0] == "+"
            }
            print(
                f"| {name} | {size} | {one:.3f} | {everything:.3f} | {everything / one:.2f} "
                f"| {whole:.3f} | {all_whole:.3f} | {all_whole / whole:.2f} |"
            )
    print(f"\nTo reach: all maps in at most {REACH} times the time of the normal map, baked.\n")
    print("| added to the normal map, ms | " + " | ".join(added) + " |")
    print("|---" * (1 + len(added)) + "|")
    for label in next(iter(added.values())):
        cells = " | ".join(f"{1e3 * column[label]:.0f}" for column in added.values())
        print(f"| {label[2:]} | {cells} |")


if __name__ == "__main__":
    main()
