"""`texbake make`: every shape, as a command and as a process; wrong usage."""

import numpy as np
import pytest

from texbake import make, read_mesh, write_image

PATCH = "".join(f"{x} {y} {x * y / 9}\n" for y in range(4) for x in range(4))

LINES = {
    "make plane -o a.obj --resolution 3 --width 2 --height 1": 18,
    "make cylinder -o a.obj --resolution 12x2": 48,
    "make cylinder -o a.glb --sides 6 --caps --radius 2": 24,
    "make cone -o a.ply --resolution 12x2 --height 3": 36,
    "make sphere -o a.stl --resolution 12x6": 120,
    "make torus -o a.off --resolution 12x6 --minor-radius 0.2": 144,
    "make mobius -o a.obj --resolution 24x2 --twists 3": 96,
    "make revolution -o a.obj --profile profile.txt --resolution 8x1 --turns 0.5 --crease 10": 24,
    "make bezier -o a.obj --patches patch.txt --resolution 4": 32,
    "make height-field -o a.obj --image hill.png --height 0.5": 2 * 4 * 3,
}


@pytest.fixture
def workplace(tmp_path, monkeypatch):
    """A current folder with a profile, a patch and an image."""
    (tmp_path / "profile.txt").write_text("0 0\n1 0\n1 1\n")
    (tmp_path / "patch.txt").write_text(PATCH)
    gray = np.linspace(0, 1, 20, dtype=np.float32).reshape(4, 5, 1)
    write_image(gray, tmp_path / "hill.png", color=False)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("line", LINES)
def test_shapes_are_written(line, workplace, invoke):
    before = set(workplace.iterdir())
    result = invoke(line)
    name = line.split()[3]
    assert set(workplace.iterdir()) - before == {workplace / name}
    assert f"wrote {name}" in result.stdout
    mesh = read_mesh(name)
    assert mesh.n_faces == LINES[line]
    if not name.endswith((".stl", ".off")):
        assert mesh.uvs is not None


def test_the_mesh_is_that_of_the_api(workplace, invoke):
    invoke("make torus -o a.obj --resolution 9x5 --radius 2 --minor-radius 0.5 --quiet")
    mesh = make("torus", resolution=(9, 5), radius=2, minor_radius=0.5)
    read = read_mesh("a.obj")
    np.testing.assert_array_equal(read.positions, mesh.positions)
    np.testing.assert_array_equal(read.corner_uvs(), mesh.corner_uvs())
