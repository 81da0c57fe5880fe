"""Kernels run wherever they are installed, also where nothing can be written."""

import os
import subprocess
import sys

import pytest

# A kernel in a file of its own, as numba's cache wants it.
SCRIPT = """
import sys
sys.path.insert(0, {folder!r})
import doubled
print(doubled.doubled(21.0), doubled.ratio(1.0, 0.0))
"""
MODULE = """
from texbake.kernels import callback, kernel
from numba import types

@kernel
def doubled(x):
    return 2.0 * x

@kernel
def ratio(x, y):
    return x / y

@callback(types.double(types.double))
def called_back(x):
    return x + 1.0

assert called_back.ctypes(1.0) == 2.0
"""


@pytest.mark.parametrize("place", ["a file is there", "no folder for it", "good"])
def test_a_kernel_runs_without_a_place_for_its_machine_code(tmp_path, place):
    (tmp_path / "doubled.py").write_text(MODULE)
    (tmp_path / "file").touch()
    cache = {"a file is there": tmp_path / "file", "no folder for it": tmp_path / "file" / "below"}
    # numba writes beside the module, else below the home folder: all of them are taken away.
    (tmp_path / "__pycache__").touch() if place != "good" else None
    home = str(cache.get(place, tmp_path / "home"))
    environment = {**os.environ, "HOME": home, "XDG_CACHE_HOME": home, "NUMBA_CACHE_DIR": home}
    process = subprocess.run(
        [sys.executable, "-B", "-c", SCRIPT.format(folder=str(tmp_path))],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert process.stdout == "42.0 inf\n", process.stderr


def test_a_full_disk_costs_the_cache_and_not_the_work(tmp_path):
    resource = pytest.importorskip("resource")
    (tmp_path / "doubled.py").write_text(MODULE)

    def no_file_may_grow():
        resource.setrlimit(resource.RLIMIT_FSIZE, (64, 64))

    process = subprocess.run(
        [sys.executable, "-B", "-c", SCRIPT.format(folder=str(tmp_path))],
        env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache")},
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=no_file_may_grow,
    )
    assert process.stdout == "42.0 inf\n", process.stderr
