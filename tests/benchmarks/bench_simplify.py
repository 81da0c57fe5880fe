"""How far simplified meshes lie from what they were made of, beside pymeshlab's best.

    python tests/benchmarks/bench_simplify.py [MESH ...] [--faces 500 2000 10000] [--most 300000]

Without meshes, those of the folder that TEXBAKE_DATA names. Errors are RMS distances of both
surfaces, in percent of the diagonal. pymeshlab's is the least of three ways to set it, of those
that reach the count. It does not look at texture coordinates, hard edges and groups, which ours
keeps; a second row has ours of the bare surface.
"""

from __future__ import annotations

import argparse
import math
import os
import re
import statistics
import subprocess
import sys
from pathlib import Path

import numpy as np
import pymeshlab

import texbake
from texbake.errors import TexbakeError
from texbake.mesh.distance import surface_distance
from texbake.mesh.mesh import Mesh
from texbake.mesh.simplify import simplify_with_report

PEER_OPTIONS = (
    {},
    {"preserveboundary": True, "planarquadric": True},
    {"preservetopology": True, "preserveboundary": True, "preservenormal": True},
)
FOLDERS = ("meshes", "pairs/*", "gltf", "gltf/*", "broken")
BARE = "without seams"
MOST_RATIO = 1.05
TIMEOUT = 240.0  # seconds for a mesh


def peer_error(mesh: Mesh, n_faces: int) -> float:
    """The least error of what pymeshlab makes; infinite where it does not reach the count."""
    errors = [math.inf]
    for options in PEER_OPTIONS:
        meshes = pymeshlab.MeshSet()
        meshes.add_mesh(pymeshlab.Mesh(mesh.positions, mesh.faces))
        meshes.meshing_remove_duplicate_vertices()
        meshes.meshing_decimation_quadric_edge_collapse(targetfacenum=n_faces, **options)
        low = meshes.current_mesh()
        faces = low.face_matrix().astype(np.int32)
        if 0 < len(faces) <= 1.02 * n_faces:
            made = Mesh(positions=low.vertex_matrix(), faces=faces)
            errors.append(surface_distance(mesh, made).rms_relative)
    return min(errors)


def cell(mesh: Mesh, n_faces: int, peer: float) -> str:
    """Both errors and their ratio, or how many faces are left where that is more."""
    low, report = simplify_with_report(mesh, n_faces, quality="best")
    error = report.distance.rms_relative
    theirs = "none" if math.isinf(peer) else f"{100 * peer:.4f}"
    text = f"{100 * error:.4f} / {theirs}"
    if low.n_faces > 1.01 * n_faces:
        return f"{text} ({low.n_faces} faces)"  # nothing to compare
    return text if math.isinf(peer) else f"{text} = {error / peer:.2f}"


def measure(path: str, counts: list[int], most: int) -> None:
    """Print the rows of a mesh."""
    mesh = texbake.read_mesh(path)
    if mesh.n_faces > most:
        return
    peers = {n: peer_error(mesh, n) for n in counts if n <= 0.8 * mesh.n_faces}
    name = "/".join(Path(path).parts[-2:])
    kinds = {name: mesh}
    if mesh.uvs is not None or mesh.normals is not None or len(mesh.group_names) > 1:
        kinds[f"{name}, {BARE}"] = Mesh(positions=mesh.positions, faces=mesh.faces, name=mesh.name)
    for name, given in kinds.items():
        cells = [cell(given, n, peers[n]) if n in peers else "" for n in counts]
        print(f"| {' | '.join([name, *cells])} |", flush=True)


def rows_of(path: str, arguments: list[str]) -> list[str]:
    """The rows of a mesh, measured in a process of its own; none where that takes too long."""
    command = [sys.executable, __file__, path, "--rows", *arguments]
    try:
        done = subprocess.run(command, timeout=TIMEOUT, capture_output=True, text=True, check=False)
    except subprocess.TimeoutExpired as stopped:
        print(f"{path}: stopped after {TIMEOUT:.0f} s", file=sys.stderr)
        return (stopped.stdout or b"").decode().splitlines()
    if done.returncode:
        print(f"{path}: {done.stderr.splitlines()[-1]}", file=sys.stderr)
    return done.stdout.splitlines()


def summary(rows: list[str]) -> str:
    """The median of the ratios, and how many are above `MOST_RATIO`."""
    ratios = [float(ratio) for ratio in re.findall(r"= ([\d.]+)", "".join(rows))]
    n_above = sum(ratio > MOST_RATIO for ratio in ratios)
    median = statistics.median(ratios) if ratios else math.nan
    return f"{len(ratios)} ratios, median {median:.2f}, {n_above} above {MOST_RATIO}"


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("meshes", nargs="*")
    parser.add_argument("--faces", nargs="+", type=int, default=[500, 2_000, 10_000])
    parser.add_argument("--most", type=int, default=300_000, help="triangles of a mesh")
    parser.add_argument("--rows", action="store_true", help="of the one mesh, in this process")
    given = parser.parse_args()
    if given.rows:
        try:
            measure(given.meshes[0], given.faces, given.most)
        except TexbakeError as error:
            sys.exit(str(error))
        return
    folder = Path(os.environ.get("TEXBAKE_DATA", "."))
    paths = given.meshes or [
        str(path) for part in FOLDERS for path in sorted(folder.glob(f"{part}/*"))
    ]
    suffixes = (".obj", ".ply", ".stl", ".glb", ".gltf")
    print(f"| mesh | {' | '.join(f'{n:,} faces' for n in given.faces)} |")
    print("|---" * (1 + len(given.faces)) + "|")
    rows = []
    for path in paths:
        if path.lower().endswith(suffixes):
            found = rows_of(path, ["--most", str(given.most), "--faces", *map(str, given.faces)])
            print("\n".join(found), flush=True) if found else None
            rows += found
    print(f"as they are: {summary([row for row in rows if BARE not in row])}")
    print(f"{BARE}: {summary([row for row in rows if BARE in row])}")


if __name__ == "__main__":
    main()
