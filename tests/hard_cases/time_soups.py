"""Every command that takes a mesh, on soups of a million triangles: how long, and how it ends.

    python tests/hard_cases/time_soups.py                            # the table
    python tests/hard_cases/time_soups.py --soups stack loose --commands simplify "unwrap atlas"
    python tests/hard_cases/time_soups.py --signals 3                # SIGTERM, at random moments

`soup_shapes.py` describes the soups. Prints a row per run: seconds of processor and by the clock,
peak memory, exit code and the last line. With --signals, each command is run that many times more,
and gets SIGTERM at a random moment of the time that it took; the row says how long the slowest
process lived on. Exits with 1 if a command took longer than --limit (by the clock and in processor
time, so that other work on the machine does not count), died of a signal or a traceback, or lived
longer than a second. Linux and macOS.
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

from soup_shapes import SOUPS, with_stacked_uvs, with_uvs

from texbake import write_mesh
from texbake.mesh.shapes import uv_sphere

PROGRAM = "from texbake_cli.main import main; main()"
# SOUP has no texture coordinates, MAPPED a cell for each triangle, and PILED one place for all.
# BALL is a sphere around the soup, with texture coordinates. ROOM is a scene of MAPPED with static
# lights, and PIPELINE bakes SOUP. What a command needs beside these is made by one before a ";".
COMMANDS = {
    "info": "info SOUP",
    "info --uv": "info MAPPED --uv",
    "info --uv piled": "info PILED --uv",
    "check": "check SOUP",
    "check mapped": "check MAPPED",
    "check piled": "check PILED",
    "check as high": "check SOUP BALL",
    "check as low": "check BALL MAPPED",
    "convert obj": "convert MAPPED OUT/a.obj",
    "convert glb": "convert MAPPED OUT/a.glb",
    "repair": "repair SOUP -o OUT/a.ply",
    "transform": "transform SOUP -o OUT/a.ply --rotate 10,20,30",
    "remesh": "remesh SOUP -o OUT/a.ply",
    "remesh interior": "remesh SOUP -o OUT/a.ply --keep-interior --sharp-edges --faces 5000",
    "simplify": "simplify SOUP -o OUT/a.ply --faces 1000",
    "simplify best": "simplify SOUP -o OUT/a.ply --faces 1000 --quality best",
    "simplify error": "simplify SOUP -o OUT/a.ply --error 1%",
    "simplify mapped": "simplify MAPPED -o OUT/a.ply --faces 1000",
    "unwrap atlas": "unwrap SOUP -o OUT/a.ply",
    "unwrap fast": "unwrap SOUP -o OUT/a.ply --quality fast",
    "unwrap best": "unwrap SOUP -o OUT/a.ply --quality best",
    "unwrap keep": "unwrap MAPPED -o OUT/a.ply --keep",
    "unwrap keep piled": "unwrap PILED -o OUT/a.ply --keep",
    "unwrap stretch": "unwrap SOUP -o OUT/a.ply --max-stretch 1.1 --seam-angle 30",
    "unwrap xatlas": "unwrap SOUP -o OUT/a.ply --charts xatlas --timeout 10",
    "unwrap planar": "unwrap SOUP -o OUT/a.ply --method planar --fit pca",
    "unwrap cylindrical": "unwrap SOUP -o OUT/a.ply --method cylindrical --caps",
    "unwrap spherical": "unwrap SOUP -o OUT/a.ply --method spherical",
    "unwrap box": "unwrap SOUP -o OUT/a.ply --method box",
    "unwrap two-part": "unwrap SOUP -o OUT/a.ply --method two-part --via reflection --eye 3,4,5",
    "unwrap projector": "unwrap SOUP -o OUT/a.ply --method projector",
    "unwrap pictures": "unwrap SOUP -o OUT/a.ply --method box --layout OUT/l.svg --heat"
    " --checker OUT/c.png",
    "cage as high": "cage SOUP BALL -o OUT/a.ply",
    "cage as low": "cage BALL MAPPED -o OUT/a.ply",
    "bake as high": "bake SOUP BALL -o OUT --maps normal,displacement,curvature",
    "bake as low": "bake BALL MAPPED -o OUT --maps normal,displacement --orientation keep",
    "bake piled": "bake BALL PILED -o OUT",
    "bake rays": "bake SOUP BALL -o OUT --maps ao,thickness --size 512 --secondary-rays 16",
    "bake closest": "bake SOUP BALL -o OUT --on-miss closest --hit-back-faces --size 512",
    "bake budget": "bake-normals SOUP BALL -o OUT/n.png --time-budget 5 --size 512",
    "bake-lightmap": "bake-lightmap ROOM -o OUT --size 512",
    "remap": "bake SOUP BALL -o OUT --hits HITS ; remap HITS -o OUT --maps normal,displacement",
    "bake-normals": "bake-normals SOUP BALL -o OUT/n.png --samples adaptive --size 512",
    "bake-texture": "bake-texture MAPPED -o OUT/t.png --procedure marble",
    "preview": "preview SOUP -o OUT/p.png",
    "preview back": "preview SOUP -o OUT/p.png --back-faces show --supersampling 1",
    "compare as high": "compare SOUP BALL -o OUT/c.png",
    "compare as low": "compare BALL MAPPED -o OUT/c.png",
    "export": "export MAPPED --to unreal -o OUT/e",
    "export compressed": "export MAPPED --to threejs --compress -o OUT/e",
    "run": "run SOUP -o OUT/r --faces 500 --size 512",
    "build": "build PIPELINE -o OUT",
    "study": "study SOUP BALL -o OUT --quick --knob map-kind --repeats 1",
    "bench": "bench SOUP BALL -o OUT --task preview --program texbake --size 512 --repeats 1",
    "lighten": "lighten MODEL -o OUT/l.glb --faces 5000 --size 512",
}


@dataclass(frozen=True, kw_only=True)
class Run:
    """How a process ended."""

    processor: float
    clock: float
    lived_on: float  # seconds after the signal
    memory: int
    code: int
    last: str
    late: bool


def run_command(words: list[str], out: Path, limit: float, end_after: float | None = None) -> Run:
    """Run texbake until it ends, or gets SIGTERM after `end_after` seconds."""
    out.mkdir(parents=True)
    with tempfile.TemporaryFile() as output:
        start = time.perf_counter()
        process = subprocess.Popen(
            [sys.executable, "-P", "-c", PROGRAM, *words],
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=output,
            cwd=out,
            start_new_session=True,
        )
        late, told = threading.Event(), [0.0]

        def kill() -> None:
            late.set()
            os.killpg(process.pid, signal.SIGKILL)

        def terminate() -> None:
            told[0] = time.perf_counter()
            process.terminate()

        timers = [threading.Timer(limit, kill)]
        if end_after is not None:
            timers.append(threading.Timer(end_after, terminate))
        for timer in timers:
            timer.start()
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        end = time.perf_counter()
        for timer in timers:
            timer.cancel()
        output.seek(0)
        lines = output.read().decode(errors="replace").split("\n")
    subprocess.run(["rm", "-rf", str(out)], check=True)
    return Run(
        processor=usage.ru_utime + usage.ru_stime,
        clock=end - start,
        lived_on=end - told[0] if told[0] else 0.0,
        memory=usage.ru_maxrss << (0 if sys.platform == "darwin" else 10),
        code=process.returncode,
        last=next((line.strip() for line in reversed(lines) if line.strip()), ""),
        late=late.is_set(),
    )


FILES = {
    "SOUP": "soup.ply",
    "MAPPED": "mapped.ply",
    "PILED": "piled.ply",
    "MODEL": "model.glb",
    "BALL": "ball.ply",
    "ROOM": "room.toml",
    "PIPELINE": "pipeline.toml",
    "HITS": "hits.npz",
    "OUT": "out",
}
ROOM = """
[[lights]]
kind = "directional"
direction = [0.2, 0.1, -1.0]

[[objects]]
name = "soup"
mesh = "mapped.ply"
material = { shading = "lambert" }
"""
PIPELINE = """
[[assets]]
name = "soup"

[steps.maps]
do = "bake"
high = "soup.ply"
low = "ball.ply"
output = "{asset}_{output}.{ext}"
"""


def write_soup(name: str, n: int, folder: Path) -> None:
    """Write the files of a soup."""
    soup = SOUPS[name](n)
    ball = uv_sphere(32, 64)
    low, high = soup.bounds
    size = float((high - low).max()) or 1.0
    ball = ball.replace(positions=ball.positions * 0.6 * size + 0.5 * (low + high))
    mapped = with_uvs(soup)
    meshes = {"SOUP": soup, "MAPPED": mapped, "PILED": with_stacked_uvs(soup), "MODEL": mapped}
    for word, mesh in (meshes | {"BALL": ball}).items():
        write_mesh(mesh, folder / FILES[word])
    (folder / FILES["ROOM"]).write_text(ROOM, encoding="utf-8")
    (folder / FILES["PIPELINE"]).write_text(PIPELINE, encoding="utf-8")


def rows(arguments: argparse.Namespace, folder: Path) -> Iterator[bool]:
    """Run, print and judge each command on each soup."""
    random.seed(arguments.seed)
    for soup in arguments.soups:
        # In a process of its own: a child inherits the mark of its parent's greatest memory.
        writer = get_context("spawn").Process(
            target=write_soup, args=(soup, arguments.triangles, folder)
        )
        writer.start()
        writer.join()
        for name in arguments.commands:
            line = COMMANDS[name]
            for word, file in FILES.items():
                line = line.replace(word, str(folder / file))
            *before, line = line.split(" ; ")
            (folder / FILES["HITS"]).unlink(missing_ok=True)  # of another soup
            prepared = [
                run_command(made_before.split(), folder / "out", arguments.patience)
                for made_before in before
            ]
            run = run_command(line.split(), folder / "out", arguments.patience)
            good = run.code in (0, 1, 2) and not run.last.startswith("Traceback")
            good &= min(run.clock, run.processor) <= arguments.limit
            good &= all(each.code == 0 and not each.late for each in prepared)
            ends = [
                run_command(
                    line.split(), folder / "out", arguments.patience, random.uniform(0.0, run.clock)
                )
                for _ in range(arguments.signals)
            ]
            lived = max((end.lived_on for end in ends), default=0.0)
            good &= lived <= 1.0
            print(
                f"{'  ' if good else '! '}{soup:9} {name:20} {run.processor:7.1f} {run.clock:7.1f}"
                f" {run.memory / 1e6:6.0f} {'late' if run.late else run.code:>4}"
                + (f" {lived:5.2f}" if ends else "")
                + f"  {run.last[:100]}",
                flush=True,
            )
            yield good


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--triangles", type=int, default=1_000_000)
    parser.add_argument("--soups", nargs="+", choices=SOUPS, default=[*SOUPS])
    parser.add_argument("--commands", nargs="+", choices=COMMANDS, default=[*COMMANDS])
    parser.add_argument("--limit", type=float, default=30.0, help="seconds that are allowed")
    parser.add_argument("--patience", type=float, default=120.0, help="seconds until it is killed")
    parser.add_argument("--signals", type=int, default=0, help="runs that get SIGTERM")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    head = f"  {'soup':9} {'command':20} {'proc. s':>7} {'clock s':>7} {'MB':>6} exit"
    print(head + (" lived" if arguments.signals else "") + "  last line")
    with tempfile.TemporaryDirectory(prefix="soups-") as name:
        found = list(rows(arguments, Path(name)))
    print(f"{found.count(False)} of {len(found)} are not as they should be")
    sys.exit(not all(found))


if __name__ == "__main__":
    main()
