"""Blender, if TEXBAKE_BLENDER_PYTHON names a Python with bpy 5.0.1."""

import json
import os
import subprocess
from pathlib import Path

import pytest

from tests.mesh.conftest import readers_here

__all__ = ["readers_here"]  # for all tests here
SCRIPT = Path(__file__).parents[2] / "benchmarks" / "blender_asset.py"


@pytest.fixture(scope="module")
def blender(tmp_path_factory):
    """Run jobs in Blender."""
    python = os.environ.get("TEXBAKE_BLENDER_PYTHON")
    if not python:
        pytest.skip("TEXBAKE_BLENDER_PYTHON names no Python with bpy")
    folder = tmp_path_factory.mktemp("blender")

    def run(*jobs):
        files = [folder / f"job{number}.json" for number in range(len(jobs))]
        for file, job in zip(files, jobs, strict=True):
            file.write_text(json.dumps(job))
        done = subprocess.run(
            [python, SCRIPT, *files], capture_output=True, text=True, check=False, timeout=180
        )
        assert done.returncode == 0, done.stderr

    return run
