"""Bake one normal map with texbake, timed within the process as `blender_bake.py` times Blender.

Prints one JSON object: seconds of the import, the bake and the save, and the peak memory in bytes.
"""

import itertools
import json
import sys
import time

from texbake.progress import peak_memory_bytes


def main(high_path, low_path, out, size, distance, padding):
    # What both programs have loaded before their clock starts: their own code.
    import texbake.baking.bake
    import texbake.mesh.files

    options = texbake.BakeOptions(
        size=int(size),
        front=float(distance),
        back=float(distance),
        padding=int(padding),
        rays="vertex",
        bits=16,
    )
    times = [time.perf_counter()]
    high, low = texbake.read_mesh(high_path), texbake.read_mesh(low_path)
    times.append(time.perf_counter())
    result = texbake.bake(high, low, options)
    times.append(time.perf_counter())
    result.write(out)
    times.append(time.perf_counter())
    seconds = [later - earlier for earlier, later in itertools.pairwise(times)]
    peak = peak_memory_bytes()
    print(json.dumps({"import": seconds[0], "bake": seconds[1], "save": seconds[2], "peak": peak}))


main(*sys.argv[1:])
