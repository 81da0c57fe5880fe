"""Meshes like those of 3D generators, finished by texbake and by pymeshlab with xatlas.

python tests/benchmarks/bench_generated.py run --count 200
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before numpy is loaded

import json
import resource
import statistics
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
from harness import in_child, run_commands, table

KINDS = ("closed", "noisy", "doubled", "holes", "bits", "open", "soup")
LEAST, LARGE, MOST = 100_000, 500_000, 2_000_000
N_FACES, SIZE = 10_000, 2048
PROGRAMS = ("texbake", "others")


def noise(rng, n, cells):
    """(n, n, n) values about 0: random ones on a coarse grid, interpolated linearly."""
    coarse = rng.standard_normal((cells + 1,) * 3).astype(np.float32)
    places = np.linspace(0, cells, n, dtype=np.float32)
    first = np.minimum(places.astype(int), cells - 1)
    share = places - first
    for axis in range(3):
        shape = [1, 1, 1]
        shape[axis] = n
        low, high = coarse.take(first, axis), coarse.take(first + 1, axis)
        coarse = low + (high - low) * share.reshape(shape)
    return coarse


def distances(rng, kind, n):
    """Signed distances of a model in [-1, 1], made of balls and boxes, with noise."""
    x, y, z = np.ogrid[[slice(-1, 1, n * 1j)] * 3]
    x, y, z = (axis.astype(np.float32) for axis in (x, y, z))
    values = np.full((n, n, n), 9, np.float32)
    for i in range(7):
        center, size = rng.uniform(-0.45, 0.45, 3), rng.uniform(0.12, 0.35)
        if i % 2:
            sides = rng.uniform(0.08, 0.35, 3)
            boxes = [abs(a - c) - s for a, c, s in zip((x, y, z), center, sides, strict=True)]
            part = np.maximum(np.maximum(boxes[0], boxes[1]), boxes[2])
        else:
            part = (
                np.sqrt((x - center[0]) ** 2 + (y - center[1]) ** 2 + (z - center[2]) ** 2) - size
            )
        np.minimum(values, part, out=values)
    values += 0.02 * noise(rng, n, 12) + 0.006 * noise(rng, n, 48)
    if kind == "noisy":
        values += 0.05 * noise(rng, n, 32)
    if kind == "doubled":
        values = abs(values) - 0.015
    if kind == "bits":
        for center in rng.uniform(-0.95, 0.95, (200, 3)):
            near = tuple(
                slice(*np.searchsorted(axis.ravel(), (c - 0.02, c + 0.02)))
                for axis, c in zip((x, y, z), center, strict=True)
            )
            axes = np.meshgrid(*(a.ravel()[s] for a, s in zip((x, y, z), near, strict=True)))
            ball = np.sqrt(sum((a - c) ** 2 for a, c in zip(axes, center, strict=True))) - 0.012
            values[near] = np.minimum(values[near], ball.swapaxes(0, 1))
    edge = np.ones((n, n, n), bool)
    edge[1:-1, 1:-1, 1:-1] = False
    values[edge] = np.maximum(values[edge], 0.01)  # closed at the border of the grid
    return values


def wanted(seed):
    """Kind and approximate number of faces of a mesh: all sizes in all kinds, evenly by decades."""
    return KINDS[seed % len(KINDS)], LEAST * (MOST / LEAST) ** ((seed * 0.618034) % 1)


def subdivided(vertices, faces):
    """Four faces in place of each, with waves that the coarse faces cannot hold."""
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    ends, middles = np.unique(edges, axis=0, return_inverse=True)
    middles = middles.reshape(-1, 3) + len(vertices)
    vertices = np.concatenate([vertices, vertices[ends].mean(axis=1)])
    corners = [np.stack([faces[:, i], middles[:, i], middles[:, i - 1]], axis=1) for i in range(3)]
    return vertices + 0.001 * np.sin(150 * vertices[:, [1, 2, 0]]), np.concatenate(
        [*corners, middles]
    )


def made(path, seed):
    """Write one mesh; return its number of faces."""
    from skimage.measure import marching_cubes

    kind, n_faces = wanted(seed)
    is_large = n_faces > LARGE  # a grid would take gigabytes
    n = 96
    for _ in range(2):  # faces grow with the square of the grid
        rng = np.random.default_rng(seed)
        values, sides = distances(rng, kind, n), (2 / (n - 1),) * 3
        vertices, faces, *_ = marching_cubes(values, 0.0, spacing=sides)
        n = min(round(n * (n_faces / (4 if is_large else 1) / len(faces)) ** 0.5), 400)
    vertices = vertices - 1
    if is_large:
        vertices, faces = subdivided(vertices, faces)
    vertices = vertices.astype(np.float32)
    if kind == "holes":
        for center in vertices[rng.integers(0, len(vertices), 12)]:
            far = ((vertices - center) ** 2).sum(axis=1) > rng.uniform(0.01, 0.06) ** 2
            faces = faces[far[faces].all(axis=1)]
    if kind == "open":
        faces = faces[(vertices[:, 1] > -0.15)[faces].all(axis=1)]
    if kind == "soup":
        vertices, faces = vertices[faces].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3)
        flipped = rng.random(len(faces)) < 0.02
        faces[flipped] = faces[flipped, ::-1]
        faces = np.concatenate([faces, faces[: len(faces) // 50]])
    np.savez(path, vertices=vertices, faces=faces.astype(np.int32))
    return len(faces)


def has_border(vertices, faces):
    """Whether an edge has only one face, once vertices at the same place are merged."""
    _, ids = np.unique(np.asarray(vertices, np.float32), axis=0, return_inverse=True)
    faces = ids.reshape(-1)[faces]
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1).astype(np.int64)
    _, counts = np.unique(edges[:, 0] << 32 | edges[:, 1], return_counts=True)
    return bool((counts == 1).any())


def by_texbake(vertices, faces, folder):
    """Finish a mesh; return the vertices and faces of the result."""
    import texbake

    done = texbake.finish(
        vertices, faces, n_faces=N_FACES, size=SIZE, output=Path(folder) / "done.glb",
        sample=lambda points, normals: 0.5 + 0.5 * np.sin(20 * points),
    )  # fmt: skip
    return done.mesh.positions, done.mesh.faces, {s.name: s.seconds for s in done.stages}


def by_others(vertices, faces, folder):
    """Remove small parts, reduce and unwrap as Hunyuan3D-2 does; nothing is baked."""
    import pymeshlab
    import xatlas

    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(vertex_matrix=vertices.astype(np.float64), face_matrix=faces))
    meshes.compute_selection_by_small_disconnected_components_per_face(nbfaceratio=0.005)
    meshes.compute_selection_transfer_face_to_vertex(inclusive=False)
    meshes.meshing_remove_selected_vertices_and_faces()
    start = time.perf_counter()
    meshes.meshing_decimation_quadric_edge_collapse(
        targetfacenum=N_FACES, qualitythr=1.0, preserveboundary=True, boundaryweight=3,
        preservenormal=True, preservetopology=True, autoclean=True,
    )  # fmt: skip
    low = meshes.current_mesh()
    vertices, faces = low.vertex_matrix(), low.face_matrix()
    middle = time.perf_counter()
    mapping, indices, _ = xatlas.parametrize(vertices, faces)
    stages = {"simplify": middle - start, "unwrap": time.perf_counter() - middle}
    return vertices[mapping], indices, stages


def measured(program, path, folder):
    """Run a program on a mesh; return its figures."""
    arrays = np.load(path)
    vertices, faces = arrays["vertices"], arrays["faces"]
    before, start = time.process_time(), time.perf_counter()
    low, low_faces, stages = {"texbake": by_texbake, "others": by_others}[program](
        vertices, faces, folder
    )
    return {
        "seconds": time.perf_counter() - start, "processor": time.process_time() - before,
        "n_faces": len(low_faces),
        "border": [has_border(vertices, faces), has_border(low, low_faces)],
        "memory": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024, "stages": stages,
    }  # fmt: skip


def read_from(path, file):
    """Write the mesh of a file as `made` does; return its number of faces."""
    import texbake

    mesh = texbake.read_mesh(file)
    np.savez(path, vertices=mesh.positions, faces=mesh.faces)
    return mesh.n_faces


def run(*files, count=200, first=0, limit=300, least=0, most=MOST, programs=PROGRAMS, log=""):
    """Make meshes, or read files, and finish them by both programs, each in its own process."""
    rows = []
    row = table("mesh", "kind", "faces", "program", "seconds", "processor s", "result")
    seeds = [seed for seed in range(first, first + count) if least <= wanted(seed)[1] <= most]
    with tempfile.TemporaryDirectory() as folder:
        path = f"{folder}/mesh.npz"
        for source in files or seeds:
            kind = "file" if files else wanted(source)[0]
            n_faces = in_child(read_from if files else made, path, source)
            for program in programs:
                name = Path(source).name if files else source
                found = {"mesh": name, "kind": kind, "faces": n_faces, "program": program}
                try:
                    found |= in_child(measured, program, path, folder, timeout=limit)
                except subprocess.TimeoutExpired:
                    found["failed"] = "hang"
                except subprocess.CalledProcessError as error:
                    found["failed"] = f"exit {error.returncode}"
                rows.append(found)
                result = found.get("failed") or f"{found['n_faces']:,} {found['border']}"
                times = (f"{found.get(key, 0):.1f}" for key in ("seconds", "processor"))
                row(name, kind, f"{n_faces:,}", program, *times, result)
                if log:
                    with Path(log).open("a", encoding="utf-8") as file:
                        file.write(json.dumps(found) + "\n")
    summary(rows)


def picture(*, path="docs/images/generated-meshes.png", seed=18, size=480):
    """Draw a raw mesh and its finished model side by side."""
    import texbake

    def colors(points, normals):
        waves = np.sin(18 * points)
        return 0.5 + 0.3 * waves * np.roll(waves, 1, axis=1)

    with tempfile.TemporaryDirectory() as folder:
        made(f"{folder}/mesh.npz", seed)
        arrays = np.load(f"{folder}/mesh.npz")
        raw = texbake.Mesh(positions=arrays["vertices"], faces=arrays["faces"])
        texbake.write_mesh(raw, f"{folder}/raw.ply")
        texbake.finish(
            raw.positions, raw.faces, n_faces=4000, size=1024, sample=colors, least_part=0.005,
            output=f"{folder}/done.glb",
        )  # fmt: skip
        drawn = []
        for name in ("raw.ply", "done.glb"):
            command = ["texbake", "preview", f"{folder}/{name}", "-o", f"{folder}/drawn.png"]
            subprocess.run([*command, "--size", str(size), "--quiet"], check=True)
            drawn.append(texbake.read_image(f"{folder}/drawn.png", color=True).pixels)
    texbake.write_image(np.concatenate(drawn, axis=1), path, color=True, bits=8)


def summary(rows):
    """Print a table of both programs."""
    row = table("program", "meshes", "finished", "closed or open as before", "seconds, median",
                "95 %", "processor seconds, median", "95 %", "within 20 s", "hangs")  # fmt: skip
    for program in PROGRAMS:
        own = [found for found in rows if found["program"] == program]
        done = [found for found in own if "failed" not in found]
        same = [found for found in done if found["border"][0] == found["border"][1]]
        times = []
        for key in ("seconds", "processor"):
            sorted_times = sorted(found[key] for found in done) or [0.0]
            times += [statistics.median(sorted_times), sorted_times[int(0.95 * (len(done) - 1))]]
        quick = sum(found["seconds"] <= 20 for found in done)
        hangs = sum(found.get("failed") == "hang" for found in own)
        row(program, len(own), len(done), len(same), *(f"{t:.1f}" for t in times), quick, hangs)


def read(*, log="generated.jsonl"):
    """Print the table of an earlier run."""
    summary([json.loads(line) for line in Path(log).read_text("utf-8").splitlines()])


if __name__ == "__main__":
    run_commands(globals(), run, read, picture)
