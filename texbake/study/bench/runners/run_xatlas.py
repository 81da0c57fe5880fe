"""Do one job with xatlas: `run_xatlas.py JOB`."""

from importlib.metadata import version as version_of
from pathlib import Path

import numpy as np
import xatlas
from runner_job import do_job


def read_ply(path):
    """Positions and triangles of a binary PLY file, of float32 and lists of one byte and int32."""
    data = Path(path).read_bytes()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    counts = [int(line.split()[2]) for line in data[:end].splitlines() if b"element" in line]
    positions = np.frombuffer(data, "<f4", 3 * counts[0], end).reshape(-1, 3)
    rows = np.dtype([("count", "u1"), ("corners", "<i4", 3)])
    faces = np.frombuffer(data, rows, counts[1], end + positions.nbytes)["corners"]
    return np.ascontiguousarray(positions), np.ascontiguousarray(faces)


def unwrap(job):
    """Write texture coordinates by corner."""
    positions, faces = read_ply(job["mesh"])
    atlas = xatlas.Atlas()
    atlas.add_mesh(positions, faces.astype(np.uint32))
    charts, packing = xatlas.ChartOptions(), xatlas.PackOptions()
    packing.resolution, packing.padding = job["size"], job["gap"]
    packing.bruteForce = job["brute_force"]
    atlas.generate(charts, packing)
    _, corners, uvs = atlas.get_mesh(0)
    # It divides u and v by different sizes; texels are square in pixels of the atlas.
    uvs = uvs * np.array([atlas.width, atlas.height]) / max(atlas.width, atlas.height)
    np.savez(job["out"], positions=positions, faces=faces, corners=uvs[corners])


def version(job):
    """Print the version."""
    print("VERSION", version_of("xatlas"))


if __name__ == "__main__":
    do_job(globals())
