"""A small pair of meshes, and the command as a person runs it."""

import os
import re
import shutil
import subprocess
import sysconfig
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from texbake_cli.main import texbake

from texbake import write_mesh
from texbake.mesh.shapes import grid_sphere, uv_sphere

# What a command that succeeds prints on stderr: warnings, and the progress of work of more than ten
# seconds.
KNOWN_LINE = re.compile(
    r"texbake: (warning: .*|.*: \d[\d.]* (s|min)|.*: \d+ % in .* left|.* takes .*)"
)


@pytest.fixture(scope="session")
def only_known_lines():
    return lambda text: all(KNOWN_LINE.fullmatch(row) for row in text.splitlines())


@pytest.fixture(scope="session")
def script():
    beside = Path(sysconfig.get_path("scripts")) / "texbake"
    found = beside if beside.is_file() else shutil.which("texbake")
    assert found, "the texbake script is not installed"
    return Path(found)


@pytest.fixture(scope="session")
def pair(tmp_path_factory):
    """Folder with high.ply, 11,400 triangles of a rough sphere, and low.obj, 112 with uvs."""

    def radius_at(theta, phi):
        return 1.0 + 0.02 * np.sin(8 * theta) * np.sin(8 * phi)

    folder = tmp_path_factory.mktemp("pair")
    write_mesh(grid_sphere(58, 100, radius_at), folder / "high.ply")
    write_mesh(uv_sphere(8, 8), folder / "low.obj")
    return folder


@pytest.fixture
def workplace(pair, tmp_path, monkeypatch):
    for file in pair.iterdir():
        os.link(file, tmp_path / file.name)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def invoke():
    """Run a command line through click's runner, which must not end in a traceback."""

    def invoke(line, exit_code=0):
        result = CliRunner().invoke(texbake, line.split())
        if result.exception is not None and not isinstance(result.exception, SystemExit):
            raise result.exception
        assert result.exit_code == exit_code, result.output
        return result

    return invoke


@pytest.fixture
def run(script):
    """Run a command line as a process of its own, without a terminal."""

    def run(line, **more):
        return subprocess.run(
            [script, *line.split()], capture_output=True, text=True, timeout=120, **more
        )

    return run
