"""`texbake watch` for an hour, with a save every second: does anything grow?

    python tests/hard_cases/soak_watch.py [--minutes 60] [--every 1.0] [--rows FILE.jsonl]

Each save gives an input that was never there before, so that every build makes new results: the
store must grow, by one set of results per save, until `texbake build --prune` cleans it. Everything
else must not: memory and descriptors of `watch` and its workers, their number, and the files in
TMPDIR. A line is fitted to the second half of each curve; its rise over that half must be below the
bound of the table. Linux only. Prints a table in Markdown, and exits with 1 if something grew.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import IO

PIPELINE = """
[[assets]]
inputs.high = "high.obj"

[steps.ball]
do = "make"
shape = "sphere"
resolution = [24, 16]

[steps.low]
do = "unwrap"
mesh = "ball"
method = "spherical"

[steps.maps]
do = "bake"
high = "high"
low = "low"
size = 32
output = "{asset}_{output}.{ext}"
"""
# The most that each may rise in the second half: memory in bytes, the others in numbers. The
# allocator of Python settles within a few megabytes; one leaked page per save is 7 MB in an hour.
BOUNDS = {
    "memory of watch": 4 << 20,
    "memory of the workers": 16 << 20,
    "descriptors of watch": 1,
    "descriptors of the workers": 2,
    "processes": 0.5,
    "threads of watch": 0.5,
    "files in TMPDIR": 2,
}
LONGEST_WAIT = (
    30  # seconds from one build to the next, in the mean; saves without a pause must be built
)
NOT_BOUNDED = ("files in the store", "size of the store", "size of digests.json")
MB = 1 << 20


def children(process: int) -> list[int]:
    """Return the processes that a process has started, and theirs."""
    found: list[int] = []
    for thread in Path(f"/proc/{process}/task").iterdir():
        for child in map(int, (thread / "children").read_text().split()):
            found += [child, *children(child)]
    return found


def memory(process: int) -> int:
    """Return the resident bytes of a process that are not in files."""
    for line in Path(f"/proc/{process}/status").read_text().splitlines():
        if line.startswith("RssAnon:"):
            return int(line.split()[1]) << 10
    return 0


def descriptors(process: int) -> int:
    """Return the number of open files of a process."""
    return len(os.listdir(f"/proc/{process}/fd"))  # noqa: PTH208


def sizes(folder: Path) -> dict[str, int]:
    """Return the sizes of the files below a folder; files of a moment may be gone before."""
    found = {}
    for path in folder.rglob("*"):
        with suppress(FileNotFoundError):
            if path.is_file():
                found[path.relative_to(folder).as_posix()] = path.stat().st_size
    return found


def measured(process: int, root: Path) -> dict[str, float]:
    """Return all figures of now."""
    workers = children(process)
    stored = sizes(root / "build/.texbake/store")
    digests = sizes(root / "build/.texbake").get("digests.json", 0)
    return {
        "memory of watch": memory(process),
        "memory of the workers": sum(map(memory, workers)),
        "descriptors of watch": descriptors(process),
        "descriptors of the workers": sum(map(descriptors, workers)),
        "processes": 1 + len(workers),
        "threads of watch": len(list(Path(f"/proc/{process}/task").iterdir())),
        "files in TMPDIR": len(list((root / "tmp").rglob("*"))),
        "files in the store": len(stored),
        "size of the store": sum(stored.values()),
        "size of digests.json": digests,
    }


def slope(times: list[float], values: list[float]) -> float:
    """Return the rise of a fitted line over all the times."""
    n = len(times)
    middle, mean = sum(times) / n, sum(values) / n
    spread = sum((t - middle) ** 2 for t in times)
    rise = sum((t - middle) * (v - mean) for t, v in zip(times, values, strict=True))
    return rise / spread * (times[-1] - times[0]) if spread else 0.0


def save(path: Path, number: int, text: str) -> None:
    """Save the mesh at another size, as a modeling program does: beside its place, then renamed."""
    lines = [
        f"v {' '.join(str(float(x) * (1 + number / 100_000)) for x in line.split()[1:4])}"
        if line.startswith("v ") else line
        for line in text.splitlines()
    ]  # fmt: skip
    temporary = path.with_name(".saving")
    temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")
    temporary.replace(path)


def saved_and_measured(
    watch: subprocess.Popen[str], root: Path, minutes: float, every: float, rows: IO[str] | None
) -> tuple[list[float], list[dict[str, float]], int]:
    """Save until the time is over; return the times and figures, and the number of saves."""
    high = root / "high.obj"
    text = high.read_text()
    times: list[float] = []
    found: list[dict[str, float]] = []
    start = time.monotonic()
    n_saves = 0
    while (now := time.monotonic() - start) < 60 * minutes:
        if watch.poll() is not None:
            raise SystemExit(f"watch ended with {watch.returncode}")
        n_saves += 1
        save(high, n_saves, text)
        if now - (times[-1] if times else -60.0) >= max(5.0, minutes / 2):
            figures = measured(watch.pid, root)
            times.append(now)
            found.append(figures)
            if rows is not None:
                rows.write(json.dumps({"seconds": round(now), **figures}) + "\n")
                rows.flush()
        time.sleep(max(0.0, start + n_saves * every - time.monotonic()))
    return times, found, n_saves


def report(times: list[float], found: list[dict[str, float]]) -> list[str]:
    """Print the table; return what grew."""
    half = len(times) // 2
    grew = []
    print("| | after a minute | in the middle | at the end | rise in the second half | at most |")
    print("|---|---|---|---|---|---|")
    first = next((i for i, t in enumerate(times) if t >= 60.0), 0)
    for name in (*BOUNDS, *NOT_BOUNDED):
        values = [row[name] for row in found]
        rise = slope(times[half:], values[half:])
        bound = BOUNDS.get(name)
        if bound is not None and rise > bound:
            grew.append(name)
        unit, digits = (MB, 1) if name.startswith(("memory", "size")) else (1, 0)
        suffix = " MB" if unit == MB else ""
        cells = [f"{value / unit:,.{digits}f}{suffix}"
                 for value in (values[first], values[half], values[-1])]  # fmt: skip
        cells.append(f"{rise / unit:,.{digits + 1}f}{suffix}")
        cells.append("" if bound is None else f"{bound / unit:g}{suffix}")
        print(f"| {name} | {' | '.join(cells)} |")
    return grew


def main() -> int:
    """Run the watch, save, measure and report."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--every", type=float, default=1.0, help="seconds between saves")
    parser.add_argument("--rows", type=Path, help="file for all figures, one JSON object per line")
    arguments = parser.parse_args()
    root = Path(tempfile.mkdtemp(prefix="texbake-soak-"))
    (root / "tmp").mkdir()
    (root / "soak.toml").write_text(PIPELINE)
    code = "from texbake_cli.main import main; main()"
    run = [sys.executable, "-P", "-c", code]
    make = ["make", "sphere", "-o", str(root / "high.obj"), "--resolution", "48x32"]
    subprocess.run([*run, *make], check=True, stdout=subprocess.DEVNULL)
    rows = arguments.rows.open("w") if arguments.rows else None
    watch = subprocess.Popen(
        [*run, "watch", str(root / "soak.toml")],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env={**os.environ, "TMPDIR": str(root / "tmp")},
    )
    counts = {"watching ...": 0, "other": 0}
    odd: list[str] = []

    def count() -> None:
        assert watch.stdout is not None
        for line in watch.stdout:
            said = line.strip()
            counts["watching ..."] += said == "watching ..."
            if said and not said.startswith(("watching", "assets", "steps", "time", "wrote")):
                counts["other"] += 1
                odd[10:] = [said]

    reader = threading.Thread(target=count, daemon=True)
    reader.start()
    try:
        times, found, n_saves = saved_and_measured(
            watch, root, arguments.minutes, arguments.every, rows
        )
        workers = children(watch.pid)
        watch.send_signal(signal.SIGTERM)  # in the background, SIGINT is ignored
        code_of_end = watch.wait(20)
        reader.join(5)
        grew = report(times, found)
        left = [path.name for path in (root / "tmp").rglob("*")]
        orphans = [worker for worker in workers if Path(f"/proc/{worker}").exists()]
        print(f"\n{n_saves:,} saves, {counts['watching ...']:,} builds, exit code {code_of_end}")
        print(f"left in TMPDIR: {left or 'nothing'}; workers left: {orphans or 'none'}")
        print(f"other lines: {counts['other']}: {odd}")
        print("grew: " + (", ".join(grew) or "nothing"))
        starved = counts["watching ..."] * LONGEST_WAIT < 60 * arguments.minutes
        if starved:
            print(f"fewer builds than one in {LONGEST_WAIT} s")
        return 1 if grew or left or orphans or starved else 0
    finally:
        watch.kill()
        watch.wait()
        shutil.rmtree(root, ignore_errors=True)


if __name__ == "__main__":
    sys.exit(main())
