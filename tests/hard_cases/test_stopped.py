"""A few kills and power cuts of the scripts that make many; Linux only."""

import subprocess
import sys
from pathlib import Path

import pytest
from traced_disk import can_trace

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")


def result_of(script: Path, line: str) -> tuple[int, str]:
    """The exit code of a script and what it printed."""
    done = subprocess.run(
        [sys.executable, "-P", script, *line.split()], capture_output=True, text=True
    )
    return done.returncode, done.stdout + done.stderr


def test_killed_commands(hard_cases_dir: Path) -> None:
    code, said = result_of(
        hard_cases_dir / "kill_commands.py", "--kills 8 --only split-channels --patience 30"
    )
    assert code == 0, said


def test_power_cuts(hard_cases_dir: Path) -> None:
    if not can_trace():
        pytest.skip("strace is not installed, or may not trace here")
    code, said = result_of(
        hard_cases_dir / "power_cuts.py", "--states 60 --runs 1 --only split-channels"
    )
    assert code == 0, said
