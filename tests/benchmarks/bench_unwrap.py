"""Atlases of real meshes by texbake, xatlas and Blender.

    python tests/benchmarks/bench_unwrap.py [--large] [--slow] [--meshes NAME ...]

The meshes are those of TEXBAKE_DATA, or of ../shared/data beside the project, scaled to a longest
side of 1. Every atlas is for 1024 x 1024 texels with 2 texels between charts (texbake: padding 1).
xatlas runs with its default options. `--large` adds a noisy sphere of 81,920 triangles and one of
1.3 million, on which xatlas runs only with `--slow` (half a minute, and hours). Blender runs where
TEXBAKE_BLENDER_PYTHON names a Python with bpy 5.0.1, on meshes of at most --blender-faces
triangles. Mirrored faces count as if they were not mirrored, or the stretch of xatlas would be
infinite. Prints a table in Markdown; every process has its kernels compiled.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np

import texbake
from texbake.mapping.corner_uvs import with_coordinates
from texbake.mesh.shapes import icosphere

HERE = Path(__file__).parent
DATA = Path(os.environ.get("TEXBAKE_DATA", HERE.parents[2] / "shared" / "data"))
SIZE, GAP = 1024, 2
MESHES = {
    "fish": "meshes/fish.obj",
    "boot": "meshes/boot.obj",
    "koala low": "pairs/koala/low.obj",
    "skull low": "pairs/skull/low.obj",
    "spot low": "pairs/spot/low.obj",
    "spot high": "pairs/spot/high.obj",
    "penguin low": "pairs/penguin/low.obj",
    "wingnut": "meshes/wingnut.obj",
    "boat": "meshes/boat.obj",
}
XATLAS_FACES = 50_000  # above it takes minutes; --slow runs it all the same


def unit_size(mesh):
    low, high = mesh.bounds
    return mesh.replace(positions=(mesh.positions - low) / (high - low).max())


def noisy_sphere(level):
    """An icosphere whose radii vary by 0.3 % of their own."""
    mesh = icosphere(level)
    radii = 1.0 + 0.003 * np.random.default_rng(1).standard_normal(mesh.n_vertices)
    return unit_size(mesh.replace(positions=mesh.positions * radii[:, None]))


def by_texbake(mesh, quality):
    start = time.perf_counter()
    unwrapped = texbake.unwrap(mesh, size=SIZE, padding=GAP // 2, quality=quality)
    return unwrapped.corner_uvs(), time.perf_counter() - start


def by_xatlas(mesh):
    """xatlas with its defaults, at the size asked for."""
    import xatlas

    start = time.perf_counter()
    atlas = xatlas.Atlas()
    atlas.add_mesh(mesh.positions.astype(np.float32), mesh.faces.astype(np.uint32))
    options = xatlas.PackOptions()
    options.resolution, options.padding = SIZE, GAP
    atlas.generate(xatlas.ChartOptions(), options)
    _, faces, uvs = atlas.get_mesh(0)
    seconds = time.perf_counter() - start
    # It divides u and v by different sizes; texels are square in pixels of the atlas.
    return uvs[faces] * np.array([atlas.width, atlas.height]) / max(atlas.width, atlas.height), (
        seconds
    )


def by_blender(mesh, method):
    with tempfile.TemporaryDirectory() as folder:
        there, back = Path(folder) / "in.npz", Path(folder) / "out.npz"
        np.savez(there, positions=mesh.positions, faces=mesh.faces)
        command = [
            os.environ["TEXBAKE_BLENDER_PYTHON"], HERE / "blender_unwrap.py", there, back,
            method, SIZE, GAP,
        ]  # fmt: skip
        done = subprocess.run(
            list(map(str, command)), capture_output=True, text=True, check=True, timeout=1800
        )
        seconds = json.loads(done.stdout.strip().splitlines()[-1])["seconds"]
        return np.load(back)["corners"], seconds


def contenders(mesh, arguments):
    """Names and functions; Blender and xatlas where they end in time."""
    for quality in arguments.qualities:
        yield f"texbake {quality}", lambda quality=quality: by_texbake(mesh, quality)
    if mesh.n_faces <= XATLAS_FACES or arguments.slow:
        yield "xatlas", lambda: by_xatlas(mesh)
    if "TEXBAKE_BLENDER_PYTHON" in os.environ and mesh.n_faces <= arguments.blender_faces:
        yield "Blender, Smart UV Project", lambda: by_blender(mesh, "smart")
        yield "Blender, minimum stretch", lambda: by_blender(mesh, "minimum-stretch")


def measure(name, mesh, arguments):
    """Print the rows of one mesh; return (contender, fill) of each."""
    fills = []
    for contender, run in contenders(mesh, arguments):
        corners, seconds = run()
        found = texbake.distortion(with_coordinates(mesh, corners), SIZE)
        stretch = found.turned_stretch  # of xatlas about half the charts are mirrored
        print(
            f"| {name} | {mesh.n_faces:,} | {contender} | {seconds:.1f} s | {found.n_charts:,} "
            f"| {stretch.l2:.3f} | {stretch.linf:.2f} | {stretch.symmetric_dirichlet:.3f} "
            f"| {found.seam_length:.2f} | {found.fill:.3f} | {found.n_mirrored:,} "
            f"| {found.n_overlapping:,} |",
            flush=True,
        )
        fills.append((contender, found.fill))
    return fills


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--large", action="store_true")
    parser.add_argument("--slow", action="store_true")
    parser.add_argument("--meshes", nargs="*", default=list(MESHES), choices=list(MESHES))
    parser.add_argument("--qualities", nargs="*", default=["fast", "good", "best"])
    parser.add_argument("--blender-faces", type=int, default=12_000)
    arguments = parser.parse_args()
    texbake.unwrap(icosphere(2), quality="best", size=SIZE)  # compiles what is not compiled yet
    print(
        "| mesh | faces | by | time | charts | L2 | L∞ | sym. Dirichlet | seams | fill | mirrored "
        "| overlapping |\n|" + "---|" * 12
    )
    fills = []
    for name in arguments.meshes:
        fills += measure(name, unit_size(texbake.read_mesh(DATA / MESHES[name])), arguments)
    if arguments.large:
        arguments.qualities = ["fast"]
        measure("noisy sphere", noisy_sphere(6), arguments)
        measure("noisy sphere", noisy_sphere(8), arguments)
    print()
    for contender in dict.fromkeys(name for name, _ in fills):
        values = [fill for name, fill in fills if name == contender]
        print(f"mean fill, {contender}: {statistics.mean(values):.3f} of {len(values)} meshes")


if __name__ == "__main__":
    main()
