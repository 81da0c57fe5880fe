"""Messages in the flags of a command, and text from files without control characters."""

import os
import subprocess
from pathlib import Path

import click
import numpy as np
import pytest
from click.testing import CliRunner
from texbake_cli.main import texbake as command
from texbake_cli.messages import printable, with_flags

import texbake
from texbake import OptionError
from texbake.mesh.shapes import icosphere


@pytest.mark.parametrize(("text", "printed"), [
    ("plain, äöü 漢字 and two\nlines", "plain, äöü 漢字 and two\nlines"),
    ("\x1b]0;title\x07", r"\x1b]0;title\x07"),
    ("a\rb\tc\x7f\x9b", r"a\x0db\x09c\x7f\x9b"),
    ("\u202egnp.exe", r"\u202egnp.exe"),
    (os.fsdecode(b"\xff.obj"), r"\xff.obj"),
])  # fmt: skip
def test_control_characters_become_escapes(text, printed):
    assert printable(text) == printed


def test_no_name_in_a_file_has_an_escape_sequence_or_passes_for_a_line(tmp_path):
    path = tmp_path / "red.obj"
    triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
    path.write_text(f"mtllib red.mtl\n{triangle}g \x1b[31mred\nusemtl \x1b[2J\nf 1 2 3\n")
    (tmp_path / "red.mtl").write_text("newmtl \x1b[2J\nmap_Kd \x1b[5m.png\n")
    result = CliRunner().invoke(command, ["info", str(path)])
    assert result.exit_code == 0
    assert "\x1b" not in result.output and r"\x1b[2J" in result.output
    mesh = icosphere(0)
    names = ("red\nwrote a.png", "blue")
    groups = np.arange(mesh.n_faces) % 2
    texbake.write_mesh(mesh.replace(face_groups=groups, group_names=names), tmp_path / "red.glb")
    result = CliRunner().invoke(command, ["info", str(tmp_path / "red.glb")])
    assert result.exit_code == 0
    assert r"red\x0awrote a.png" in result.output
    assert not any(line.startswith("wrote") for line in result.output.splitlines())
    result = CliRunner().invoke(command, ["info", str(tmp_path / "\x1b[31m.obj")])
    assert result.exit_code != 0 and "\x1b" not in result.output


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such shell")
@pytest.mark.parametrize("closed", ["2>&-", "<&- >&- 2>&-"])
def test_closed_streams_stop_nothing(tmp_path, script, closed):
    texbake.write_mesh(icosphere(1), tmp_path / "ball.obj")
    line = f'"{script}" unwrap ball.obj -o ball_uv.obj {closed}'
    done = subprocess.run(["sh", "-c", line], cwd=tmp_path, capture_output=True)
    assert done.returncode == 0, done.stderr
    assert texbake.read_mesh(tmp_path / "ball_uv.obj").uvs is not None


@pytest.mark.parametrize(("name", "message", "shown"), [
    ("bake", "max_error: 'x' is no error", "--max-error: 'x' is no error"),
    ("bake", "front, back: both are 0", "--front, --back: both are 0"),
    ("bake", "keep_hits: not kept", "keep_hits: not kept"),  # bake has no such flag
    ("run", "n_faces: 3 is out of range", "--faces: 3 is out of range"),
    ("bake", "5 % missed; raise `front`, or see `miss_map`", "5 % missed; raise --front, or "
     "see --miss-map"),
    ("bake", "bake with `samples=16`", "bake with --samples 16"),
    ("bake", 'rays along `rays="vertex"`', "rays along --rays vertex"),
    ("bake", "or `cull_back_faces=False`", "or --hit-back-faces"),
    ("bake", "`high` has no faces", "HIGH has no faces"),
    ("bake-texture", "cameras: 0 are given", "--camera: 0 are given"),
    ("info", "a greater `max_error`", "a greater `max_error`"),
    ("info", "a.ply: there is no such file", "a.ply: there is no such file"),
])  # fmt: skip
def test_parameters_become_flags(name, message, shown):
    assert with_flags(message, command.get_command(click.Context(command), name)) == shown


def test_a_file_keeps_its_name_and_an_option_error_knows_its_parameters(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("maps").mkdir()
    done = CliRunner().invoke(command, ["bake", "maps", "low.obj", "-o", "baked"])
    assert done.exit_code == 1
    assert done.stderr.startswith("texbake: maps: there is no mesh in it")
    assert with_flags("size: 0; raise `size`") == "size: 0; raise `size`"
    assert OptionError("size: 0 is out of range").parameters == ("size",)
    assert OptionError("a/b.ply: two outputs").parameters == ()
