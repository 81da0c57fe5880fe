"""Samples run as a newcomer runs them, and write what they name; tests/goldens runs others."""

import os
import runpy
import subprocess
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from texbake_cli.main import texbake as command_line

import texbake
from tests.docs.test_docs import smaller
from texbake.jobs import orange_turns

SAMPLES = Path(__file__).parents[2] / "samples"


def test_command_line(tmp_path, monkeypatch, small_pictures):
    """The commands of the script, which are run here at small sizes."""
    fake = tmp_path / "bin" / "texbake"
    fake.parent.mkdir()
    fake.write_text(f'#!/bin/sh\necho "$*" >> "{tmp_path}/lines"\n')
    fake.chmod(0o755)
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "orange_high.ply").touch()
    monkeypatch.setenv("PATH", f"{fake.parent}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.chdir(tmp_path)
    subprocess.run(["bash", SAMPLES / "command_line.sh", "out", "8000"], check=True)
    for line in (tmp_path / "lines").read_text().splitlines():
        with pytest.raises(SystemExit) as stop:
            command_line(smaller(line.split()), prog_name="texbake")
        assert not stop.value.code, line
    for name in ("maps/normal.png", "maps/displacement.png", "normal_directx.png", "preview.png"):
        image = texbake.read_image(tmp_path / "out" / name, color=False)
        assert image.pixels.std() > 0.01
    assert texbake.read_mesh(tmp_path / "out" / "low_uv.obj").uvs is not None
    assert {path.name for path in tmp_path.iterdir()} == {"bin", "lines", "out"}


@pytest.mark.parametrize("name", sorted(p.name for p in SAMPLES.iterdir() if p.suffix == ".py"))
def test_samples_are_listed_and_use_the_public_names(name):
    assert f"({name})" in (SAMPLES / "README.md").read_text()


def test_orange_angles(tmp_path, monkeypatch):
    """It writes plots, figures and pictures as those beside it, here of the angles it shows."""
    angles = (0, 60)
    measure = partial(orange_turns.measure_turns, angles)
    monkeypatch.setattr(orange_turns, "measure_turns", measure)
    monkeypatch.setattr(sys, "argv", ["orange_angles.py", str(tmp_path)])
    runpy.run_path(str(SAMPLES / "orange_angles.py"), run_name="__main__")
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"orange_angles.svg", "orange_angles.csv", "orange_angles.png"}
    ours, kept = (
        np.genfromtxt(folder / "orange_angles.csv", delimiter=",", skip_header=1)
        for folder in (tmp_path, SAMPLES)
    )
    kept = kept[np.isin(kept[:, 1], angles)]
    assert len(ours) == len(kept) == 2 * 2 * len(orange_turns.METHODS)
    np.testing.assert_allclose(ours, kept, rtol=1e-3)


EXECUTE = """
import sys, nbformat
from nbclient import NotebookClient

notebook = nbformat.read(sys.argv[1], as_version=4)
NotebookClient(notebook, kernel_name="python3", timeout=300).execute()
for cell in notebook.cells:
    for output in cell.get("outputs", []):
        print("view" if "text/html" in output.get("data", {}) else output.get("text", "").strip())
"""


def test_the_notebook_runs_and_shows_each_step(tmp_path):
    """In a kernel of its own, which imports the installed package."""
    notebook = str(SAMPLES / "notebook.ipynb")
    lines = subprocess.run(
        [sys.executable, "-P", "-c", EXECUTE, notebook], cwd=tmp_path,
        env={**os.environ, "TMPDIR": str(tmp_path), "IPYTHONDIR": str(tmp_path / "ipython")},
        capture_output=True, text=True, check=True,
    ).stdout.splitlines()  # fmt: skip
    assert lines[0].startswith("<Mesh torus: 360,000 faces, 180,000 vertices, 2.828 x ")
    assert lines.count("view") == 3
    assert lines[-1] == "['normal.png', 'displacement.png', 'ao.png']"
