"""`-`: a mesh from standard input, or to standard output, and nothing else there."""

import json

import pytest
from click.testing import CliRunner
from texbake_cli.main import texbake
from texbake_cli.signals import EXIT_CODES
from texbake_cli.streams import _sniffed

from texbake import write_mesh
from texbake.mesh.files import WRITABLE_MESH_SUFFIXES
from texbake.mesh.shapes import uv_sphere


@pytest.fixture
def pipe(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for suffix in WRITABLE_MESH_SUFFIXES:
        write_mesh(uv_sphere(6, 8), f"ball{suffix}")

    def run(words, file=None, exit_code=0):
        data = b"" if file is None else (tmp_path / file).read_bytes()
        done = CliRunner().invoke(texbake, words.split(), input=data)
        assert done.exit_code == exit_code, done.output
        return done

    return run


@pytest.mark.parametrize("suffix", WRITABLE_MESH_SUFFIXES)
def test_formats_are_told_by_how_they_begin(pipe, tmp_path, suffix):
    if suffix not in (".usd", ".usdz"):  # the one is either of two, the other a zip file
        assert _sniffed(tmp_path / f"ball{suffix}") == (suffix)
        assert f"stdin{suffix}" in pipe("info -", f"ball{suffix}").stdout
    else:
        assert "stdin.usdz" in pipe("info - --from usdz", "ball.usdz").stdout


@pytest.mark.parametrize("target", ["glb", "ply", "stl", "obj"])
@pytest.mark.parametrize("more", ["", "--verbose", "--quiet"])
def test_only_the_mesh_is_on_the_standard_output(pipe, tmp_path, target, more):
    pipe(f"convert ball.ply -o stdout.{target}")  # GLB files hold their names
    done = pipe(f"convert - -o - --to {target} {more}", "ball.ply")
    assert done.stdout_bytes == (tmp_path / f"stdout.{target}").read_bytes()
    assert ("faces" in done.stderr) == (more != "--quiet")


def test_the_output_has_the_format_of_the_input(pipe, tmp_path):
    assert pipe("convert - -", "ball.ply").stdout_bytes == (tmp_path / "ball.ply").read_bytes()
    low = pipe("simplify ball.ply -o - --faces 40 -q").stdout_bytes
    assert low.startswith(b"ply") and b"wrote" not in low
    pipe("unwrap ball.obj -o named.obj --quality fast")
    flat = pipe("unwrap - -o - --quality fast", "ball.obj").stdout
    vertices = (tmp_path / "named.obj").read_text().partition("\nv ")[2]
    assert flat.partition("\nv ")[2] == vertices != ""
    pipe("transform - -o moved.obj --scale 2", "ball.obj")
    assert (tmp_path / "moved.obj").exists()


def test_no_message_shows_the_folder_behind_a_stream(pipe):
    log = json.loads(pipe("check - --format sarif --fail-on never", "ball.stl").stdout)
    (place,) = {
        result["locations"][0]["physicalLocation"]["artifactLocation"]["uri"]
        for result in log["runs"][0]["results"]
    }
    assert place == "stdin.stl"
    assert pipe("info - --from obj", "ball.glb", 1).stderr.startswith("texbake: stdin.obj: ")


@pytest.mark.parametrize(("words", "file", "exit_code", "message"), [
    ("info -", None, 1, "standard input: it is empty; pipe a mesh into it"),
    ("info - ", "ball.usdz", 1, "standard input: the format is not clear; name it with --from"),
    ("info ball.ply --from ply", None, 2, "--from: this is only for -; the suffix of a file"),
    ("compare - -", "ball.ply", 2, "two meshes cannot both come from standard input"),
    ("bake - ball.obj -o d", "ball.ply", 2, "HIGH: - is not possible here; name a file"),
    ("make sphere -o -", None, 2, "--output: - is not possible here"),
    ("bake ball.ply ball.obj -o -", None, 2, "--output: - is not possible here"),
    ("unwrap ball.obj - -o d", "ball.obj", 2, "- is not possible together with other files"),
    ("unwrap ball.obj -o u.obj --seams -", "ball.obj", 2, "--seams: - is not possible here"),
    ("convert - -o - --to fbx", "ball.ply", 2, "'fbx' is not one of"),
])  # fmt: skip
def test_what_cannot_be(pipe, words, file, exit_code, message):
    done = pipe(words, file, exit_code)
    assert message in done.stderr and done.stdout == ""


def test_the_help_page_lists_the_exit_codes(pipe):
    text = pipe("--help").stdout
    assert all(code in text and meaning in text for code, meaning in EXIT_CODES.items())
