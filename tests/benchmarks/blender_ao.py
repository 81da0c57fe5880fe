"""Bake one ambient occlusion map with Blender, for the benchmark to run in a Python that has `bpy`.

Writes the map as a .npy of (size, size) floats, row 0 at the top, and prints the seconds of the
bake: by the clock, and of all its processors.
"""

import os
import sys
import time
from pathlib import Path

import bpy
import numpy as np

sys.path.append(str(Path(__file__).parents[2] / "texbake" / "study" / "bench" / "runners"))
from run_blender import light_everywhere, prepare_bake


def main(high, low, out, size, samples, distance):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene, image = prepare_bake(
        {
            "high": high, "low": low, "size": int(size), "samples": int(samples),
            "distance": float(distance), "padding": 0,
        }
    )  # fmt: skip
    light_everywhere(scene)
    start, spent = time.perf_counter(), sum(os.times()[:2])
    bpy.ops.object.bake(type="AO")
    seconds, spent = time.perf_counter() - start, sum(os.times()[:2]) - spent
    pixels = np.empty(4 * int(size) ** 2, dtype=np.float32)
    image.pixels.foreach_get(pixels)
    np.save(out, pixels.reshape(int(size), int(size), 4)[::-1, :, 0])
    print(seconds, spent)


main(*sys.argv[1:])
