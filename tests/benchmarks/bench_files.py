"""From files to files: readers of meshes beside trimesh, `lighten`, and builds.

python tests/benchmarks/bench_files.py readers | lighten | build
"""

import os
import socket
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
from harness import DATA, in_child, run_commands, table

import texbake
from texbake.mesh.shapes import grid_sphere, plane

REAL = (
    "meshes/pizza.obj", "meshes/boat.obj", "meshes/hubmap_vh_male_merged.ply",
    "meshes/ADIS16480.STL", "meshes/VH_F_Skin.glb", "gltf/GlamVelvetSofa.glb",
)  # fmt: skip
SCAN = "meshes/mri_skin.ply"
N_PARTS = 20_000
FORMATS = (".obj", ".ply", ".stl", ".off", ".glb")
READERS = ("texbake", "trimesh")


def readers(*files, rounds=3, small=False):
    """Mesh readers beside those of trimesh: time and memory.

    Every reading happens in a process of its own that has read the file once before, so that
    imports and compiling are not measured. Time is the least of the rounds; memory is how far the
    resident size rose above what it was before (Linux only). Without files, those of the data
    folder, meshes of 20,000 parts as CAD programs write them, and, unless `--small`, the largest
    scan in each format.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        paths = [Path(file) for file in files] or [
            *(DATA / file for file in REAL),
            *(write_parts(folder / f"parts{suffix}") for suffix in (".glb", ".obj")),
        ]
        if not files and not small:
            scan = texbake.read_mesh(DATA / SCAN)
            for suffix in FORMATS:
                paths.append(folder / f"mri_skin{suffix}")
                texbake.write_mesh(scan, paths[-1])
        row = table("file", "MB", *(f"{reader}, s" for reader in READERS),
                    *(f"{reader}, MiB" for reader in READERS), "times")  # fmt: skip
        for path in paths:
            found = [[in_child(read_once, reader, path) for reader in READERS]
                     for _ in range(rounds)]  # fmt: skip
            (ours, our_memory), (theirs, their_memory) = (
                min(one[k] for one in found) for k in range(2)
            )
            row(path.name, f"{path.stat().st_size / 1e6:.1f}", f"{ours:.3f}", f"{theirs:.3f}",
                f"{our_memory:.0f}", f"{their_memory:.0f}", f"{theirs / ours:.1f}")  # fmt: skip


def read_once(reader, path):
    """Seconds and MiB of the second reading of a file."""
    import warnings

    import trimesh

    warnings.simplefilter("ignore")

    def read():
        if reader == "texbake":
            return texbake.read_mesh(path)
        mesh = trimesh.load_scene(path, process=False).to_geometry()
        assert len(mesh.faces)  # lazy arrays are read now
        return mesh

    def resident(field):
        return int(Path("/proc/self/status").read_text().split(f"{field}:")[1].split()[0])

    read()
    Path("/proc/self/clear_refs").write_text("5")  # the peak begins again
    before = resident("VmRSS")
    start = time.perf_counter()
    read()
    return time.perf_counter() - start, (resident("VmHWM") - before) / 1024


def write_parts(path):
    """Write a mesh of many small groups: in a GLB file, each is a node with arrays of its own."""
    sheet = plane(100, N_PARTS // 100)
    quads = np.arange(sheet.n_faces) // 2
    names = tuple(f"part {i}" for i in range(N_PARTS))
    texbake.write_mesh(sheet.replace(face_groups=quads, group_names=names), path)
    return path


def lighten(*models, out="lightened", faces=0, size=0):
    """`texbake lighten`: bytes and PSNR of models before and after.

    They get a tenth of their triangles unless `--faces` is given.
    """
    from texbake.jobs.lighten_options import LightenOptions
    from texbake.verbs.whole_jobs import lighten_file

    folder = Path(out)
    folder.mkdir(parents=True, exist_ok=True)
    row = table("model", "triangles", "lightened", "texels", "bytes", "lightened", "",
                "PSNR, mean", "worst")  # fmt: skip
    for model in map(Path, models):
        options = LightenOptions(n_faces=faces or None, size=size or None, compress=True)
        report = lighten_file(model, folder / f"{model.stem}.glb", options).report
        row(model.stem, f"{report.n_faces_before:,}", f"{report.n_faces:,}",
            "-" if report.size is None else report.size[0], f"{report.n_bytes_before:,}",
            f"{report.n_bytes:,}", f"{100 * report.n_bytes / report.n_bytes_before:.1f} %",
            f"{report.comparison.mean_db:.1f} dB",
            f"{report.comparison.worst_db:.1f} dB")  # fmt: skip


PIPELINE = """
[[assets]]
inputs.low = "low/*.obj"
inputs.high = "high/{{stem}}.ply"
[steps.atlas]
do = "unwrap"
mesh = "low"
size = {size}
quality = "{quality}"
[steps.maps]
do = "bake"
high = "high"
low = "atlas"
size = {size}
output = "{{asset}}_{{output}}.{{ext}}"
"""


def build(assets=200, size=512, quality="good", dask=False):
    """Throughput of a build: one worker against two, the overhead, and a second run.

    Assets are different spheres of 5,000 to 20,000 triangles. Each is unwrapped, and a sphere of
    more triangles with a relief is baked onto it. Every worker has one thread, so the comparison is
    of workers and not of threads. Overhead is the share of the workers' time outside steps:
    starting, checksums, copies, waiting.
    """
    from texbake.building.build import build as build_pipeline
    from texbake.building.options import BuildOptions

    def timed(folder, **options):
        start = time.perf_counter()
        result = build_pipeline(path, BuildOptions(folder=root / folder, **options))
        assert result.ok, result.failed[0].error
        return time.perf_counter() - start, result

    with tempfile.TemporaryDirectory() as name:
        root = Path(name)
        write_assets(root, assets)
        path = root / "p.toml"
        path.write_text(PIPELINE.format(size=size, quality=quality))
        timed("warm", jobs=2, only=("00[01]",))  # compiles
        print(f"{assets} assets, load {os.getloadavg()[0]:.1f} before")
        row = table("workers", "s", "assets / s", "against one", "overhead")
        alone = None
        for jobs in (1, 2):
            seconds, result = timed(f"jobs{jobs}", jobs=jobs, threads=1)
            alone = alone or seconds
            work = sum(step.work_seconds or 0 for asset in result.assets for step in asset.steps)
            row(jobs, f"{seconds:.1f}", f"{assets / seconds:.2f}", f"{alone / seconds:.2f}",
                f"{1 - work / (jobs * seconds):.1%}")  # fmt: skip
        if dask:
            with cluster(2, root / "dask") as address:
                timed("warm2", scheduler=address, only=("00[0123]",))
                seconds, _ = timed("dask2", scheduler=address, threads=1)
            row(
                "2, Dask", f"{seconds:.1f}", f"{assets / seconds:.2f}", f"{alone / seconds:.2f}", ""
            )
        start = time.perf_counter()
        code = "from texbake_cli import run; run()"
        command = [sys.executable, "-P", "-c", code, "build", path, "-o", root / "jobs2", "-q"]
        subprocess.run(command, check=True)
        print(f"\nsecond run, nothing changed: {time.perf_counter() - start:.2f} s")


def write_assets(folder, n_assets):
    """Write a high-poly and a low-poly mesh for each asset."""
    for name in "low", "high":
        (folder / name).mkdir()
    for number in range(n_assets):
        share = number / max(n_assets - 1, 1)
        rows = round(((5_000 + share * 15_000) / 4) ** 0.5)
        low = texbake.make("sphere", texbake.MakeOptions(resolution=(2 * rows, rows)))
        low = low.replace(normals=None, normal_faces=None, uvs=None, uv_faces=None)
        stretch = np.array([1.0, 1.0 + share, 1.0])
        low = low.replace(positions=low.positions * stretch)
        texbake.write_mesh(low, folder / f"low/{number:03d}.obj")
        high = grid_sphere(
            3 * rows, 5 * rows,
            lambda theta, phi: 1.0 + 0.01 * np.sin(20 * theta) * np.sin(20 * phi),
        )  # fmt: skip
        turned = high.positions[:, [1, 2, 0]]  # the poles of grid_sphere are on z, of make on y
        high = high.replace(positions=turned * stretch)
        texbake.write_mesh(high, folder / f"high/{number:03d}.ply")


@contextmanager
def cluster(n_workers, folder):
    """A scheduler and its workers on the loopback address."""
    from distributed import Client

    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address = f"tcp://127.0.0.1:{port}"
    python = [sys.executable, "-P", "-m"]
    scheduler = [*python, "distributed.cli.dask_scheduler", "--no-dashboard", "--host", "127.0.0.1",
                 "--port", str(port)]  # fmt: skip
    worker = [
        *python, "distributed.cli.dask_worker", address, "--nthreads", "1", "--no-nanny",
        "--no-dashboard", "--local-directory", str(folder),
    ]  # fmt: skip
    with ExitStack() as stack:
        for command in [scheduler, *[worker] * n_workers]:
            process = subprocess.Popen(
                command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
            )
            stack.callback(process.wait)
            stack.callback(process.kill)
        with Client(address, timeout=60, set_as_default=False) as client:
            client.wait_for_workers(n_workers, timeout=60)
        yield address


if __name__ == "__main__":
    run_commands(globals(), readers, lighten, build)
