"""Atlases of real meshes by texbake, xatlas and Blender.

    python tests/benchmarks/bench_unwrap.py [--large] [--slow] [--meshes NAME ...] [--page]

The meshes are those of TEXBAKE_DATA, or of ../shared/data beside the project, scaled to a longest
side of 1. Every atlas is for 1024 x 1024 texels with 2 texels between charts (texbake: padding 1).
xatlas runs with its default options. `--large` adds noisy spheres of 81,920 and of 1.3 million
triangles, `--huge` one of 5.2 million, on which xatlas runs only with `--slow` (half a minute, and
hours). Blender runs where TEXBAKE_BLENDER_PYTHON names a Python with bpy 5.0.1, on meshes of at
most --blender-faces triangles. Mirrored faces count as if they were not mirrored, or the stretch of
xatlas would be infinite. Times are processor seconds of all threads; Blender's are by the clock.

Prints tables in Markdown: one of all atlases, and one of means and medians, as in: Wang et al.,
"PartUV: Part-Based UV Unwrapping of 3D Meshes", 2025. `--page` puts them into
docs/explanation/atlases.md.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import statistics
import subprocess
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import texbake
from texbake.mapping.corner_uvs import with_coordinates
from texbake.mapping.distortion import Distortion
from texbake.mesh.shapes import icosphere

HERE = Path(__file__).parent
DATA = Path(os.environ.get("TEXBAKE_DATA", HERE.parents[2] / "shared" / "data"))
PAGE = HERE.parents[1] / "docs" / "explanation" / "atlases.md"
MARKS = ("<!-- bench_unwrap -->", "<!-- /bench_unwrap -->")
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
    "busted": "meshes/busted.STL",
    "featuretype": "meshes/featuretype.STL",
    "tray": "meshes/1002_tray_bottom.STL",
    "hammer": "meshes/hammer.obj",
    "nefertiti": "meshes/nefertiti-lowres.obj",
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
    start = time.process_time()
    unwrapped = texbake.unwrap(mesh, size=SIZE, padding=GAP // 2, quality=quality)
    return unwrapped.corner_uvs(), time.process_time() - start


def by_xatlas(mesh):
    """xatlas with its defaults, at the size asked for."""
    import xatlas

    start = time.process_time()
    atlas = xatlas.Atlas()
    atlas.add_mesh(mesh.positions.astype(np.float32), mesh.faces.astype(np.uint32))
    options = xatlas.PackOptions()
    options.resolution, options.padding = SIZE, GAP
    atlas.generate(xatlas.ChartOptions(), options)
    _, faces, uvs = atlas.get_mesh(0)
    seconds = time.process_time() - start
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


@dataclass(frozen=True)
class Measured:
    """An atlas that a program made of a mesh."""

    mesh: str
    n_faces: int
    program: str
    seconds: float
    found: Distortion

    def row(self):
        found, stretch = self.found, self.found.turned_stretch  # about half of xatlas' are mirrored
        return (
            f"| {self.mesh} | {self.n_faces:,} | {self.program} | {self.seconds:.1f} s "
            f"| {found.n_charts:,} | {stretch.l2:.3f} | {stretch.linf:.2f} | {stretch.angle:.4f} "
            f"| {stretch.area:.4f} | {found.seam_length:.2f} | {found.fill:.3f} "
            f"| {found.n_mirrored:,} | {found.n_overlapping:,} |"
        )


def measure(name, mesh, arguments):
    """Yield what each program makes of one mesh."""
    for program, run in contenders(mesh, arguments):
        corners, seconds = run()
        found = texbake.distortion(with_coordinates(mesh, corners), SIZE)
        yield Measured(name, mesh.n_faces, program, seconds, found)


def summary(atlases):
    """Yield the table of means over the meshes that all programs unwrapped."""
    programs = list(dict.fromkeys(atlas.program for atlas in atlases))
    meshes = [
        name
        for name in dict.fromkeys(atlas.mesh for atlas in atlases)
        if len({atlas.program for atlas in atlases if atlas.mesh == name}) == len(programs)
    ]
    yield f"Means over {len(meshes)} meshes ({', '.join(meshes)}):\n"
    yield "| program | charts, mean | median | seams | L2 | angle | area | fill | time |"
    yield "|" + "---|" * 9
    for program in programs:
        own = [atlas for atlas in atlases if atlas.program == program and atlas.mesh in meshes]
        charts = [atlas.found.n_charts for atlas in own]
        stretches = [atlas.found.turned_stretch for atlas in own]
        yield (
            f"| {program} | {statistics.mean(charts):.0f} | {statistics.median(charts):.0f} "
            f"| {statistics.mean(atlas.found.seam_length for atlas in own):.1f} "
            f"| {statistics.mean(stretch.l2 for stretch in stretches):.4f} "
            f"| {statistics.mean(stretch.angle for stretch in stretches):.4f} "
            f"| {statistics.mean(stretch.area for stretch in stretches):.4f} "
            f"| {statistics.mean(atlas.found.fill for atlas in own):.3f} "
            f"| {statistics.mean(atlas.seconds for atlas in own):.1f} s |"
        )


def report(arguments):
    """Yield the lines of both tables."""
    yield (
        "| mesh | faces | program | time | charts | L2 | L∞ | angle | area | seams | fill "
        "| mirrored | overlapping |"
    )
    yield "|" + "---|" * 13
    atlases = []
    for name in arguments.meshes:
        mesh = unit_size(texbake.read_mesh(DATA / MESHES[name]))
        for atlas in measure(name, mesh, arguments):
            atlases.append(atlas)
            yield atlas.row()
    arguments.qualities = ["fast"]
    for level in (6, 8) * arguments.large + (9,) * arguments.huge:
        for atlas in measure("noisy sphere", noisy_sphere(level), arguments):
            yield atlas.row()
    yield ""
    yield from summary(atlases)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--large", action="store_true")
    parser.add_argument("--huge", action="store_true")
    parser.add_argument("--slow", action="store_true")
    parser.add_argument("--meshes", nargs="*", default=list(MESHES), choices=list(MESHES))
    parser.add_argument("--qualities", nargs="*", default=["fast", "good", "best"])
    parser.add_argument("--blender-faces", type=int, default=12_000)
    parser.add_argument("--page", action="store_true", help="put the tables into the docs")
    arguments = parser.parse_args()
    lines = []
    for line in report(arguments):
        lines.append(line)
        print(line, flush=True)
    if arguments.page:
        old = PAGE.read_text(encoding="utf-8")
        new = "\n\n".join([MARKS[0], "\n".join(lines), MARKS[1]])
        pattern = f"{re.escape(MARKS[0])}.*{re.escape(MARKS[1])}"
        PAGE.write_text(re.sub(pattern, lambda _: new, old, flags=re.DOTALL), encoding="utf-8")


if __name__ == "__main__":
    main()
