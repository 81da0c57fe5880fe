"""Ambient occlusion with 64 rays per texel: seconds and noise, beside Blender in the same run.

    python tests/benchmarks/bench_ao.py [--runs 3] [--pairs koala skull] [--no-noise]

The high-poly meshes have 100,000 triangles. Times are those of the whole bake at 1024², of both
programs in turn, with their code loaded: by the clock, and in parentheses the processor time,
which other work on the machine disturbs less. Noise is the standard deviation from the program's
own map of 4,096 rays. It is measured at 256², because it depends on the scene and the rays and not
on the number of texels. Blender runs where TEXBAKE_BLENDER_PYTHON names a Python with bpy 5.0.1.
The meshes are those of TEXBAKE_DATA, or of ../shared/data beside the project. Prints a table in
Markdown.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np

import texbake

DATA = Path(os.environ.get("TEXBAKE_DATA", Path(__file__).parents[3] / "shared" / "data"))
BLENDER = os.environ.get("TEXBAKE_BLENDER_PYTHON")
DISTANCES = {"koala": 0.2258574, "skull": 0.4077253}
SIZE, NOISE_SIZE, N_RAYS, MANY_RAYS = 1024, 256, 64, 4096


def texbake_ao(name, size, n_rays):
    """Seconds and processor seconds of one bake, the map, and where it has data."""
    folder = DATA / "pairs" / name
    high, low = texbake.read_mesh(folder / "high.obj"), texbake.read_mesh(folder / "low_uv.obj")
    distance = DISTANCES[name]
    options = texbake.BakeOptions(
        size=size, maps=("ao",), secondary_rays=n_rays, rays="vertex", front=distance,
        back=distance, padding=0,
    )  # fmt: skip
    start, spent = time.perf_counter(), time.process_time()
    result = texbake.bake(high, low, options)
    taken = time.perf_counter() - start, time.process_time() - spent
    return taken, result.maps["ao"].values[..., 0], result.has_data


def blender_ao(name, size, n_rays):
    """Seconds and processor seconds of one bake, and the map."""
    folder = DATA / "pairs" / name
    with tempfile.TemporaryDirectory() as temporary:
        out = Path(temporary) / "ao.npy"
        command = [
            BLENDER, Path(__file__).parent / "blender_ao.py", folder / "high.obj",
            folder / "low_uv.obj", out, size, n_rays, DISTANCES[name],
        ]  # fmt: skip
        done = subprocess.run(
            [str(word) for word in command], capture_output=True, text=True, check=True
        )
        seconds, spent = map(float, done.stdout.split()[-2:])
        return (seconds, spent), np.load(out)


def noise(few, many, has_data):
    return float(np.sqrt(np.square(few - many)[has_data].mean()))


def timed(name, runs):
    """Medians of seconds and processor seconds, of texbake and of Blender, in turn."""
    texbake_ao(name, 64, N_RAYS)  # loads the kernels
    ours, theirs = [], []
    for _ in range(runs):
        ours.append(texbake_ao(name, SIZE, N_RAYS)[0])
        if BLENDER:
            theirs.append(blender_ao(name, SIZE, N_RAYS)[0])
    return [np.median(taken, axis=0) for taken in (ours, theirs) if taken]


def noises(name):
    """Noise of texbake's map and of Blender's, and the difference of their references."""
    _, few, has_data = texbake_ao(name, NOISE_SIZE, N_RAYS)
    _, many, _ = texbake_ao(name, NOISE_SIZE, MANY_RAYS)
    found = [noise(few, many, has_data)]
    if BLENDER:
        (_, few), (_, blender_many) = (
            blender_ao(name, NOISE_SIZE, n_rays) for n_rays in (N_RAYS, MANY_RAYS)
        )
        both = has_data & (blender_many > 0)
        found += [noise(few, blender_many, both), noise(many, blender_many, both)]
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--pairs", nargs="+", choices=list(DISTANCES), default=list(DISTANCES))
    parser.add_argument("--no-noise", action="store_true")
    arguments = parser.parse_args()
    heads = ["pair", "texbake"] + ["Blender", "times as fast"] * bool(BLENDER)
    if not arguments.no_noise:
        heads += ["noise"] + ["Blender's noise", "maps of 4096 rays differ by"] * bool(BLENDER)
    print("| " + " | ".join(heads) + " |")
    print("|" + "---|" * len(heads))
    for name in arguments.pairs:
        taken = timed(name, arguments.runs)
        cells = [name] + [f"{seconds:.2f} ({spent:.2f}) s" for seconds, spent in taken]
        if BLENDER:
            seconds, spent = taken[1] / taken[0]
            cells.append(f"{seconds:.1f} ({spent:.1f})")
        if not arguments.no_noise:
            cells += [f"{value:.4f}" for value in noises(name)]
        print("| " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
