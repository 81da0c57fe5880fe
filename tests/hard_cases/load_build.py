"""`texbake build` of very many assets, and of very large ones: what does it take, and does it fit?

    python tests/hard_cases/load_build.py many [--assets 1000 3000 10000] [--folder DIR]
    python tests/hard_cases/load_build.py large [--triangles 16000000] [--memory 4G] [--folder DIR]

`many` builds that many tiny assets, then builds again in all the ways that should take no work, and
once with one changed input. The processor time and memory of the process that schedules must grow
with the number of assets, and not with its square.

`large` builds three assets whose high-poly meshes have that many triangles, in a group of processes
to which the system gives that much memory (a control group if one can be made, else a limit on the
address space of each process). The last step, an unwrap of a high-poly mesh, cannot fit. Each step
must finish, or fail with one line that says what does not fit.

Prints tables in Markdown, and exits with 1 if something grew too fast, or ended without such a
line. Linux only.
"""

from __future__ import annotations

import argparse
import json
import os
import pty
import resource
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from itertools import pairwise
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[2]))  # for the tests

from texbake.baking.memory import parse_bytes

# Runs the command line, and writes what the process and its children took.
DRIVER = """
import atexit, json, os, sys
from pathlib import Path
def figures(file=sys.argv.pop(1)):
    times, status = os.times(), Path("/proc/self/status").read_text()
    Path(file).write_text(json.dumps({
        "scheduler": times.user + times.system,
        "workers": times.children_user + times.children_system,
        "memory": int(status.split("VmHWM:")[1].split()[0]) << 10,
    }))
atexit.register(figures)
from texbake_cli.main import main
main()
"""
MANY = """
[[assets]]
inputs.high = "meshes/*.obj"

[steps.low]
do = "unwrap"
mesh = "high"
method = "box"

[steps.maps]
do = "bake"
high = "high"
low = "low"
size = 16
padding = 1
front = 0.1
back = 0.1
output = "{asset}_{output}.{ext}"
"""
LARGE = """
[[assets]]
inputs.high = "?.ply"

[steps.coarse]
do = "simplify"
mesh = "high"
faces = 2000

[steps.low]
do = "unwrap"
mesh = "coarse"

[steps.maps]
do = "bake"
high = "high"
low = "low"
maps = ["normal", "displacement"]
size = 2048
output = "{asset}_{output}.{ext}"

[steps.picture]
do = "preview"
mesh = "low"
normal_map = "maps.normal"
output = "{asset}.{ext}"

[steps.unwrapped]
do = "unwrap"
mesh = "high"
after = "picture"
output = "{asset}_whole.{ext}"
"""
# What is run after the first build; none of it may take a step but the one whose input changes.
AGAIN: dict[str, tuple[str, ...]] = {
    "again, nothing changed": (),
    "on a terminal": (),
    "--progress json": ("--progress", "json"),
    "--plan": ("--plan",),
    "--verify": ("--verify",),
    "one input changed": (),
    "--prune --html": ("--prune", "--html", "overview.html"),
}
GROWTH = 2.0  # of what each further asset takes, from the smallest builds to the largest ones
MB = 1 << 20


def run(
    words: list[str],
    folder: Path,
    *,
    terminal: bool = False,
    before: Callable[[], None] | None = None,
) -> dict[str, Any]:
    """Run a command in a folder; return its exit code, its output, its times and memory."""
    figures = folder / ".figures.json"
    figures.unlink(missing_ok=True)
    leader, follower = pty.openpty() if terminal else (-1, -1)
    drain = threading.Thread(target=_read_all, args=(leader,), daemon=True)
    drain.start()
    start = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-P", "-c", DRIVER, str(figures), *words],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=follower if terminal else subprocess.PIPE,
        preexec_fn=before,
        check=False,
    )
    seconds = time.perf_counter() - start
    for end in (follower, leader) if terminal else ():
        os.close(end)
    said = (done.stderr or b"").decode()
    kept = json.loads(figures.read_text()) if figures.exists() else {}
    return {"code": done.returncode, "seconds": seconds, "stderr": said, **kept}


def _read_all(descriptor: int) -> None:
    with suppress(OSError):
        while descriptor >= 0 and os.read(descriptor, 1 << 16):
            pass


def write_small_mesh(path: Path, number: float) -> None:
    """Write a box without a lid, with a tip: six triangles, different for each number."""
    tip = f"v 0.5 {0.3 + number:.6f} {0.5 + number / 2:.6f}\n"
    base = "".join(f"v {x} 0 {z * (1 + number):.6f}\n" for x, z in ((0, 0), (1, 0), (1, 1), (0, 1)))
    faces = ((1, 2, 5), (2, 3, 5), (3, 4, 5), (4, 1, 5), (4, 3, 2), (4, 2, 1))
    path.write_text(base + tip + "".join("f {} {} {}\n".format(*face) for face in faces))


def build_many(n_assets: int, folder: Path, more: list[str]) -> dict[str, dict[str, Any]]:
    """Build that many assets in a new folder; return the figures of each build by its name."""
    (folder / "meshes").mkdir(parents=True)
    for number in range(n_assets):
        write_small_mesh(folder / f"meshes/a{number:06}.obj", number / n_assets)
    (folder / "many.toml").write_text(MANY)
    found = {}
    for name, words in {"first build": (), **AGAIN}.items():
        if name == "one input changed":
            write_small_mesh(folder / "meshes/a000000.obj", 2.0)
        found[name] = run(
            ["build", "many.toml", *more, *words], folder, terminal=name == "on a terminal"
        )
        if found[name]["code"]:
            raise SystemExit(f"{name}: exit code {found[name]['code']}: {found[name]['stderr']}")
        if "--plan" in words:
            print_row(name, n_assets, found[name])
            continue
        report = json.loads((folder / "build/build.json").read_text())
        steps = [step for asset in report["assets"] for step in asset["steps"]]
        found[name]["built"] = sum(step["state"] == "built" for step in steps)
        found[name]["peak"] = max(step.get("peak_memory_bytes", 0) for step in steps)
        expected = {"first build": 2 * n_assets, "one input changed": 2}.get(name, 0)
        if (n_built := found[name]["built"]) != expected:
            raise SystemExit(f"{name}: {n_built:,} steps were run instead of {expected:,}")
        print_row(name, n_assets, found[name])
    return found


def many(sizes: list[int], root: Path, more: list[str]) -> list[str]:
    """Build all sizes, print the table; return what grew too fast."""
    results = {}
    print("| build | assets | elapsed | processor: scheduler | processor: workers | cores busy "
          "| memory: scheduler | memory: largest worker |")  # fmt: skip
    print("|---|---|---|---|---|---|---|---|")
    for n_assets in sizes:
        folder = root / str(n_assets)
        results[n_assets] = build_many(n_assets, folder, more)
        shutil.rmtree(folder)
    grew = []
    for name in ("first build", *AGAIN):
        for figure in ("scheduler", "memory"):
            # What each further asset takes; what a process takes without any does not count.
            rises = [
                (results[more][name][figure] - results[few][name][figure]) / (more - few)
                for few, more in pairwise(sorted(sizes))
            ]
            if len(rises) > 1 and rises[-1] > GROWTH * rises[0]:
                grew.append(f"{name}: {figure}")
    return grew


def print_row(name: str, n_assets: int, row: dict[str, Any]) -> None:
    """Print the figures of a build."""
    cells = [
        name,
        f"{n_assets:,}",
        f"{row['seconds']:.1f} s",
        f"{row['scheduler']:.1f} s",
        f"{row['workers']:.1f} s",
        f"{(row['scheduler'] + row['workers']) / row['seconds']:.1f}",
        f"{row['memory'] / MB:.0f} MB",
        f"{row['peak'] / MB:.0f} MB" if row.get("built") else "",
    ]
    print(f"| {' | '.join(cells)} |", flush=True)


def memory_group(limit: int) -> Path | None:
    """Make a control group with that much memory below that of this process; None without."""
    with suppress(OSError):
        for line in Path("/proc/self/cgroup").read_text().splitlines():
            _, controllers, path = line.split(":", 2)
            if controllers not in ("", "memory"):
                continue
            top = Path("/sys/fs/cgroup") / controllers / path.strip("/")
            group = top / f"texbake-load-{os.getpid()}"
            with suppress(OSError):
                group.mkdir()
                file = "memory.limit_in_bytes" if controllers else "memory.max"
                (group / file).write_text(str(limit))
                return group
    return None


def peak_of(group: Path | None) -> str:
    """Return the greatest memory of a control group, and how many processes were killed in it."""
    if group is None:
        return "address space limited"
    for file in ("memory.max_usage_in_bytes", "memory.peak"):
        with suppress(OSError):
            peak = int((group / file).read_text())
            break
    said = [
        (group / file).read_text()
        for file in ("memory.oom_control", "memory.events")
        if (group / file).exists()
    ]
    n_killed = [line.split()[1] for line in said[0].splitlines() if line.startswith("oom_kill ")]
    return f"peak of the group {peak / MB:,.0f} MB, killed by the system: {' '.join(n_killed)}"


def large(n_triangles: int, limit: str, root: Path) -> list[str]:
    """Build three large assets within a limit, print a table; return what has no good line."""
    from tests.benchmarks.bench_stream import write_sphere

    for number, name in enumerate("abc"):
        write_sphere(root / f"{name}.ply", n_triangles + 100_000 * number)
    (root / "large.toml").write_text(LARGE)
    n_bytes = parse_bytes(limit)
    group = memory_group(n_bytes)

    def join() -> None:
        if group is not None:
            (group / "cgroup.procs").write_text(str(os.getpid()))
        else:
            resource.setrlimit(resource.RLIMIT_AS, (n_bytes, n_bytes))

    done = run(["build", "large.toml", "--quiet"], root, before=join)
    report = json.loads((root / "build/build.json").read_text())
    print("| asset | step | state | elapsed | peak memory of its worker | error |")
    print("|---|---|---|---|---|---|")
    faults = [] if done["code"] in (0, 1) else [f"exit code {done['code']}: {done['stderr']}"]
    for asset in report["assets"]:
        for step in asset["steps"]:
            peak, error = step.get("peak_memory_bytes"), step.get("error", "")
            shown = f"{peak / MB:,.0f} MB" if peak else ""
            print(f"| {asset['name']} | {step['step']} | {step['state']} | {step['seconds']:.0f} s "
                  f"| {shown} | {error} |")  # fmt: skip
            if error and "it is estimated to take" not in error and step["state"] == "failed":
                faults.append(f"{asset['name']} {step['step']}: {error}")
    processor = done["scheduler"] + done["workers"]
    print(f"\n{limit}: {done['seconds']:.0f} s, processor {processor:.0f} s, "
          f"scheduler {done['memory'] / MB:.0f} MB, {peak_of(group)}")  # fmt: skip
    print(done["stderr"])
    if group is not None:
        group.rmdir()
    return faults


def main() -> int:
    """Run what is asked for."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--folder", type=Path, help="for all files; a temporary one by default")
    kinds = parser.add_subparsers(dest="kind", required=True)
    number = kinds.add_parser("many")
    number.add_argument("--assets", type=int, nargs="+", default=[1000, 3000, 10_000])
    number.add_argument("--jobs", help="as for texbake build")
    size = kinds.add_parser("large")
    size.add_argument("--triangles", type=int, default=16_000_000)
    size.add_argument("--memory", default="4G")
    arguments = parser.parse_args()
    root = Path(tempfile.mkdtemp(prefix="texbake-load-", dir=arguments.folder))
    try:
        if arguments.kind == "large":
            faults = large(arguments.triangles, arguments.memory, root)
            print("\nwithout a line on memory: " + ("; ".join(faults) or "none"))
        else:
            more = ["--jobs", arguments.jobs] if arguments.jobs else []
            faults = many(arguments.assets, root, more)
            print("\ngrew faster than the number of assets: " + ("; ".join(faults) or "nothing"))
        return 1 if faults else 0
    finally:
        shutil.rmtree(root, ignore_errors=True)


if __name__ == "__main__":
    sys.exit(main())
