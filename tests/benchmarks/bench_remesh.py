"""Wrapping triangles in a closed surface: time, memory and faults, beside pymeshlab's alpha wrap.

    python tests/benchmarks/bench_remesh.py scan.ply [--resolution 256] [--triangles 5000000]

Without a file, a sphere with a relief is made of that many triangles. The alpha wrap gets the side
of a voxel as alpha and a thirtieth of it as offset. It is left out where the mesh has more than
`--most` triangles, because it would take hours. Times are of processors and of the clock.
"""

from __future__ import annotations

import argparse
import resource
import time
from collections.abc import Callable

import numpy as np
import pymeshlab

import texbake
from texbake.mesh.distance import surface_distance
from texbake.mesh.mesh import Mesh
from texbake.mesh.options import RemeshOptions
from texbake.mesh.shapes import grid_sphere
from texbake.mesh.topology import find_edges


def made(n_triangles: int) -> Mesh:
    """A sphere with waves all over."""
    n = int(np.sqrt(n_triangles / 4))
    ball = grid_sphere(n, 2 * n)
    waves = np.sin(40.0 * ball.positions).prod(axis=1, keepdims=True)
    return ball.replace(positions=ball.positions * (1.0 + 0.02 * waves))


def alpha_wrapped(mesh: Mesh, voxel: float) -> Mesh:
    """The mesh in pymeshlab's alpha wrap."""
    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(mesh.positions, mesh.faces))
    meshes.generate_alpha_wrap(
        alpha=pymeshlab.PureValue(voxel), offset=pymeshlab.PureValue(voxel / 30.0)
    )
    wrap = meshes.current_mesh()
    return Mesh(positions=wrap.vertex_matrix(), faces=wrap.face_matrix().astype(np.int32))


def n_intersecting(mesh: Mesh) -> int:
    """Faces that intersect another one."""
    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(mesh.positions, mesh.faces))
    meshes.compute_selection_by_self_intersections_per_face()
    return int(meshes.current_mesh().selected_face_number())


def measure(name: str, wrap: Callable[[], Mesh], mesh: Mesh, voxel: float) -> None:
    """Print a row of figures."""
    start, started = time.process_time(), time.perf_counter()
    result = wrap()
    seconds, elapsed = time.process_time() - start, time.perf_counter() - started
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    edges = find_edges(result.faces)
    away = surface_distance(result, mesh).a_to_b
    print(
        f"{name:<12} {result.n_faces:>10,} faces  {seconds:6.1f} s (processors)  {elapsed:6.1f} s  "
        f"{peak:.2f} GB  closed {edges.closed}  intersecting {n_intersecting(result):,}  "
        f"distance in voxels: mean {away.mean / voxel:.3f}, greatest {away.max / voxel:.2f}",
        flush=True,
    )


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("mesh", nargs="?")
    parser.add_argument("--resolution", type=int, default=256)
    parser.add_argument("--triangles", type=int, default=5_000_000)
    parser.add_argument("--most", type=int, default=300_000)
    given = parser.parse_args()
    mesh = texbake.read_mesh(given.mesh) if given.mesh else made(given.triangles)
    voxel = float(np.ptp(mesh.bounds, axis=0).max()) / given.resolution
    print(f"{mesh.n_faces:,} triangles at {given.resolution} voxels")
    options = RemeshOptions(resolution=given.resolution)
    measure("texbake", lambda: texbake.remesh(mesh, options), mesh, voxel)
    if mesh.n_faces <= given.most:
        measure("alpha wrap", lambda: alpha_wrapped(mesh, voxel), mesh, voxel)


if __name__ == "__main__":
    main()
