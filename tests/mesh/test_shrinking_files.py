"""Files that become shorter while they are read: an error, and never the end of the process."""

import os
import subprocess
import sys

import pytest

import texbake
from texbake.core import core
from texbake.errors import FileError
from texbake.mesh.shapes import icosphere
from texbake.mesh.streamed.mapped_file import map_file
from texbake.mesh.streamed.mesh import open_streamed


@pytest.fixture
def scan(tmp_path):
    path = tmp_path / "scan.ply"
    texbake.write_mesh(icosphere(5), path)
    return path


def test_lost_pages_read_as_zeros_and_are_told(scan):
    file = map_file(scan)
    before = file.data[:100].copy()
    os.truncate(scan, 4096)
    assert not file.data[-1]
    assert (file.data[:100] == before).all()
    with pytest.raises(FileError, match=r"scan\.ply: it became shorter while it was read"):
        file.require_whole()


def test_a_file_that_stays_is_whole(scan):
    file = map_file(scan)
    assert file.data.sum() > 0
    file.require_whole()


def test_mappings_are_released(scan):
    for _ in range(1000):  # more than there are slots
        file = map_file(scan)
    os.truncate(scan, 4096)
    assert not file.data[-1]


def test_a_streamed_mesh_that_becomes_shorter_is_an_error(scan):
    mesh = open_streamed(scan)
    os.truncate(scan, scan.stat().st_size // 3)
    with pytest.raises(FileError, match="it became shorter"):
        list(mesh.chunks(1000))


def test_other_bus_errors_still_end_the_process(scan):
    code = f"""
import mmap, os, numpy as np
from texbake.mesh.streamed.mapped_file import map_file
guarded = map_file({str(scan)!r})
with open({str(scan)!r}, "rb") as file:
    pages = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
os.truncate({str(scan)!r}, 4096)
pages[-1]
"""
    done = subprocess.run([sys.executable, "-P", "-c", code], capture_output=True)
    assert done.returncode == -7  # SIGBUS


def test_the_count_of_lost_mappings_only_grows(scan):
    n_lost = core.count_lost_mappings()
    file = map_file(scan)
    os.truncate(scan, 4096)
    assert not file.data[-1]
    assert core.count_lost_mappings() == n_lost + 1
