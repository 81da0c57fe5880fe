"""A full disk, a signal and a closed terminal: one line, no partial file, nothing lost."""

import resource
import signal
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import Result

from texbake import read_mesh

Invoke = Callable[..., Result]
Run = Callable[..., subprocess.CompletedProcess[str]]


def names_in(folder: Path) -> list[str]:
    """All names, including hidden ones such as those of half-written files."""
    return sorted(path.name for path in folder.iterdir())


def test_a_full_disk_loses_nothing(workplace: Path, run: Run) -> None:
    line = "unwrap low.obj -o there.glb --layout there.png"

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
