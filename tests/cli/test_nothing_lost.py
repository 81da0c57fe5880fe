"""A full disk, a signal and a closed terminal: one line, no partial file, nothing lost."""

import resource
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import Result
from texbake_cli.signals import SIGNALED

from texbake import read_mesh

Invoke = Callable[..., Result]
Run = Callable[..., subprocess.CompletedProcess[str]]


def names_in(folder: Path) -> list[str]:
    """All names, including hidden ones such as those of half-written files."""
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize(
    "line",
    [
        "bake-normals high.ply low.obj --size 256 -o there.png",
        "simplify high.ply --faces 5000 -o there.obj",
        "unwrap low.obj -o there.glb --layout there.png",
    ],
)
def test_a_full_disk_loses_nothing(workplace: Path, run: Run, line: str) -> None:
    def fill_the_disk() -> None:
        # A file may not grow past 4 KiB, as on a full disk.
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))

    # Once without the limit, so that no kernel is left to be compiled, and its code to be cached.
    assert run(line).returncode == 0
    name = line.split("-o ")[1].split()[0]
    Path(name).write_bytes(b"what was there")
    before = names_in(workplace)
    done = run(line, preexec_fn=fill_the_disk)
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1, done.stderr
    assert f"{name}: cannot be written" in done.stderr
    assert Path(name).read_bytes() == b"what was there"
    assert names_in(workplace) == before


def test_a_signal_in_the_middle_loses_nothing(workplace: Path, script: Path) -> None:
    Path("there.png").write_bytes(b"what was there")
    before = names_in(workplace)
    # Enough rays that the work would take a minute.
    line = "bake-normals high.ply low.obj --size 4096 --samples 16 -o there.png --progress json"
    process = subprocess.Popen(
        [script, *line.split()],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # A test runner in the background may have SIGINT ignored, which a child would inherit.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    assert process.stderr is not None
    for row in process.stderr:
        if '"advanced"' in row:  # in the middle of the rays
            break
    process.send_signal(signal.SIGINT)
    start = time.perf_counter()
    output, errors = process.communicate(timeout=60)
    assert time.perf_counter() - start < 10
    assert process.returncode == SIGNALED + signal.SIGINT
    lines = [row for row in errors.splitlines(keepends=True) if not row.startswith("{")]
    assert lines == ["texbake: interrupted\n"]
    assert output == ""
    assert Path("there.png").read_bytes() == b"what was there"
    assert names_in(workplace) == before


@pytest.mark.parametrize("line", ["info low.obj", "--help", "bake --help"])
def test_what_cannot_be_printed(workplace: Path, script: Path, line: str) -> None:
    words = [script, *line.split()]
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(words, stdout=full, stderr=subprocess.PIPE, text=True, timeout=60)
    assert done.returncode == 1
    (said,) = done.stderr.splitlines()
    assert said == "texbake: standard output: cannot be written: No space left on device"


def test_inputs_are_read_before_outputs_replace_them(workplace: Path, invoke: Invoke) -> None:
    before = read_mesh("low.obj")
    invoke("unwrap low.obj -o low.obj --size 128")
    after = read_mesh("low.obj")
    np.testing.assert_array_equal(before.positions, after.positions)


def test_a_closed_standard_output(workplace: Path, script: Path) -> None:
    done = subprocess.run(
        ["sh", "-c", f"'{script}' info low.obj >&-"],
        stderr=subprocess.PIPE,
        text=True,
        timeout=60,
    )
    assert "Traceback" not in done.stderr
