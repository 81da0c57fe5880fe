"""The last lines of pytest count the tests that skip without the real meshes, by reason."""

import os
import subprocess
import sys
from pathlib import Path

TESTS = Path(__file__).parent
FILES = "fbx_smoothing", "read_mesh"


def test_skipped_tests_are_counted_in_the_last_lines(tmp_path):
    done = subprocess.run(
        [sys.executable, "-P", "-m", "pytest", "-q", "-n", "1", "-k", "of_the_file or real_files",
         "-p", "no:cacheprovider", *(TESTS / "mesh" / f"test_{name}.py" for name in FILES)],
        env={**os.environ, "TEXBAKE_DATA": str(tmp_path)}, cwd=TESTS.parent,
        capture_output=True, text=True, check=True, timeout=120,
    )  # fmt: skip
    reason, total = done.stdout.splitlines()[-2:]
    assert reason == "2 tests skipped: needs certain real files; name their folder in TEXBAKE_DATA"
    assert " 2 skipped" in total and " passed" in total
