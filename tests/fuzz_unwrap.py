"""Unwrap broken meshes: none may hang, crash, or get charts that overlap or are mirrored.

    python tests/fuzz_unwrap.py [--first 0] [--count 1000] [--seconds 60] [--processes 2]

Each mesh is unwrapped in all qualities, in a process of its own that is ended after a time. Prints
what is wrong and how long the slowest took; exits with 1 if anything is wrong.
"""

from __future__ import annotations

import argparse
import multiprocessing
import sys
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from broken_meshes import broken_mesh

from texbake.errors import UnwrapError
from texbake.mapping.corner_uvs import signed_areas
from texbake.mapping.options.atlas import QUALITIES
from texbake.mapping.overlap import find_overlaps
from texbake.mapping.unwrap import unwrap

# All faces without area, or next to none beside a spike; and too many charts for the texels.
EXCUSES = "has an area", "narrower than", "do not fit"


def wrong_with(mesh, quality):
    """What is wrong with the coordinates that a mesh gets; empty if nothing is.

    The texture has few texels, for which packing searches less long.
    """
    try:
        unwrapped = unwrap(mesh, quality=quality, size=512, padding=0, threads=1)
    except UnwrapError as error:
        return "" if any(words in str(error) for words in EXCUSES) else f"UnwrapError: {error}"
    corners = unwrapped.corner_uvs()
    if not np.isfinite(corners).all():
        return "coordinates that are not finite"
    if (signed_areas(corners) < -1e-12).any():
        return "mirrored faces"
    if corners.min() < 0.0 or corners.max() > 1.0:
        return "coordinates outside the square"
    overlapping = find_overlaps(corners).overlapping
    return f"{int(overlapping.sum())} faces overlap" if overlapping.any() else ""


def _unwrap_all(seed, results):
    mesh, _ = broken_mesh(seed)
    for quality in QUALITIES:
        start = time.perf_counter()
        wrong = wrong_with(mesh, quality)
        results.send((quality, wrong, time.perf_counter() - start))


def _tried(seed, limit):
    """(quality, what is wrong, seconds) for each quality that a process came to."""
    results, ours = multiprocessing.Pipe(duplex=False)
    process = multiprocessing.Process(target=_unwrap_all, args=(seed, ours), daemon=True)
    process.start()
    ours.close()
    process.join(limit)
    late = process.is_alive()
    process.kill()
    process.join()
    found = []
    while len(found) < len(QUALITIES):
        try:
            found.append(results.recv())
        except EOFError:
            quality = QUALITIES[len(found)]
            return [*found, (quality, "too slow" if late else "crashed", float(limit))]
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--processes", type=int, default=2)
    arguments = parser.parse_args()
    seeds = range(arguments.first, arguments.first + arguments.count)
    n_wrong, slowest = 0, dict.fromkeys(QUALITIES, (0.0, -1))
    with ThreadPoolExecutor(arguments.processes) as pool:
        tried = pool.map(lambda seed: _tried(seed, arguments.seconds), seeds)
        for seed, found in zip(seeds, tried, strict=True):
            for quality, wrong, seconds in found:
                slowest[quality] = max(slowest[quality], (seconds, seed))
                if wrong:
                    n_wrong += 1
                    print(
                        f"seed {seed}, {quality}, {broken_mesh(seed)[0].name}: {wrong}", flush=True
                    )
    for quality, (seconds, seed) in slowest.items():
        print(f"slowest, {quality}: {seconds:.1f} s (seed {seed})")
    print(f"{len(seeds)} meshes, {n_wrong} failures")
    sys.exit(n_wrong > 0)


if __name__ == "__main__":
    main()
