"""texbake's mesh readers against those of trimesh: time, memory, and what they say of broken files.

    python tests/benchmarks/bench_mesh_readers.py [--rounds N] [--small]

Every reading happens in a process of its own that has read the file once before, so that imports
and compiling are not measured. Time is the least of the rounds; memory is how far the resident size
rose above what it was before (Linux only). Large files are written from the largest real scan, in
each format, and a mesh of 20,000 parts, as CAD programs write them. Broken files are made from a
good one: an error of one line is what a reader should give; "silent" means that it returned a mesh
all the same. Prints two tables in Markdown.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import texbake
from texbake.mesh.shapes import plane, uv_sphere

DATA = Path(os.environ.get("TEXBAKE_DATA", Path(__file__).parents[3] / "shared" / "data"))
REAL = (
    "meshes/pizza.obj", "meshes/boat.obj", "meshes/hubmap_vh_male_merged.ply",
    "meshes/ADIS16480.STL", "meshes/VH_F_Skin.glb", "gltf/GlamVelvetSofa.glb",
)  # fmt: skip
SCAN = "meshes/mri_skin.ply"
N_PARTS = 20_000
FORMATS = (".obj", ".ply", ".stl", ".off", ".glb")
CHILD = """
import json, sys, time, warnings
from pathlib import Path
warnings.simplefilter("ignore")
reader, warm, path = sys.argv[1:]
if reader == "texbake":
    from texbake import read_mesh as read
else:
    import trimesh
    def read(path):
        scene = trimesh.load_scene(path, process=False)
        meshes = scene.to_geometry()
        assert len(meshes.faces)  # lazy arrays are read now
        return meshes
def resident(field):
    status = Path("/proc/self/status").read_text()
    return int(status.split(field + ":")[1].split()[0])
read(warm)
Path("/proc/self/clear_refs").write_text("5")  # the peak begins anew
before = resident("VmRSS")
start = time.perf_counter()
try:
    mesh = read(path)
    said = "silent"
except Exception as error:
    kinds = [kind.__name__ for kind in type(error).__mro__]
    said = "one line" if "TexbakeError" in kinds else type(error).__name__
seconds = time.perf_counter() - start
after = resident("VmHWM")
print(json.dumps([seconds, (after - before) / 1024, said]))
"""


def measured(reader: str, warm: Path, path: Path) -> tuple[float, float, str]:
    """Seconds, MiB and what a reader said, in a process of its own."""
    done = subprocess.run(
        [sys.executable, "-P", "-c", CHILD, reader, warm, path],
        capture_output=True, text=True, timeout=600, check=False,
    )  # fmt: skip
    if done.returncode:
        return float("nan"), float("nan"), "crash"
    seconds, mebibytes, said = json.loads(done.stdout.splitlines()[-1])
    return seconds, mebibytes, said


def broken_files(good: Path) -> dict[str, Path]:
    """Files made from a good one, each with one fault."""
    data = good.read_bytes()
    faults = {"empty": b"", "half of it": data[: len(data) // 2], "not this format": b"\x07" * 4096}
    suffix = good.suffix
    if suffix == ".obj":
        faults["index out of range"] = data.replace(b"f 1/", b"f 999999/", 1)
        faults["not a number"] = data.replace(b"v ", b"v nan ", 1)
        faults["letters for a number"] = data.replace(b"v ", b"v abc ", 1)
    elif suffix == ".off":
        faults["index out of range"] = data.replace(b"\n3 ", b"\n3 999999 ", 1)
        lines = data.split(b"\n")
        faults["not a number"] = b"\n".join([*lines[:2], b"nan 0 0", *lines[3:]])
        faults["letters for a number"] = b"\n".join([*lines[:2], b"abc 0 0", *lines[3:]])
    else:
        starts = {".ply": data.find(b"end_header\n") + 11, ".stl": 84 + 12}
        at = starts.get(suffix, len(data) // 4)
        spoiled = bytearray(data)
        spoiled[at : at + 4] = np.float32("nan").tobytes()
        if suffix == ".ply":
            spoiled[at : at + 4] = data[at : at + 4]
            spoiled[-4:] = (999_999).to_bytes(4, "little")
            faults["index out of range"] = bytes(spoiled)
            spoiled[at : at + 8] = np.float64("nan").tobytes()
        if suffix != ".glb":
            faults["not a number"] = bytes(spoiled)
    paths = {}
    for number, (fault, content) in enumerate(faults.items()):
        paths[fault] = good.with_name(f"broken{number}{suffix}")
        paths[fault].write_bytes(content)
    return paths


def write_parts(path: Path) -> Path:
    """Write a mesh of many small groups: in a GLB file, each is a node with arrays of its own."""
    sheet = plane(100, N_PARTS // 100)
    quads = np.arange(sheet.n_faces) // 2
    names = tuple(f"part {i}" for i in range(N_PARTS))
    texbake.write_mesh(sheet.replace(face_groups=quads, group_names=names), path)
    return path


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--small", action="store_true", help="Leave out the large files.")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        small = {suffix: folder / f"small{suffix}" for suffix in FORMATS}
        sphere = uv_sphere(16, 32)
        for suffix, path in small.items():
            # The last bytes of a PLY file are to be an index.
            bare = sphere.replace(uvs=None, uv_faces=None)
            texbake.write_mesh(bare if suffix == ".ply" else sphere, path)
        files = [DATA / file for file in REAL]
        files += [write_parts(folder / f"parts{suffix}") for suffix in (".glb", ".obj")]
        if not arguments.small:
            scan = texbake.read_mesh(DATA / SCAN)
            for suffix in FORMATS:
                files.append(folder / f"mri_skin{suffix}")
                texbake.write_mesh(scan, files[-1])
        print("| file | MB | texbake s | trimesh s | texbake MiB | trimesh MiB |")
        print("|---|---|---|---|---|---|")
        for path in files:
            row = [path.name, f"{path.stat().st_size / 1e6:.1f}"]
            best = {}
            for _ in range(arguments.rounds):
                for reader in ("texbake", "trimesh"):
                    one = measured(reader, path, path)
                    best[reader] = min(best.get(reader, one), one)
            row += [f"{best[reader][0]:.3f}" for reader in best]
            row += [f"{best[reader][1]:.0f}" for reader in best]
            print("|", " | ".join(row), "|", flush=True)
        print("\n| broken file | texbake | trimesh |\n|---|---|---|")
        for suffix, good in small.items():
            for fault, path in broken_files(good).items():
                said = [measured(reader, good, path)[2] for reader in ("texbake", "trimesh")]
                print("|", " | ".join([f"{suffix}, {fault}", *said]), "|", flush=True)


if __name__ == "__main__":
    main()
