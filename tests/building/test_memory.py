"""How much memory a build may use, and what it says where that is too little."""

import json
import os
import resource
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from texbake.building import resolve
from texbake.building.task import Task, memory_advice

GB = 1 << 30
COMMAND = [sys.executable, "-P", "-c", "from texbake_cli import run; run()"]


def limited(n_bytes: int, kind: int = resource.RLIMIT_AS) -> Callable[[], None]:
    return lambda: resource.setrlimit(kind, (n_bytes, n_bytes))


@pytest.mark.parametrize(
    ("line", "files", "limits"),
    [
        ("0::/a/b", {"a/b/memory.max": "max\n", "a/memory.max": f"{3 * GB}\n"}, [3 * GB]),
        ("0::/", {"memory.max": f"{2 * GB}\n"}, [2 * GB]),  # a container sees its own as the root
        ("4:memory:/a", {"memory/a/memory.limit_in_bytes": f"{4 * GB}"}, [4 * GB]),
        ("4:cpu,memory:/gone", {"memory/memory.limit_in_bytes": f"{GB}"}, [GB]),
        ("1:cpu:/a", {"a/memory.max": f"{GB}", "memory.max": f"{GB}"}, []),
    ],
)
def test_limits_of_control_groups(
    tmp_path: Path, line: str, files: dict[str, str], limits: list[int]
) -> None:
    groups = tmp_path / "cgroup"
    groups.write_text(f"12:pids:/x\n{line}\n")
    for name, text in files.items():
        (tmp_path / "fs" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "fs" / name).write_text(text)
    assert resolve._group_limits(groups, tmp_path / "fs") == limits
    assert resolve._group_limits(tmp_path / "none", tmp_path) == []


def test_advice_says_whether_fewer_jobs_would_help() -> None:
    values: dict[str, Any] = {
        "asset": "a", "step": "s", "kind": "make", "settings": {}, "inputs": {}, "outputs": {},
        "key": "", "ingredients": {}, "store": "", "threads": 1, "memory_bytes": 5 * GB,
    }  # fmt: skip
    assert "run fewer jobs" in memory_advice(Task(**values, most_memory=8 * GB))
    assert "run fewer jobs" in memory_advice(Task(**values))
    most = memory_advice(Task(**values, most_memory=3 * GB))
    assert "5.0 GB, of the 3.0 GB that this build may use" in most and "jobs" not in most


def test_a_step_that_does_not_fit_fails_with_one_line(write: Any, tmp_path: Path) -> None:
    assets = "".join(f'[[assets]]\nname = "{name}"\noptions.ball.triangles = {n}\n'
                     for name, n in (("large", 20_000_000), ("small", 1000)))  # fmt: skip
    steps = '[steps.ball]\ndo = "make"\nshape = "orange"\noutput = "{asset}.ply"\n'
    done = subprocess.run(
        [*COMMAND, "build", os.fspath(write(assets, steps)), "--jobs", "1", "--quiet"],
        preexec_fn=limited(600 << 20),
        capture_output=True,
        text=True,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
        check=False,
    )
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert line.startswith("texbake: large: ball: out of memory; it is estimated to take up to ")
    report = json.loads((tmp_path / "build" / "build.json").read_text())
    assert [asset["state"] for asset in report["assets"]] == ["failed", "built"]
