"""Text from files reaches the terminal without control characters."""

import os
import subprocess

import numpy as np
import pytest
from click.testing import CliRunner
from texbake_cli.main import texbake as command
from texbake_cli.printable import printable

import texbake
from texbake.mesh.shapes import icosphere


@pytest.mark.parametrize(
    ("text", "printed"),
    [
        ("plain, äöü 漢字 and two\nlines", "plain, äöü 漢字 and two\nlines"),
        ("\x1b]0;title\x07", r"\x1b]0;title\x07"),
        ("a\rb\tc\x7f\x9b", r"a\x0db\x09c\x7f\x9b"),
        ("\u202egnp.exe", r"\u202egnp.exe"),
        (os.fsdecode(b"\xff.obj"), r"\xff.obj"),
    ],
)
def test_control_characters_become_escapes(text, printed):
    assert printable(text) == printed


def test_names_in_a_file_are_printed_without_escape_sequences(tmp_path):
    path = tmp_path / "red.obj"
    triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
    path.write_text(f"mtllib red.mtl\n{triangle}g \x1b[31mred\nusemtl \x1b[2J\nf 1 2 3\n")
    (tmp_path / "red.mtl").write_text("newmtl \x1b[2J\nmap_Kd \x1b[5m.png\n")
    result = CliRunner().invoke(command, ["info", str(path)])
    assert result.exit_code == 0
    assert "\x1b" not in result.output
    assert r"\x1b[2J" in result.output


def test_a_name_cannot_pass_for_a_line_of_the_report(tmp_path):
    mesh = icosphere(0)
    names = ("red\nwrote a.png", "blue")
    groups = np.arange(mesh.n_faces) % 2
    texbake.write_mesh(mesh.replace(face_groups=groups, group_names=names), tmp_path / "red.glb")
    result = CliRunner().invoke(command, ["info", str(tmp_path / "red.glb")])
    assert result.exit_code == 0
    assert r"red\x0awrote a.png" in result.output
    assert not any(line.startswith("wrote") for line in result.output.splitlines())


def test_an_error_names_a_file_without_escape_sequences(tmp_path):
    result = CliRunner().invoke(command, ["info", str(tmp_path / "\x1b[31m.obj")])
    assert result.exit_code != 0
    assert "\x1b" not in result.output


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such shell")
@pytest.mark.parametrize("closed", ["2>&-", ">&- 2>&-", "<&- >&- 2>&-", "<&-"])
def test_closed_streams_stop_nothing(tmp_path, script, closed):
    texbake.write_mesh(icosphere(1), tmp_path / "ball.obj")
    line = f'"{script}" unwrap ball.obj -o ball_uv.obj {closed}'
    done = subprocess.run(["sh", "-c", line], cwd=tmp_path, capture_output=True)
    assert done.returncode == 0, done.stderr
    assert texbake.read_mesh(tmp_path / "ball_uv.obj").uvs is not None


@pytest.mark.parametrize("closed", ["2>&-", "<&- 2>&-", ">&- 2>&-", "<&- >&- 2>&-"])
def test_closed_streams_change_no_exit_code(tmp_path, script, closed):
    done = subprocess.run(["sh", "-c", f'"{script}" frob {closed}'], cwd=tmp_path, timeout=60)
    assert done.returncode == 2


@pytest.mark.parametrize(
    "arguments",
    [
        ("unwrap", "ball.obj", "-o", "x" * 300 + ".obj"),
        ("run", "ball.obj", "-o", "x" * 300, "--faces", "20"),
        ("bake", "x" * 300 + ".obj", "ball.obj", "-o", "maps"),
        ("bake", "ball.obj", "x" * 300 + ".obj", "-o", "maps"),
    ],
)
def test_a_name_that_is_too_long_is_one_line(tmp_path, monkeypatch, arguments):
    monkeypatch.chdir(tmp_path)
    texbake.write_mesh(icosphere(1), "ball.obj")
    result = CliRunner().invoke(command, arguments)
    assert result.exit_code == 1
    assert "File name too long" in result.output
    assert result.output.count("\n") == 1


def test_a_name_that_is_as_long_as_names_may_be(tmp_path):
    """The name of a file beside it, of further texture coordinates, would be too long."""
    texbake.write_mesh(icosphere(1), tmp_path / "ball.obj")
    path = (tmp_path / "ball.obj").rename(tmp_path / f"{'x' * 250}.obj")
    result = CliRunner().invoke(command, ["info", str(path)])
    assert (result.exit_code, result.exception) == (0, None)
