"""The programs of the bench: what each can do, over which settings, and by which command.

texbake runs by its command line. The others run by scripts in `runners/`, with the Python in which
the program is installed. A job is a dictionary with its files and settings; settings here
complete it.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from pathlib import Path
from typing import Any

from texbake.records import dataclass
from texbake.study.options import BLENDER_VARIABLE, BenchOptions

Settings = list[tuple[str, dict[str, Any]]]
Job = Mapping[str, Any]

_VERSION_TIMEOUT = 120.0
_SUFFIXES = {
    "bake-normals": ".png", "bake-displacement": ".exr", "bake-ao": ".exr", "unwrap": ".npz",
    "simplify": ".ply", "remesh": ".ply", "preview": ".exr",
}  # fmt: skip


@dataclass(frozen=True)
class Product:
    """A file that a program made, and its `form`: `tangent`, `object`, `heights` or `positions`."""

    path: Path
    form: str = ""


@dataclass(frozen=True, eq=False)
class Program:
    """A program of the bench."""

    name: str
    title: str
    # For each task that it can do, the settings that are tried: labels and what they add to the
    # job.
    settings: Mapping[str, Callable[[BenchOptions], Settings]]
    runner: str = ""  # its script in `runners/`; empty for texbake
    # The Python that runs the script; None if the options name none.
    python: Callable[[BenchOptions], str | None] = lambda options: sys.executable
    forms: Mapping[str, str] = field(default_factory=dict)  # `Product.form` by task

    def version(self, options: BenchOptions) -> tuple[str, str]:
        """Return the version that is installed, or why there is none."""
        if not self.runner:
            from importlib.metadata import version

            return version("texbake"), ""
        python = self.python(options)
        if python is None:
            return "", f"no Python with it is named; give one with blender, or {BLENDER_VARIABLE}"
        done = run_process(self._script(python, {"task": "version"}), timeout=_VERSION_TIMEOUT)
        lines = [line for line in done.output.splitlines() if line.startswith("VERSION ")]
        if done.fault or not lines:
            return "", done.fault or "its script printed no version"
        return lines[-1].removeprefix("VERSION "), ""

    def command(self, job: Job, stem: Path, options: BenchOptions) -> tuple[list[str], Product]:
        """Return the command that does a job, and what it will write, named `stem` and a suffix."""
        task = job["task"]
        path = stem.with_suffix(_SUFFIXES[task])
        if not self.runner:
            out = path.with_suffix(".obj") if task == "unwrap" else path
            line = f"{_LINES[task]} --quiet --progress none"
            words = [word.format(**job, out=out) for word in line.split()]
            path = out / "ao.exr" if task == "bake-ao" else out
            start = "from texbake_cli import run; run()"
            return [sys.executable, "-P", "-c", start, *words], Product(
                path, self.forms.get(task, "")
            )
        python = self.python(options) or sys.executable
        return (
            self._script(python, {**job, "out": str(path)}),
            Product(path, self.forms.get(task, "")),
        )

    def _script(self, python: str, job: Job) -> list[str]:
        return [
            python, str(RUNNERS / self.runner), json.dumps({**job, "program": self.name}),
        ]  # fmt: skip


_BAKE = (
    "{high} {low} -o {out} --size {size} --front {distance} --back {distance} --padding {padding} "
    "--samples {samples}"
)
# Commands of texbake, filled in with the values of a job.
_LINES = {
    "bake-normals": f"bake-normals {_BAKE} --bits 16",
    "bake-displacement": f"bake-displacement {_BAKE} --bits 32",
    "bake-ao": f"bake {_BAKE} --maps ao --format exr --secondary-rays {{rays}}",
    "unwrap": "unwrap {mesh} -o {out} --size {size} --padding {padding} --quality {quality}",
    "simplify": "simplify {mesh} -o {out} --faces {faces} --quality {quality}",
    "remesh": "remesh {mesh} -o {out} --resolution {voxels}",
    "preview": "preview {scene} -o {out} --supersampling {side}",
}


# Settings


def _sizes(options: BenchOptions) -> Settings:
    return [(str(size), {"size": size, "samples": 1}) for size in options.map_sizes]


def _sizes_and_samples(options: BenchOptions) -> Settings:
    size = options.one_size
    more = [
        (f"{size}, {n} samples", {"size": size, "samples": n})
        for n in options.amounts.samples
        if n > 1
    ]
    return [*_sizes(options), *more]


def _with_adaptive(options: BenchOptions) -> Settings:
    size = options.one_size
    adaptive = (f"{size}, adaptive", {"size": size, "samples": "adaptive"})
    return [*_sizes_and_samples(options), adaptive]


def _rays(options: BenchOptions) -> Settings:
    same = {"size": options.one_size, "samples": 1}
    return [(f"{n} rays", {**same, "rays": n}) for n in options.amounts.rays]


def _counts(**same: Any) -> Callable[[BenchOptions], Settings]:
    return lambda options: [(f"{n:,}", {"faces": n, **same}) for n in options.amounts.counts]


def _texbake_counts(options: BenchOptions) -> Settings:
    return [
        (f"{n:,} {quality}", {"faces": n, "quality": quality})
        for n in options.amounts.counts
        for quality in ("fast", "best")
    ]


def _voxels(options: BenchOptions) -> Settings:
    return [(f"{n} voxels", {"voxels": n}) for n in options.amounts.voxels]


def _named(key: str, values: Mapping[str, Any]) -> Callable[[BenchOptions], Settings]:
    return lambda options: [(label, {key: value}) for label, value in values.items()]


def _qualities(options: BenchOptions) -> Settings:
    names = ("fast",) if options.quick else ("fast", "good", "best")
    return [(name, {"quality": name}) for name in names]


def _pixels(options: BenchOptions) -> Settings:
    return [
        (f"{n} sample{'s' if n > 1 else ''}", {"samples": n, "side": round(math.sqrt(n))})
        for n in options.amounts.pixel_samples
    ]


def _blender_python(options: BenchOptions) -> str | None:
    return options.blender or os.environ.get(BLENDER_VARIABLE) or None


PROGRAMS = {
    "texbake": Program(
        "texbake",
        "texbake",
        {
            "bake-normals": _with_adaptive,
            "bake-displacement": _sizes,
            "bake-ao": _rays,
            "unwrap": _qualities,
            "simplify": _texbake_counts,
            "remesh": _voxels,
            "preview": _pixels,
        },
        forms={"bake-normals": "tangent", "bake-displacement": "heights"},
    ),
    "blender": Program(
        "blender",
        "Blender",
        {
            "bake-normals": _sizes_and_samples,
            "bake-displacement": _sizes,
            "bake-ao": _rays,
            "unwrap": _named(
                "method", {"smart": "smart", "minimum stretch": "minimum-stretch"}
            ),
            "simplify": _counts(),
            "remesh": _voxels,
            "preview": _pixels,
        },
        runner="run_blender.py",
        python=_blender_python,
        forms={"bake-normals": "tangent", "bake-displacement": "positions"},
    ),
    "pymeshlab": Program(
        "pymeshlab",
        "pymeshlab",
        {
            "bake-normals": _sizes,
            "unwrap": _named("regions", {"10 regions": 10, "50 regions": 50}),
            "simplify": _counts(planar=False),
            "remesh": _voxels,
        },
        runner="run_library.py",
        forms={"bake-normals": "object"},
    ),
    "xatlas": Program(
        "xatlas",
        "xatlas",
        {"unwrap": _named("brute_force", {"default": False, "brute force": True})},
        runner="run_library.py",
    ),
    "fast-simplification": Program(
        "fast-simplification",
        "fast-simplification",
        {"simplify": _counts()},
        runner="run_library.py",
    ),
    "meshoptimizer": Program(
        "meshoptimizer", "meshoptimizer", {"simplify": _counts()}, runner="run_library.py"
    ),
}  # fmt: skip


def common_settings(task: str, options: BenchOptions) -> Settings:
    """Return the settings of a task that mean the same in every program."""
    if task == "unwrap":
        return [("default", {})]
    return PROGRAMS["blender"].settings[task](options)


RUNNERS = Path(__file__).with_name("runners")
_LAUNCHER = RUNNERS / "launcher.py"


@dataclass(frozen=True, kw_only=True)
class Finished:
    """What a process took."""

    seconds: float = 0.0  # from its start to its end; 0 if it could not be started
    # Greatest resident memory of it or one of its children; None where the system does not say.
    peak_bytes: int | None = None
    output: str = ""  # the end of what it printed
    fault: str = ""  # why it failed; empty if it did not


def run_process(command: Sequence[str], *, timeout: float) -> Finished:
    """Run a command to its end, or until `timeout` seconds have passed."""
    line = [sys.executable, "-I", str(_LAUNCHER), str(timeout), *command]
    with subprocess.Popen(line, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as launched:
        assert launched.stdin is not None and launched.stdout is not None
        try:
            answer = launched.stdout.read()
        finally:
            launched.stdin.close()  # it ends its command, unless that has ended
    if launched.returncode:  # somebody ended it
        return Finished(fault=f"it was ended from outside: exit code {launched.returncode}")
    report = json.loads(answer)
    return Finished(
        seconds=report.get("seconds", 0.0),
        peak_bytes=report.get("peak_bytes"),
        output=report["output"],
        fault=_fault(report, timeout),
    )


def _fault(report: dict[str, object], timeout: float) -> str:
    if report.get("late"):
        return f"it was ended after {timeout:g} s"
    code = report["code"]
    if code == 0:
        return ""
    lines = [line for line in str(report["output"]).splitlines() if line.strip()]
    last = lines[-1].strip() if lines else "it printed nothing"
    return f"exit code {code}: {last}"
