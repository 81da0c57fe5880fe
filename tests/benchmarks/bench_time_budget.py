"""How well bakes and pictures keep to `--time-budget`, and what they make of the time.

    python tests/benchmarks/bench_time_budget.py [bake | preview ...] [--sizes PX ...]
        [--times FACTOR ...] [--busy] [--errors]

Every run is a process of its own. The budgets are multiples of the least time, that of a run with a
budget of a hundredth of a second. Prints a table in Markdown with a row for each run, and below it
how many of the runs that did not reach the closest bound ended between 85 % and 100 % of their
budget, by the clock that the budget is counted on. A star marks those that did. The time of the
whole process stands next to it.

On a machine that others use as well, `--busy` counts budgets and times in processor seconds of one
thread.

With `--errors`, bakes are compared with fixed numbers of rays: the error is the root mean square of
the angle to 64 rays per texel; next to it stands that of the best fixed number (1, 4 or 16) that
took no longer, and the quotient.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import texbake
from texbake.jobs.maps import bake_files
from texbake.jobs.preview import preview_files
from texbake.sampling.time_budget import BudgetClock
from texbake.texture.encoding import decode_normals

DATA = Path(os.environ.get("TEXBAKE_DATA", Path(__file__).parents[3] / "shared" / "data"))
SCENES = Path(__file__).parents[2] / "samples" / "scenes"
PAIRS = ("koala", "skull", "spot", "penguin")
PICTURES = ("orange_bump", "shadow_spot", "reflection", "transparency", "normal_map", "checker")
SIZES = {"bake": (512, 1024, 2048), "preview": (640, 1280)}
FACTORS = (1.3, 2.0, 4.0)
FIXED = (1, 4, 16)
TRUTH = 64
LEAST = 0.01  # seconds: too short for anything


def run(kind, name, size, folder, **options):
    """Run one bake or picture in a process; return its seconds, its report and its file."""
    output, report = folder / "out.png", folder / "report.json"
    line = [
        sys.executable,
        __file__,
        "--run",
        kind,
        name,
        size,
        output,
        report,
        json.dumps(options),
    ]
    start = time.perf_counter()
    done = subprocess.run(list(map(str, line)), check=True, capture_output=True, text=True)
    seconds = time.perf_counter() - start
    seconds = float(done.stdout) if options.get("busy") else seconds
    return seconds, json.loads(report.read_text()), output


def run_here(kind, name, size, output, report, options):
    """Do what `run` asks for, in this process; print its processor seconds."""
    options, size = json.loads(options), int(size)
    same = {"report": report, "clock": BudgetClock.of_process()}
    threads = None
    if options.pop("busy", False):
        same["clock"], threads = BudgetClock(start=0.0, now=time.process_time), 1
    if kind == "bake":
        meshes = [DATA / "pairs" / name / file for file in ("high.obj", "low_uv.obj")]
        # Without padding, texels that are not covered are flat.
        options = texbake.BakeOptions(size=size, threads=threads, padding=0, **options)
        done = bake_files(*meshes, {"normal": output}, options, clock=same["clock"])
        Path(report).write_text(json.dumps(done.to_json()))
    else:
        options |= {"width": size, "height": size * 5 // 8}
        preview_files(SCENES / f"{name}.toml", output, options, threads=threads, **same)
    print(time.process_time())


def normals_of(path):
    """Unit normals of a map."""
    return decode_normals(texbake.read_image(path, color=False).pixels)


def angle_to(truth, path):
    """Root mean square of the angle to other normals, over the texels that both cover."""
    normals = normals_of(path)
    shown = (np.abs(truth - [0, 0, 1]) > 1e-4).any(axis=2)
    shown &= (np.abs(normals - [0, 0, 1]) > 1e-4).any(axis=2)
    chords = np.linalg.norm(normals - truth, axis=2)[shown]
    return float(np.degrees(np.sqrt((np.square(2 * np.arcsin(np.minimum(chords / 2, 1)))).mean())))


def fixed_errors(name, size, folder, busy):
    """Normals of the most rays; seconds, number and error of each fixed number of rays."""
    truth = normals_of(run("bake", name, size, folder, samples=TRUTH)[2])
    rows = []
    for n in FIXED:
        seconds, _, path = run("bake", name, size, folder, samples=n, busy=busy)
        rows.append((seconds, n, angle_to(truth, path)))
    return truth, rows


def best_fixed(rows, seconds):
    """Number of rays and error of the best fixed setting that took at most so many seconds."""
    fitting = [row for row in rows if row[0] <= seconds]
    return min(fitting, key=lambda row: row[2])[1:] if fitting else None


def measure(kind, name, size, arguments, folder):
    """Print one row for each budget; return the shares of the budgets that were spent."""
    busy = arguments.busy
    least = run(kind, name, size, folder, time_budget=LEAST, busy=busy)[0]
    truth, rows = None, []
    if arguments.errors and kind == "bake":
        truth, rows = fixed_errors(name, size, folder, busy)
    shares = []
    for factor in arguments.times:
        budget = round(factor * least, 2)
        seconds, report, path = run(kind, name, size, folder, time_budget=budget, busy=busy)
        figures = report["budget"]
        share = figures["actual_seconds"] / budget
        is_ample = figures["why"] == "the closest bound that is wanted"
        shares += [] if is_ample else [share]
        cells = [name, size, f"{budget:.2f}", f"{100 * share:.0f} %{' *' if is_ample else ''}",
                 f"{100 * seconds / budget:.0f} %", figures["max_error"],
                 len(figures["rounds"])]  # fmt: skip
        if truth is not None:
            error, best = angle_to(truth, path), best_fixed(rows, seconds)
            cells.append(f"{error:.4f}°")
            cells += ["", ""] if best is None else [
                f"{best[1]:.4f}° ({best[0]})", f"{error / best[1]:.2f}"
            ]  # fmt: skip
        print("| " + " | ".join(map(str, cells)) + " |", flush=True)
    return shares


def print_shares(shares):
    """Print how many runs ended between 85 % and 100 % of their budget."""
    spent = np.array(shares)
    within = int(np.count_nonzero((spent >= 0.85) & (spent <= 1.0)))
    figures = ", ".join(f"{100 * share:.0f} %" for share in np.percentile(spent, [0, 50, 100]))
    print(
        f"\n{within} of {len(spent)} between 85 % and 100 %, {np.count_nonzero(spent > 1.0)} "
        f"above; least, median, greatest {figures}; load at the end {os.getloadavg()[0]:.1f}"
    )


def main():
    if sys.argv[1:2] == ["--run"]:
        run_here(*sys.argv[2:])
        return
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("kinds", nargs="*", default=["bake", "preview"])
    parser.add_argument("--sizes", type=int, nargs="+")
    parser.add_argument("--times", type=float, nargs="+", default=FACTORS)
    parser.add_argument("--busy", action="store_true")
    parser.add_argument("--errors", action="store_true")
    arguments = parser.parse_args()
    for kind in arguments.kinds:
        heads = ["name", "size", "budget, s", "spent", "whole process", "bound", "rounds"]
        heads += ["error", "fixed", "quotient"] if arguments.errors and kind == "bake" else []
        print(f"\n{kind}, load {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors\n")
        print(f"| {' | '.join(heads)} |\n{'|---' * len(heads)}|")
        shares = []
        with tempfile.TemporaryDirectory() as folder:
            for name in PAIRS if kind == "bake" else PICTURES:
                for size in arguments.sizes or SIZES[kind]:
                    shares += measure(kind, name, size, arguments, Path(folder))
        print_shares(shares)


if __name__ == "__main__":
    main()
