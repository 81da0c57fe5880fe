"""Samples run as a newcomer runs them, and write what they name; tests/goldens runs others."""

import csv
import os
import subprocess
import sys
from pathlib import Path

import pytest

import texbake

SAMPLES = Path(__file__).parents[2] / "samples"


def run_sample(name, *arguments, folder, status=0):
    interpreter = ["bash"] if name.endswith(".sh") else [sys.executable, "-W", "error"]
    # The console script lies beside the interpreter that runs the tests.
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    process = subprocess.run(
        [*interpreter, str(SAMPLES / name), *map(str, arguments)],
        cwd=folder,
        env={**os.environ, "PATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    assert process.returncode == status, process.stderr
    return process.stdout


def test_command_line(tmp_path):
    output = run_sample("command_line.sh", "out", 8_000, folder=tmp_path)
    assert "800" in output
    folder = tmp_path / "out"
    for name in ("maps/normal.png", "maps/displacement.png", "normal_directx.png", "preview.png"):
        image = texbake.read_image(folder / name, color=False)
        assert image.pixels.std() > 0.01
    assert texbake.read_mesh(folder / "low_uv.obj").uvs is not None
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out"]


def test_asset_folder(tmp_path):
    """The broken mesh fails by itself, and the exit code says that something did."""
    run_sample("asset_folder.py", "--size", 128, folder=tmp_path, status=1)
    folder = tmp_path / "asset_folder_sample"
    with (folder / "assets.csv").open() as file:
        rows = {row["asset"]: row for row in csv.DictReader(file)}
    assert rows["orange.ply"]["result"] == rows["ball.obj"]["result"] == "good"
    assert rows["broken.obj"]["result"].startswith("failed: ")
    assert "not finite" in rows["broken.obj"]["result"]
    assert (folder / "orange" / "orange_low.glb").is_file()
    assert not (folder / "broken").exists()


@pytest.mark.parametrize("name", sorted(p.name for p in SAMPLES.iterdir() if p.suffix == ".py"))
def test_samples_are_listed_and_use_the_public_names(name):
    assert f"({name})" in (SAMPLES / "README.md").read_text()


def test_orange_angles(tmp_path):
    """It writes the plots, figures and pictures that are kept beside it."""
    run_sample("orange_angles.py", tmp_path, folder=tmp_path)
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"orange_angles.svg", "orange_angles.csv", "orange_angles.png"}
    for name in names - {"orange_angles.png"}:
        assert len((tmp_path / name).read_text()) == len((SAMPLES / name).read_text())
