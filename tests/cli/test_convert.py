"""`convert`, `transform` and `repair`: what they write and say."""

from pathlib import Path

import numpy as np
import pytest

from texbake import Mesh, read_mesh, write_mesh
from texbake.mesh.shapes import uv_sphere


def test_units_and_the_axis_that_points_up(workplace, invoke):
    result = invoke("convert low.obj meters.ply --units cm --up z --scale 2")
    assert result.output.splitlines()[0].split() == ["faces", "112"]
    moved, low = read_mesh("meters.ply"), read_mesh("low.obj")
    assert np.allclose(moved.positions, 0.02 * low.positions[:, [0, 2, 1]] * (1, 1, -1), atol=1e-15)


@pytest.mark.parametrize(
    ("target", "lost"), [("a.ply", "materials"), ("a.stl", "texture coordinates, materials")]
)
def test_what_is_lost_is_said(target, lost, workplace, invoke):
    text = Path("low.obj").read_text("utf-8").replace("\nf ", "\nusemtl red\nf ", 1)
    Path("red.obj").write_text(f"mtllib red.mtl\n{text}", "utf-8")
    Path("red.mtl").write_text("newmtl red\nKd 1 0 0\n", "utf-8")
    result = invoke(f"convert red.obj {target}")
    assert f"texbake: warning: {target}: written without {lost}\n" in result.output
    Path("red.mtl").unlink()
    assert "written without" in invoke(f"convert red.obj {target}").output


def test_a_mesh_may_replace_itself(workplace, invoke):
    before = read_mesh("low.obj").positions
    invoke("transform low.obj -o own.obj --move 1,0,0")
    invoke("transform own.obj -o own.obj --move 0,2,0 -q")
    assert np.allclose(read_mesh("own.obj").positions, before + np.array([1, 2, 0]), atol=1e-15)


def test_repairs_are_counted(tmp_path, invoke):
    ball = uv_sphere(4, 8)
    twice = Mesh(positions=ball.positions, faces=np.concatenate([ball.faces] * 2))
    write_mesh(twice, tmp_path / "twice.ply")
    result = invoke(f"repair {tmp_path}/twice.ply -o {tmp_path}/once.ply")
    assert ["duplicate", "faces", str(ball.n_faces)] in [
        r.split() for r in result.output.split("\n")
    ]
    assert read_mesh(tmp_path / "once.ply").n_faces == ball.n_faces
    kept = invoke(f"repair {tmp_path}/twice.ply -o {tmp_path}/kept.ply --no-duplicates")
    assert "duplicate" not in kept.output
    assert read_mesh(tmp_path / "kept.ply").n_faces == 2 * ball.n_faces


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".glb"])
def test_names_may_be_as_long_as_the_file_system_allows(invoke, tmp_path, monkeypatch, suffix):
    monkeypatch.chdir(tmp_path)
    write_mesh(uv_sphere(4, 8), "sphere.obj")
    name = "a" * (255 - len(suffix)) + suffix
    invoke(f"convert sphere.obj {name}")
    assert read_mesh(name).n_faces == uv_sphere(4, 8).n_faces
