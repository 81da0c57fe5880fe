"""A few kills of the script that makes many; Linux only."""

import subprocess
import sys
from pathlib import Path

import pytest

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
