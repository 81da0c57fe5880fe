"""A high-poly mesh in one ray tree, and in chunks that need less memory.

    python tests/benchmarks/bench_chunks.py            2 million triangles, 2048²
    python tests/benchmarks/bench_chunks.py 500 1024   500 thousand triangles, 1024²

Each bake runs in a process of its own. Memory is the peak resident memory; a process that only
reads the meshes is measured too. The maps are compared byte by byte.
"""

import hashlib
import json
import math
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from texbake import BakeOptions, read_mesh
from texbake.baking.bake import bake
from texbake.baking.memory import bake_memory
from texbake.mesh.files import write_mesh
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import uv_sphere
from texbake.progress import peak_memory_bytes

MAPS = ("normal", "displacement")
REPEATS = 3


def one(folder: Path, size: int, share: float) -> dict[str, object]:
    """Bake within a share of the estimate; for 0, only read the meshes."""
    high, low = read_mesh(folder / "high.ply"), read_mesh(folder / "low.obj")
    after_reading = peak_memory_bytes()
    if not share:
        return {"memory": after_reading}
    whole = bake_memory(high.n_faces, low.n_faces, size * size, MAPS)
    options = BakeOptions(maps=MAPS, size=size, max_memory=int(share * whole))
    chunk = options.chunk_faces(high.n_faces, low.n_faces)
    seconds = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        maps = bake(high, low, options).maps
        seconds.append(time.perf_counter() - start)
    digest = hashlib.sha256(b"".join(maps[name].values.tobytes() for name in MAPS))
    return {
        "chunks": 1 if chunk is None else -(-high.n_faces // chunk),
        "limit": int(share * whole),
        "seconds": min(seconds),
        "memory": peak_memory_bytes(),
        "digest": digest.hexdigest(),
    }


def main(thousands: int, size: int) -> None:
    """Measure and print a table."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        side = math.isqrt(500 * thousands)
        high = uv_sphere(side, side, lambda a, b: 1 + 0.01 * np.sin(31 * a) * np.sin(29 * b))
        write_mesh(Mesh(positions=high.positions, faces=high.faces), folder / "high.ply")
        write_mesh(uv_sphere(30, 60), folder / "low.obj")
        found = []
        for share in (0.0, 1.0, 0.75, 0.5):
            given = [sys.executable, __file__, "one", str(folder), str(size), str(share)]
            done = subprocess.run(given, check=True, capture_output=True)
            found.append(json.loads(done.stdout))
    read, whole, *parts = found
    print(f"{high.n_faces:,} triangles, {size}²; reading alone: {read['memory'] / 1e6:.0f} MB")
    for row in whole, *parts:
        assert row["digest"] == whole["digest"], "the bytes differ"
        print(
            f"limit {row['limit'] / 1e6:6.0f} MB: {row['chunks']:2} chunks, {row['seconds']:5.2f} s"
            f" ({row['seconds'] / whole['seconds']:.2f} times), {row['memory'] / 1e6:.0f} MB"
        )


if __name__ == "__main__":
    if sys.argv[1:2] == ["one"]:
        print(json.dumps(one(Path(sys.argv[2]), int(sys.argv[3]), float(sys.argv[4]))))
    else:
        main(*(int(word) for word in sys.argv[1:] or ("2000", "2048")))
