"""A few kills and power cuts of the scripts that make many; Linux only."""

import subprocess
import sys
from pathlib import Path

import pytest
from traced_disk import can_trace

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")


def run(script: Path, line: str) -> None:
    done = subprocess.run(
        [sys.executable, "-P", script, *line.split()], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_killed_commands(hard_cases_dir: Path) -> None:
    run(hard_cases_dir / "kill_commands.py", "--kills 8 --only split-channels")


def test_power_cuts(hard_cases_dir: Path) -> None:
    if not can_trace():
        pytest.skip("strace is not installed, or may not trace here")
    run(hard_cases_dir / "power_cuts.py", "--states 60 --runs 1 --only split-channels")
