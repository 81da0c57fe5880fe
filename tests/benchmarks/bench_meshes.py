"""Meshes beside other programs: atlases, simplified meshes, and closed wraps.

python tests/benchmarks/bench_meshes.py unwrap | simplify | remesh
"""

from __future__ import annotations

import json
import math
import re
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from harness import BLENDER, DATA, ROOT, in_child, put_into, run_commands, table

import texbake
from texbake.mesh.mesh import Mesh

SIZE, GAP = 1024, 2
XATLAS_FACES = 50_000  # above it takes minutes; --slow runs it all the same
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


def unwrap(meshes=tuple(MESHES), qualities=("fast", "good", "best"), blender_faces=12_000,
           large=False, huge=False, slow=False, page=False):  # fmt: skip
    """Atlases by texbake, xatlas and Blender of real meshes, scaled to a longest side of 1.

    Every atlas is for 1024 x 1024 texels with 2 texels between charts (texbake: padding 1). xatlas
    runs with its default options. `--large` adds noisy spheres of 81,920 and of 1.3 million
    triangles, `--huge` one of 5.2 million, on which xatlas runs only with `--slow` (half a minute,
    and hours). Blender runs where TEXBAKE_BLENDER_PYTHON names a Python with bpy 5.0.1, on meshes
    of at most --blender-faces triangles. Mirrored faces count as if they were not mirrored, or the
    stretch of xatlas would be infinite. Times are processor seconds of all threads; Blender's are
    by the clock. The means are as in: Wang et al., "PartUV: Part-Based UV Unwrapping of 3D Meshes",
    2025. `--page` puts the tables into docs/explanation/atlases.md.
    """
    lines = []
    for line in unwrap_tables(meshes, qualities, blender_faces, large, huge, slow):
        lines.append(line)
        print(line, flush=True)
    if page:
        put_into(ROOT / "docs" / "explanation" / "atlases.md", "bench_unwrap", "\n".join(lines))


def unwrap_tables(meshes, qualities, blender_faces, large, huge, slow):
    yield (
        "| mesh | faces | program | time | charts | L2 | L∞ | angle | area | seams | fill "
        "| mirrored | overlapping |"
    )
    yield "|" + "---|" * 13
    atlases = []
    for name in meshes:
        mesh = unit_size(texbake.read_mesh(DATA / MESHES[name]))
        for atlas in unwrapped(name, mesh, qualities, blender_faces, slow):
            atlases.append(atlas)
            yield atlas.row()
    for level in (6, 8) * large + (9,) * huge:
        sphere = noisy_sphere(level)
        for atlas in unwrapped("noisy sphere", sphere, ["fast"], blender_faces, slow):
            yield atlas.row()
    yield ""
    yield from summary(atlases)


def unit_size(mesh):
    low, high = mesh.bounds
    return mesh.replace(positions=(mesh.positions - low) / (high - low).max())


def noisy_sphere(level):
    """An icosphere whose radii vary by 0.3 % of their own."""
    from texbake.mesh.shapes import icosphere

    mesh = icosphere(level)
    radii = 1.0 + 0.003 * np.random.default_rng(1).standard_normal(mesh.n_vertices)
    return unit_size(mesh.replace(positions=mesh.positions * radii[:, None]))


@dataclass(frozen=True)
class Atlas:
    """An atlas that a program made of a mesh."""

    mesh: str
    n_faces: int
    program: str
    seconds: float
    found: object

    def row(self):
        found, stretch = self.found, self.found.turned_stretch  # about half of xatlas' are mirrored
        return (
            f"| {self.mesh} | {self.n_faces:,} | {self.program} | {self.seconds:.1f} s "
            f"| {found.n_charts:,} | {stretch.l2:.3f} | {stretch.linf:.2f} | {stretch.angle:.4f} "
            f"| {stretch.area:.4f} | {found.seam_length:.2f} | {found.fill:.3f} "
            f"| {found.n_mirrored:,} | {found.n_overlapping:,} |"
        )


def unwrapped(name, mesh, qualities, blender_faces, slow):
    """Yield what each program makes of a mesh; Blender and xatlas where they end in time."""
    from texbake.mapping.corner_uvs import with_coordinates
    from texbake.mapping.distortion import distortion

    programs = {f"texbake {quality}": (by_texbake, quality) for quality in qualities}
    if mesh.n_faces <= XATLAS_FACES or slow:
        programs["xatlas"] = by_xatlas, None
    if BLENDER and mesh.n_faces <= blender_faces:
        programs["Blender, Smart UV Project"] = by_blender, "smart"
        programs["Blender, minimum stretch"] = by_blender, "minimum-stretch"
    for program, (run, setting) in programs.items():
        corners, seconds = run(mesh, setting)
        found = distortion(with_coordinates(mesh, corners), SIZE)
        yield Atlas(name, mesh.n_faces, program, seconds, found)


def by_texbake(mesh, quality):
    start = time.process_time()
    made = texbake.unwrap(mesh, size=SIZE, padding=GAP // 2, quality=quality)
    return made.corner_uvs(), time.process_time() - start


def by_xatlas(mesh, _):
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
    sides = np.array([atlas.width, atlas.height]) / max(atlas.width, atlas.height)
    return uvs[faces] * sides, seconds


def by_blender(mesh, method):
    with tempfile.TemporaryDirectory() as folder:
        there, back = Path(folder) / "in.npz", Path(folder) / "out.npz"
        np.savez(there, positions=mesh.positions, faces=mesh.faces)
        script = Path(__file__).parent / "blender_unwrap.py"
        done = subprocess.run(
            [str(word) for word in (BLENDER, script, there, back, method, SIZE, GAP)],
            capture_output=True, text=True, check=True, timeout=1800,
        )  # fmt: skip
        seconds = json.loads(done.stdout.strip().splitlines()[-1])["seconds"]
        return np.load(back)["corners"], seconds


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


PEER_OPTIONS = (
    {},
    {"preserveboundary": True, "planarquadric": True},
    {"preservetopology": True, "preserveboundary": True, "preservenormal": True},
)
FOLDERS = ("meshes", "pairs/*", "gltf", "gltf/*", "broken")
SUFFIXES = (".obj", ".ply", ".stl", ".glb", ".gltf")
BARE = "without seams"
MOST_RATIO = 1.05
TIMEOUT = 240.0  # seconds for a mesh


def simplify(*meshes, faces=(500, 2_000, 10_000), most=300_000):
    """How far simplified meshes lie from what they were made of, beside pymeshlab's best.

    Without meshes, those of the data folder of at most `--most` triangles. Errors are RMS distances
    of both surfaces, in percent of the diagonal. pymeshlab's is the least of three ways to set it,
    of those that reach the count. It does not look at texture coordinates, hard edges and groups,
    which texbake keeps; a second row has texbake's error of the bare surface.
    """
    paths = meshes or [path for part in FOLDERS for path in sorted(DATA.glob(f"{part}/*"))]
    row = table("mesh", *(f"{n:,} faces" for n in faces))
    rows = []
    for path in paths:
        if str(path).lower().endswith(SUFFIXES):
            try:
                found = in_child(simplified, path, faces, most, timeout=TIMEOUT)
            except (subprocess.SubprocessError, ValueError) as error:
                print(f"{path}: {error}", file=sys.stderr)
                continue
            for cells in found:
                row(*cells)
            rows += found
    for title, is_bare in ("as they are", False), (BARE, True):
        words = " ".join(" ".join(cells) for cells in rows if (BARE in cells[0]) == is_bare)
        ratios = [float(ratio) for ratio in re.findall(r"= ([\d.]+)", words)]
        n_above = sum(ratio > MOST_RATIO for ratio in ratios)
        median = statistics.median(ratios) if ratios else math.nan
        print(f"{title}: {len(ratios)} ratios, median {median:.2f}, {n_above} above {MOST_RATIO}")


def simplified(path, counts, most):
    """Rows of a mesh: both errors and their ratio for each count."""
    mesh = texbake.read_mesh(path)
    if mesh.n_faces > most:
        return []
    peers = {n: peer_error(mesh, n) for n in counts if n <= 0.8 * mesh.n_faces}
    name = "/".join(Path(path).parts[-2:])
    kinds = {name: mesh}
    if mesh.uvs is not None or mesh.normals is not None or len(mesh.group_names) > 1:
        kinds[f"{name}, {BARE}"] = Mesh(positions=mesh.positions, faces=mesh.faces, name=mesh.name)
    return [
        [name, *(cell(own, n, peers[n]) if n in peers else "" for n in counts)]
        for name, own in kinds.items()
    ]


def peer_error(mesh, n_faces):
    """The least error of what pymeshlab makes; infinite where it does not reach the count."""
    from texbake.mesh.distance import surface_distance

    errors = [math.inf]
    for options in PEER_OPTIONS:
        meshes = as_meshlab(mesh)
        meshes.meshing_remove_duplicate_vertices()
        meshes.meshing_decimation_quadric_edge_collapse(targetfacenum=n_faces, **options)
        low = from_meshlab(meshes)
        if 0 < low.n_faces <= 1.02 * n_faces:
            errors.append(surface_distance(mesh, low).rms_relative)
    return min(errors)


def cell(mesh, n_faces, peer):
    """Both errors and their ratio, or how many faces are left where that is more."""
    from texbake.mesh.simplify import simplify_with_report

    low, report = simplify_with_report(mesh, n_faces, quality="best")
    error = report.distance.rms_relative
    theirs = "none" if math.isinf(peer) else f"{100 * peer:.4f}"
    text = f"{100 * error:.4f} / {theirs}"
    if low.n_faces > 1.01 * n_faces:
        return f"{text} ({low.n_faces} faces)"  # nothing to compare
    return text if math.isinf(peer) else f"{text} = {error / peer:.2f}"


def as_meshlab(mesh):
    import pymeshlab

    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(mesh.positions, mesh.faces))
    return meshes


def from_meshlab(meshes):
    mesh = meshes.current_mesh()
    return Mesh(positions=mesh.vertex_matrix(), faces=mesh.face_matrix().astype(np.int32))


def remesh(*mesh, resolution=256, triangles=5_000_000, most=300_000):
    """Wrapping triangles in a closed surface, beside pymeshlab's alpha wrap.

    Without a file, a sphere with a relief is made of that many triangles. The alpha wrap gets the
    side of a voxel as alpha and a thirtieth of it as offset. It is left out where the mesh has more
    than `--most` triangles, because it would take hours.
    """
    row = table("program", "faces", "processor, s", "seconds", "peak memory", "closed",
                "intersecting", "distance in voxels: mean", "greatest")  # fmt: skip
    for program in wrap_by_texbake, wrap_by_meshlab:
        cells = in_child(wrap, program.__name__, mesh, resolution, triangles, most)
        if cells:
            row(*cells)


def wrap(program, files, resolution, triangles, most):
    """A row of figures; None where it would take too long."""
    from texbake.mesh.distance import surface_distance
    from texbake.mesh.topology import find_edges

    mesh = texbake.read_mesh(files[0]) if files else wavy_sphere(triangles)
    if program == wrap_by_meshlab.__name__ and mesh.n_faces > most:
        return None
    voxel = float(np.ptp(mesh.bounds, axis=0).max()) / resolution
    start, started = time.process_time(), time.perf_counter()
    result = globals()[program](mesh, resolution, voxel)
    seconds, elapsed = time.process_time() - start, time.perf_counter() - started
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    apart = surface_distance(result, mesh).a_to_b
    crossing = as_meshlab(result)
    crossing.compute_selection_by_self_intersections_per_face()
    return [
        program.removeprefix("wrap_by_"), f"{result.n_faces:,}", f"{seconds:.1f}",
        f"{elapsed:.1f}", f"{peak:.2f} GB", find_edges(result.faces).closed,
        f"{crossing.current_mesh().selected_face_number():,}", f"{apart.mean / voxel:.3f}",
        f"{apart.max / voxel:.2f}",
    ]  # fmt: skip


def wrap_by_texbake(mesh, resolution, voxel):
    return texbake.remesh(mesh, texbake.RemeshOptions(resolution=resolution))


def wrap_by_meshlab(mesh, resolution, voxel):
    import pymeshlab

    meshes = as_meshlab(mesh)
    meshes.generate_alpha_wrap(
        alpha=pymeshlab.PureValue(voxel), offset=pymeshlab.PureValue(voxel / 30.0)
    )
    return from_meshlab(meshes)


def wavy_sphere(n_triangles):
    from texbake.mesh.shapes import grid_sphere

    n = int(np.sqrt(n_triangles / 4))
    ball = grid_sphere(n, 2 * n)
    waves = np.sin(40.0 * ball.positions).prod(axis=1, keepdims=True)
    return ball.replace(positions=ball.positions * (1.0 + 0.02 * waves))


if __name__ == "__main__":
    run_commands(globals(), unwrap, simplify, remesh)
