"""Rays of a bake: their trees, fitted distances, meshes in chunks, and meshes that stay in a file.

python tests/benchmarks/bench_rays.py trees | distances | chunks | stream
"""

import hashlib
import math
import tempfile
import time
from functools import partial
from pathlib import Path

import numpy as np
from harness import PAIRS, in_child, in_turn, read_pair, run_commands, table

import texbake
from texbake.mesh.shapes import grid_sphere, uv_sphere

SPHERE = "sphere"


def trees(triangles=(100_000, 1_000_000, 4_000_000), sizes=(2048, 4096), rounds=2):
    """The tree, the rays and the hits: processor seconds from meshes in memory to all hits.

    A displaced sphere is cast onto about 512 triangles, one ray per texel.
    """
    row = table("triangles", "texture", "rays", "tree, s", "tree, rays and hits, s")
    for n in triangles:
        for size in sizes:
            found = [in_child(cast_once, n, size) for _ in range(rounds)]
            n_faces, n_rays, tree, total = min(found, key=lambda one: one[-1])
            row(f"{n_faces:,}", f"{size}²", f"{n_rays:,}", f"{tree:.2f}", f"{total:.2f}")


def cast_once(n_triangles, size):
    """Triangles, rays, and processor seconds of the tree and of all."""
    cast(200, 64)  # compiles what is compiled when first called
    return cast(n_triangles, size)


def cast(n_triangles, size):
    from texbake.baking.rays import RayField
    from texbake.baking.texels import SampleGrid, owned_samples, rasterize_uv, snap_uvs
    from texbake.mesh.frame import LocalFrame
    from texbake.parallel import run_bands
    from texbake.raycast.scene import RayScene, rows_of

    side = math.isqrt(n_triangles // 2)
    low = uv_sphere(16, 17)
    high = uv_sphere(side, side, lambda t, p: 1 + 0.02 * np.sin(9 * t) * np.sin(11 * p))
    frame, grid = LocalFrame.around(high, low), SampleGrid(size, size, 1)
    faces = snap_uvs(low, grid)
    samples = owned_samples(rasterize_uv(faces, grid)[0], faces, grid, 0)
    field = RayField(low, frame, kind="smooth", front=0.1, back=0.1)
    start = time.process_time()
    scene = RayScene.build(high, frame)
    tree = time.process_time() - start

    def cast_some(first, stop):
        some = samples.where(slice(first, stop))
        rays = field.rays(some, threads=1)
        make = rows_of(rays, field.places(some, grid))
        scene.cast_in_order(len(some), make, cull_back_faces=True, threads=1)

    run_bands(cast_some, len(samples), band=1 << 14)
    return high.n_faces, len(samples), tree, time.process_time() - start


def distances(runs=5, size=1024, threads=1, pairs=(*PAIRS, SPHERE)):
    """What fitted ray distances cost, beside one distance that reaches as far.

    Processor seconds of a normal map. The last column is the noise of the machine.
    """
    row = table("pair", "triangles", "one distance, s", "fitted / one", "lengthened",
                "misses, one", "misses, fitted", "noise")  # fmt: skip
    for name in pairs:
        is_made = name == SPHERE
        pair = (grid_sphere(1000, 2000), uv_sphere(16, 17)) if is_made else read_pair(name)
        fitted = texbake.BakeOptions(size=size, threads=threads)
        report = texbake.bake(*pair, fitted).report
        one = texbake.BakeOptions(size=size, threads=threads, front=report.front, back=report.back)
        found = in_turn({key: partial(texbake.bake, *pair, key) for key in (fitted, one)}, runs)
        row(
            name, f"{pair[0].n_faces:,}", found[one].cell(), found[fitted].times(found[one]),
            f"{100.0 * report.counts.rays_lengthened / report.counts.rays_cast:.2f} %",
            f"{found[one].result.report.miss_percent:.3f} %", f"{report.miss_percent:.3f} %",
            found[one].spread(),
        )  # fmt: skip


MAPS = ("normal", "displacement")


def chunks(thousands=2000, size=2048, rounds=3):
    """A high-poly mesh in one ray tree, and in chunks that need less memory.

    Each bake runs in a process of its own, as does one that only reads the meshes. The maps are
    compared byte by byte.
    """
    row = table("limit, MB", "chunks", "seconds", "times", "peak memory, MB")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        side = math.isqrt(500 * thousands)
        high = uv_sphere(side, side, lambda a, b: 1 + 0.01 * np.sin(31 * a) * np.sin(29 * b))
        texbake.write_mesh(high.replace(uvs=None, uv_faces=None), folder / "high.ply")
        texbake.write_mesh(uv_sphere(30, 60), folder / "low.obj")
        read = in_child(bake_within, folder, size, 0.0, rounds)
        row("reading alone", "", "", "", f"{read['memory'] / 1e6:.0f}")
        whole = None
        for share in (1.0, 0.75, 0.5):
            found = in_child(bake_within, folder, size, share, rounds)
            whole = whole or found
            assert found["digest"] == whole["digest"], "the bytes differ"
            row(
                f"{found['limit'] / 1e6:.0f}", found["chunks"], f"{found['seconds']:.2f}",
                f"{found['seconds'] / whole['seconds']:.2f}", f"{found['memory'] / 1e6:.0f}",
            )  # fmt: skip


def bake_within(folder, size, share, rounds):
    """Bake within a share of the estimated memory; for 0, only read the meshes."""
    from texbake.baking.memory import bake_memory
    from texbake.progress import peak_memory_bytes

    high, low = (texbake.read_mesh(f"{folder}/{name}") for name in ("high.ply", "low.obj"))
    if not share:
        return {"memory": peak_memory_bytes()}
    limit = int(share * bake_memory(high.n_faces, low.n_faces, size * size, MAPS))
    options = texbake.BakeOptions(maps=MAPS, size=size, max_memory=limit)
    chunk = options.chunk_faces(high.n_faces, low.n_faces)
    seconds = []
    for _ in range(rounds):
        start = time.perf_counter()
        maps = texbake.bake(high, low, options).maps
        seconds.append(time.perf_counter() - start)
    return {
        "chunks": 1 if chunk is None else -(-high.n_faces // chunk), "limit": limit,
        "seconds": min(seconds), "memory": peak_memory_bytes(),
        "digest": hashlib.sha256(b"".join(maps[m].values.tobytes() for m in MAPS)).hexdigest(),
    }  # fmt: skip


def stream(triangles=(10_000_000, 100_000_000), size=2048, max_memory="1.5G", maps=("normal",),
           measured=False, folder=None):  # fmt: skip
    """A bake of a high-poly mesh that stays in its file: rate and peak memory.

    A displaced sphere is written as binary PLY by blocks: 100 million triangles take 1.9 GB. Ray
    distances are given, unless `--measured`, which reads the file twice more. Files in `--folder`
    stay.
    """
    row = table("triangles", "texture", "seconds", "processor, s", "triangles/s", "peak memory",
                "missed")  # fmt: skip
    with tempfile.TemporaryDirectory() as temporary:
        place = Path(folder or temporary)
        texbake.write_mesh(uv_sphere(16, 17), place / "low.obj")
        for wanted in triangles:
            n = write_sphere(place / "high.ply", wanted)
            start = time.perf_counter()
            peak, missed, spent = in_child(
                bake_file, place, size, max_memory, None if measured else 0.1, maps
            )
            seconds = time.perf_counter() - start
            row(f"{n:,}", f"{size}²", f"{seconds:.1f}", f"{spent:.1f}",
                f"{n / seconds / 1e6:.2f} M", f"{peak / 1e9:.2f} GB", f"{missed:,}")  # fmt: skip


def bake_file(folder, size, max_memory, distance, maps):
    """Peak memory, missed texels and processor seconds of a bake from files to files."""
    from texbake.jobs.maps import bake_files
    from texbake.progress import peak_memory_bytes

    options = texbake.BakeOptions(size=size, max_memory=max_memory, front=distance, back=distance)
    files = {name: f"{folder}/{name}.png" for name in maps}
    done = bake_files(f"{folder}/high.ply", f"{folder}/low.obj", files, options)
    return peak_memory_bytes(), done.report.texels_missed, time.process_time()


def write_sphere(path, n_triangles):
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


if __name__ == "__main__":
    run_commands(globals(), trees, distances, chunks, stream)
