"""Throughput of a build: one worker against two, the overhead, and a second run.

    python tests/benchmarks/bench_build.py [--assets 200] [--size 512] [--dask]

Assets are different spheres of 5,000 to 20,000 triangles. Each is unwrapped, and a denser sphere
with relief is baked onto it. Every worker has one thread, so the comparison is of workers and not
of threads. A first build of two assets, which compiles, does not count. Overhead is the share of
the workers' time outside steps: starting, checksums, copies, waiting. Prints a table in Markdown.
"""

from __future__ import annotations

import argparse
import os
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from texbake.building.build import build
from texbake.building.options import BuildOptions
from texbake.building.report import BuildResult
from texbake.mesh.files import write_mesh
from texbake.mesh.parametric.make import make
from texbake.mesh.shapes import grid_sphere

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


def make_assets(folder: Path, n_assets: int) -> None:
    """Write a high-poly and a low-poly mesh for each asset."""
    import numpy as np

    for name in "low", "high":
        (folder / name).mkdir()
    for number in range(n_assets):
        share = number / max(n_assets - 1, 1)
        n_faces = 5_000 + share * 15_000
        rows = round((n_faces / 4) ** 0.5)
        low = make("sphere", resolution=(2 * rows, rows)).replace(
            normals=None, normal_faces=None, uvs=None, uv_faces=None
        )
        stretch = np.array([1.0, 1.0 + share, 1.0])
        write_mesh(low.replace(positions=low.positions * stretch), folder / f"low/{number:03d}.obj")
        high = grid_sphere(
            3 * rows,
            5 * rows,
            lambda theta, phi: 1.0 + 0.01 * np.sin(20 * theta) * np.sin(20 * phi),
        )
        turned = high.positions[:, [1, 2, 0]]  # the poles of grid_sphere are on z, of make on y
        write_mesh(high.replace(positions=turned * stretch), folder / f"high/{number:03d}.ply")


def timed(path: Path, folder: Path, **options: object) -> tuple[float, BuildResult]:
    """Seconds of a build, and its result."""
    start = time.perf_counter()
    result = build(path, BuildOptions(folder=folder, **options))  # type: ignore[arg-type]
    seconds = time.perf_counter() - start
    assert result.ok, result.failed[0].error
    return seconds, result


def second_run(path: Path, folder: Path) -> float:
    """Seconds of the command, from its start to its end, with nothing to do."""
    start = time.perf_counter()
    code = "from texbake_cli import run; run()"
    command = [sys.executable, "-P", "-c", code, "build", str(path), "-o", str(folder), "-q"]
    subprocess.run(command, check=True)
    return time.perf_counter() - start


@contextmanager
def cluster(n_workers: int, folder: Path) -> Iterator[str]:
    """A scheduler and its workers on the loopback address."""
    from distributed import Client

    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    dask = [sys.executable, "-P", "-m", "distributed.cli.dask_scheduler", "--no-dashboard"]
    worker = [
        sys.executable, "-P", "-m", "distributed.cli.dask_worker", address, "--nthreads", "1",
        "--no-nanny", "--no-dashboard", "--local-directory", str(folder),
    ]  # fmt: skip
    port = address.rpartition(":")[2]
    with ExitStack() as stack:
        commands = [[*dask, "--host", "127.0.0.1", "--port", port], *[worker] * n_workers]
        for command in commands:
            process = subprocess.Popen(command, **quiet)  # type: ignore[call-overload]
            stack.callback(process.wait)
            stack.callback(process.kill)
        with Client(address, timeout=60, set_as_default=False) as client:
            client.wait_for_workers(n_workers, timeout=60)
        yield address


def row(name: str, seconds: float, alone: float, result: BuildResult, slots: int) -> str:
    """Return a line of the table."""
    work = sum(step.work_seconds or 0.0 for asset in result.assets for step in asset.steps)
    n = len(result.assets)
    overhead = 1.0 - work / (slots * seconds)
    return (
        f"| {name} | {seconds:.1f} | {n / seconds:.2f} | {alone / seconds:.2f} | "
        f"{100 * overhead:.1f} % |"
    )


def main() -> None:
    """Run all builds and print them."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--assets", type=int, default=200)
    parser.add_argument("--size", type=int, default=512)
    parser.add_argument("--quality", default="good")
    parser.add_argument("--dask", action="store_true")
    arguments = parser.parse_args()
    root = Path(tempfile.mkdtemp(prefix="texbake-bench-"))
    try:
        make_assets(root, arguments.assets)
        path = root / "p.toml"
        path.write_text(PIPELINE.format(size=arguments.size, quality=arguments.quality))
        timed(path, root / "warm", jobs=2, only=("00[01]",))
        print(f"{arguments.assets} assets, load {os.getloadavg()[0]:.1f} before")
        print("| workers | s | assets / s | against one | overhead |\n|---|---|---|---|---|")
        alone, result = timed(path, root / "one", jobs=1, threads=1)
        print(row("1", alone, alone, result, 1), flush=True)
        seconds, result = timed(path, root / "two", jobs=2, threads=1)
        print(row("2", seconds, alone, result, 2), flush=True)
        if arguments.dask:
            with cluster(2, root / "dask") as address:
                timed(path, root / "warm2", scheduler=address, only=("00[0123]",))
                seconds, result = timed(path, root / "three", scheduler=address, threads=1)
            print(f"| 2, Dask | {seconds:.1f} | {arguments.assets / seconds:.2f} | "
                  f"{alone / seconds:.2f} | |")  # fmt: skip
        print(f"\nsecond run, nothing changed: {second_run(path, root / 'two'):.2f} s")
    finally:
        shutil.rmtree(root)


if __name__ == "__main__":
    main()
