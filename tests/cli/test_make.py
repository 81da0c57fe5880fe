"""`texbake make`: every shape, as a command and as a process; wrong usage."""

import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import Result

from texbake import make, read_mesh, write_image

Invoke = Callable[..., Result]
Run = Callable[..., subprocess.CompletedProcess[str]]

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
def workplace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A current folder with a profile, a patch and an image."""
    (tmp_path / "profile.txt").write_text("0 0\n1 0\n1 1\n")
    (tmp_path / "patch.txt").write_text(PATCH)
    gray = np.linspace(0, 1, 20, dtype=np.float32).reshape(4, 5, 1)
    write_image(gray, tmp_path / "hill.png", color=False)
    write_image(gray[:1, :1], tmp_path / "dot.png", color=False)
    (tmp_path / "negative.txt").write_text("0 0\n-1 1\n")
    (tmp_path / "hole.txt").write_text("1\n1,2,3\n16\n" + PATCH)
    (tmp_path / "binary.txt").write_bytes(b"32\n\0\1\2\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("line", LINES)
def test_shapes_are_written(line: str, workplace: Path, invoke: Invoke) -> None:
    before = set(workplace.iterdir())
    result = invoke(line)
    name = line.split()[3]
    assert set(workplace.iterdir()) - before == {workplace / name}
    assert f"wrote {name}" in result.stdout
    mesh = read_mesh(name)
    assert mesh.n_faces == LINES[line]
    if not name.endswith((".stl", ".off")):
        assert mesh.uvs is not None


@pytest.mark.parametrize(
    "line", ["make mobius -o a.obj", "make bezier -o a.obj --patches patch.txt"]
)
def test_make_as_a_process(line: str, workplace: Path, run: Run) -> None:
    done = run(f"{line} --resolution 4x4")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("faces     32\n")
    assert read_mesh("a.obj").n_faces == 32


def test_the_mesh_is_that_of_the_api(workplace: Path, invoke: Invoke) -> None:
    invoke("make torus -o a.obj --resolution 9x5 --radius 2 --minor-radius 0.5 --quiet")
    mesh = make("torus", resolution=(9, 5), radius=2, minor_radius=0.5)
    read = read_mesh("a.obj")
    np.testing.assert_array_equal(read.positions, mesh.positions)
    np.testing.assert_array_equal(read.corner_uvs(), mesh.corner_uvs())


@pytest.mark.parametrize(
    ("line", "exit_code", "message"),
    [
        ("sphere -o a.obj --resolution 0", 2, "resolution: 0"),
        ("sphere -o a.obj --resolution 1000000000", 2, "2,000,000,000,000,000,000 triangles"),
        ("sphere -o a.obj --resolution fine", 2, "'fine' is not a size"),
        ("sphere -o a.obj --radius 0", 2, "radius: 0.0"),
        ("sphere -o a.obj --radius -1", 2, "radius: -1.0"),
        ("sphere -o a.obj --radius nan", 2, "radius: nan"),
        ("sphere -o a.obj --caps", 2, "caps: the shape sphere does not use it"),
        ("cylinder -o a.obj --sides 2", 2, "sides: 2"),
        ("ball -o a.obj", 2, "'ball'"),
        ("sphere", 2, "missing option '-o'"),
        ("bezier -o a.obj", 2, "patches: the shape bezier needs it"),
        ("sphere -o a.png", 1, "'.png'"),
        ("sphere -o nowhere/a.obj", 1, "there is no folder"),
        ("revolution -o a.obj --profile no.txt", 1, "no.txt: there is no such file"),
        ("revolution -o a.obj --profile negative.txt", 1, "negative.txt: line 2: the radius -1"),
        ("bezier -o a.obj --patches hole.txt", 1, "hole.txt: line 2: patch 1 of 1 has 3 indices"),
        ("bezier -o a.obj --patches binary.txt", 1, "binary.txt: it is not a patch file"),
        ("height-field -o a.obj --image dot.png", 2, "image: it has 1 x 1 pixels"),
        ("height-field -o a.obj --image no.png", 1, "no.png"),
        ("height-field -o a.obj --image patch.txt", 1, "patch.txt"),
    ],
)
def test_one_line_the_exit_code_and_no_file(
    workplace: Path, invoke: Invoke, line: str, exit_code: int, message: str
) -> None:
    before = sorted(workplace.iterdir())
    result = invoke(f"make {line}", exit_code)
    assert result.stdout == ""
    assert result.stderr.count("\n") == 1
    assert message in result.stderr
    assert sorted(workplace.iterdir()) == before


def test_no_input_is_overwritten(workplace: Path, invoke: Invoke) -> None:
    (workplace / "alias.obj").symlink_to("patch.txt")
    assert "also an input" in invoke("make bezier -o alias.obj --patches patch.txt", 2).stderr
    assert (workplace / "patch.txt").read_text() == PATCH
