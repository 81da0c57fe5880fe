"""What the main job costs, from file to file, beside other programs in the same run.

    python tests/benchmarks/bench_main_job.py [--runs 3] [--slow-peers] [--sizes 2048 4096]

A sphere of 3,996,000 triangles as binary PLY is baked onto 512 triangles as OBJ: normal map,
16-bit PNG, 16 texels of padding, one ray per texel. Every bake runs in a process of its own. "File
to file" is reading the meshes, baking and writing the map, with the program loaded and its kernels
compiled; below it stands the whole process. Blender runs where TEXBAKE_BLENDER_PYTHON names a
Python with bpy 5.0.1. `--slow-peers` adds pymeshlab, which takes minutes.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
DISTANCE, PADDING = 0.1, 16


def radius(theta, phi):
    return 1 + 0.02 * np.sin(40 * theta) * np.sin(40 * phi)


def make_meshes(folder):
    import texbake
    from texbake.mesh.shapes import grid_sphere, uv_sphere

    high = grid_sphere(1000, 2000, radius)
    texbake.write_mesh(
        high.replace(positions=high.positions.astype(np.float32)), folder / "high.ply"
    )
    texbake.write_mesh(uv_sphere(17, 16), folder / "low.obj")


def run_process(command, **environment):
    """Wall-clock seconds of one process, and its output."""
    start = time.perf_counter()
    process = subprocess.Popen(
        [str(word) for word in command],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env={**os.environ, **environment},
    )
    output = process.communicate()[0]
    if process.returncode:
        raise SystemExit(f"this failed: {' '.join(map(str, command))}")
    return time.perf_counter() - start, output


def bake_with(python, script, folder, size, **environment):
    """Seconds of import, bake and save, seconds of the whole process, and its peak memory."""
    command = [
        python, HERE / script, folder / "high.ply", folder / "low.obj", folder / "map.png",
        size, DISTANCE, PADDING,
    ]  # fmt: skip
    whole, output = run_process(command, **environment)
    figures = json.loads(output.decode().strip().splitlines()[-1])
    return figures["import"] + figures["bake"] + figures["save"], whole, figures["peak"]


def texbake_bake(folder, size, **environment):
    return bake_with(sys.executable, "texbake_bake.py", folder, size, **environment)


def blender_bake(folder, size):
    return bake_with(os.environ["TEXBAKE_BLENDER_PYTHON"], "blender_bake.py", folder, size)


def pymeshlab_transfer(folder, size):
    """Bake alone, without reading and writing the meshes."""
    import pymeshlab

    meshes = pymeshlab.MeshSet()
    meshes.load_new_mesh(str(folder / "low.obj"))
    meshes.load_new_mesh(str(folder / "high.ply"))
    start = time.perf_counter()
    meshes.transfer_attributes_to_texture_per_vertex(
        sourcemesh=1, targetmesh=0, attributeenum="Vertex Normal", textname="pymeshlab.png",
        textw=size, texth=size, overwrite=False,
    )  # fmt: skip
    return time.perf_counter() - start


def texbake_bake_alone(folder, size):
    import texbake

    high, low = texbake.read_mesh(folder / "high.ply"), texbake.read_mesh(folder / "low.obj")
    options = texbake.BakeOptions(size=size, front=DISTANCE, back=DISTANCE, padding=PADDING)
    start = time.perf_counter()
    texbake.bake(high, low, options)
    return time.perf_counter() - start


def texbake_simplify(folder):
    import texbake

    mesh = texbake.read_mesh(folder / "high.ply")
    start = time.perf_counter()
    reached = texbake.simplify(mesh, 500).n_faces
    return time.perf_counter() - start, reached


def pymeshlab_simplify(folder):
    import pymeshlab

    meshes = pymeshlab.MeshSet()
    meshes.load_new_mesh(str(folder / "high.ply"))
    start = time.perf_counter()
    meshes.meshing_decimation_quadric_edge_collapse(targetfacenum=500)
    return time.perf_counter() - start


def column(runs, place):
    return [run[place] for run in runs]


def row(name, ours, peer, reach):
    """One row: medians, spreads, and the peer's time over ours."""
    mine = f"{statistics.median(ours):7.2f} s ({min(ours):.2f} to {max(ours):.2f})"
    if not peer:
        print(f"{name:<34} {mine:<26} {'not run':<26} {'':>8}  {reach}")
        return
    theirs = f"{statistics.median(peer):7.2f} s ({min(peer):.2f} to {max(peer):.2f})"
    ratio = statistics.median(peer) / statistics.median(ours)
    print(f"{name:<34} {mine:<26} {theirs:<26} {ratio:7.1f}x  {reach}")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--sizes", type=int, nargs="*", default=[2048, 4096])
    parser.add_argument("--slow-peers", action="store_true")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        make_meshes(folder)
        measure(folder, arguments)


def measure(folder, arguments):
    print(f"{'':<34} {'texbake':<26} {'peer':<26} {'':>8}  reach")
    cold = texbake_bake(folder, 2048, NUMBA_CACHE_DIR=str(folder / "cache"))[1]
    warm = [texbake_bake(folder, 2048) for _ in range(2)][-1][1]
    for size in arguments.sizes:
        ours, blender = [], []
        for _ in range(arguments.runs):  # interleaved, so that both meet the same noise
            ours.append(texbake_bake(folder, size))
            if "TEXBAKE_BLENDER_PYTHON" in os.environ:
                blender.append(blender_bake(folder, size))
        reach = {2048: "5x", 4096: "7x"}.get(size, "")
        row(f"{size}², file to file, to Blender", column(ours, 0), column(blender, 0), reach)
        row("  with the start of the process", column(ours, 1), column(blender, 1), "")
        memory = [f"{max(column(runs, 2)) / 1e9:.2f} GB" for runs in (ours, blender) if runs]
        print(f"{'  peak memory':<34} {'   '.join(memory)}")
    print(f"{'first run ever':<34} {cold - warm:7.2f} s more than the others; reach 12 s")
    alone = [texbake_bake_alone(folder, 2048) for _ in range(arguments.runs)]
    simplified = [texbake_simplify(folder) for _ in range(arguments.runs)]
    slow = arguments.slow_peers
    row(
        "bake alone 2048², to pymeshlab",
        alone,
        [pymeshlab_transfer(folder, 2048)] if slow else [],
        "15x",
    )
    row(
        f"simplify to {simplified[0][1]}, to pymeshlab",
        [seconds for seconds, _ in simplified],
        [pymeshlab_simplify(folder)] if slow else [],
        "12x",
    )


if __name__ == "__main__":
    main()
