"""Meshes: closed wraps beside pymeshlab's, and `texbake run` on every model of the data folder.

python tests/benchmarks/bench_meshes.py remesh | models
"""

import json
import resource
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from harness import DATA, in_child, run_commands, table
from PIL import Image, ImageDraw, ImageFont, ImageOps

import texbake
from texbake.errors import TexbakeError
from texbake.mesh.mesh import Mesh
from texbake.rendering.compare_models import compare_models


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


PATTERNS = ("meshes/*", "pairs/*/high.obj", "pairs/*/LeePerrySmith.obj", "broken/*", "gltf/*.glb",
            "gltf/*/*.gltf")  # fmt: skip
SUFFIXES = (".obj", ".ply", ".stl", ".glb", ".gltf")
COLUMNS = 5
TILE = (210, 168)  # pixels of one of the two pictures
LINE = 16  # pixels of a line of text
MODEL, ASSET = 0, 2  # panels of the preview that the sheet shows
BACKGROUND = (24, 26, 30)


def models(*names, out="models", faces=0, picture=None):
    """`texbake run` on every model of the data folder: figures of each asset, and a sheet of all.

    Models are single meshes, high-poly meshes of pairs, broken meshes and glTF models. Each gets
    --faces triangles, or a tenth of its own, 500 at least and 5,000 at most, and maps of 1024².
    Assets stay in the folder --out; a model whose asset is there already is not made again.
    --picture names a sheet with each model beside its asset.
    """
    paths = [
        path
        for pattern in PATTERNS
        for path in sorted(DATA.glob(pattern))
        if path.suffix.lower() in SUFFIXES and any(name in str(path) for name in names or [""])
    ]
    row = table("model", "triangles", "asset", "bare", "with its normal map", "displaced as well",
                "warnings", "time")  # fmt: skip
    entries = []
    for path in paths:
        folder = Path(out) / name_of(path)
        entries.append((make_asset(path, folder, faces), path, folder))
        row(*cells_of(entries[-1][0]))
    figures = [entry["compare"] for entry, *_ in entries if "compare" in entry]
    decibels = [(found["mapped"]["psnr_db"], found["bare"]["psnr_db"]) for found in figures]
    better = [one - other for one, other in decibels if None not in (one, other)]
    print(
        f"\n{len(figures)} of {len(entries)} models gave an asset; the normal map "
        f"changes PSNR by {np.median(better):+.1f} dB in the median."
    )
    if picture:
        sheet(entries).save(picture, optimize=True, quality=85)


def name_of(path):
    return path.parent.name if path.stem == "high" else path.stem


def make_asset(path, folder, n_faces):
    """Run the command, and keep its exit status, time and what it printed."""
    record = folder / "record.json"
    if record.exists():
        return json.loads(record.read_text())
    try:
        triangles = texbake.read_mesh(path).n_faces
    except TexbakeError:
        triangles = 0
    faces = n_faces or min(max(triangles // 10, 500), 5000)
    command = [sys.executable, "-m", "texbake", "run", str(path), "-o", str(folder)]
    command += ["--faces", str(faces), "--size", "1024", "--compare", "full"]
    command += ["--progress", "none"]
    start = time.perf_counter()
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    entry = {
        "name": name_of(path), "triangles": triangles, "status": ended.returncode,
        "seconds": time.perf_counter() - start, "says": ended.stderr.strip(),
    }  # fmt: skip
    folder.mkdir(parents=True, exist_ok=True)
    for report in folder.glob("*_report.json"):
        made = json.loads(report.read_text())
        entry |= {"faces": made["simplify"]["n_faces"], "compare": made["compare"]}
    record.write_text(json.dumps(entry))
    return entry


def cells_of(entry):
    head = [entry["name"], f"{entry['triangles']:,}"]
    if "compare" not in entry:
        return [*head, entry["says"]]

    def cell(key):
        figures = entry["compare"].get(key)
        if figures is None:
            return "-"
        # Reports leave PSNR out where both pictures are the same.
        decibels = "equal" if figures["psnr_db"] is None else f"{figures['psnr_db']:.1f} dB"
        mismatches = (figures["outline_mismatch"], figures["depth_mismatch"])
        shares = " + ".join(f"{100 * share:.1f} %" for share in mismatches)
        return f"{decibels}, {figures['mean_deg']:.1f}°, {shares}"

    figures = [cell(key) for key in ("bare", "mapped", "displaced")]
    warnings = entry["says"].count("warning")
    return [*head, f"{entry['faces']:,}", *figures, warnings, f"{entry['seconds']:.0f} s"]


def panel(picture, index):
    """One of the four panels of a file of pictures, without its caption."""
    width = picture.width // 4
    strip = picture.crop((index * width, 0, (index + 1) * width, picture.height))
    # The page shows at the rim of the strip, and again where the caption begins.
    middle = np.asarray(strip)[:, width // 2]
    inside = (middle != middle[0]).any(axis=1)
    top = int(inside.argmax())
    below = np.flatnonzero(~inside[top:])
    bottom = top + int(below[0]) if len(below) else strip.height
    return strip.crop((0, top, width, bottom))


def pictures_of(path, folder):
    """The model and its asset: with their materials if it has images, else as run drew them."""
    mesh = texbake.read_mesh(path)
    materials = texbake.read_materials(path, mesh)
    if materials is not None and materials.has_images:
        (asset,) = folder.glob("*_low.glb")
        options = texbake.RenderOptions(width=2 * TILE[0], height=2 * TILE[1])
        seen = compare_models(path, asset, n_views=1, options=options)
        return [Image.fromarray(seen.before[0]), Image.fromarray(seen.after[0])]
    (preview,) = folder.glob("*_preview.png")
    with Image.open(preview) as picture:
        return [panel(picture, which).copy() for which in (MODEL, ASSET)]


def sheet(entries):
    """All models in rows of COLUMNS, each beside its asset."""
    cell = (2 * TILE[0] + 8, TILE[1] + 2 * LINE + 8)
    rows = -(-len(entries) // COLUMNS)
    canvas = Image.new("RGB", (COLUMNS * cell[0], rows * cell[1]), BACKGROUND)
    draw, font = ImageDraw.Draw(canvas), ImageFont.load_default(13)
    for index, (entry, path, folder) in enumerate(entries):
        x, y = index % COLUMNS * cell[0], index // COLUMNS * cell[1]
        for place, picture in enumerate(pictures_of(path, folder) if "faces" in entry else []):
            fitted = ImageOps.pad(picture.convert("RGB"), TILE, color=BACKGROUND)
            canvas.paste(fitted, (x + place * TILE[0] + 4, y + 4))
        made = entry.get("faces")
        below = f"{entry['triangles']:,} to {made:,} triangles" if made else "no asset: an error"
        draw.text((x + 6, y + TILE[1] + 4), entry["name"][:36], fill=(235, 235, 235), font=font)
        draw.text((x + 6, y + TILE[1] + 4 + LINE), below, fill=(160, 164, 170), font=font)
    return canvas


if __name__ == "__main__":
    run_commands(globals(), remesh, models)
