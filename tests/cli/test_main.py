"""What all commands share: help, exit codes, one line for each failure, signals."""

import errno
import os
import re
import shlex
import signal
import subprocess
from pathlib import Path

import click
import numpy as np
import pytest
from click.shell_completion import BashComplete
from click.testing import CliRunner
from texbake_cli.main import COMMANDS, texbake
from texbake_cli.messages import failures_as_one_line
from texbake_cli.signals import Terminated

import texbake as package
from texbake.errors import FileError, OptionError

CONTEXT = click.Context(texbake, info_name="texbake")


def examples_in(text):
    """The command lines below `Example:`."""
    return re.findall(r"^ +texbake (.+)$", text.partition("Example:")[2], re.MULTILINE)


def test_help_lists_every_command_with_its_purpose():
    result = CliRunner().invoke(texbake, ["--help"])
    assert result.exit_code == 0
    for name in COMMANDS:
        assert re.search(rf"^  {name} +\S.{{10}}", result.output, re.MULTILINE)
    assert "..." not in result.output.partition("Meshes:")[2]  # each fits its line
    (example,) = examples_in(result.output)
    assert shlex.split(example)[0] in COMMANDS


@pytest.mark.parametrize("name", COMMANDS)
def test_help_fits_a_terminal_and_has_examples_that_parse(name):
    command = texbake.get_command(CONTEXT, name)
    listed = click.Command(name, help=COMMANDS[name])
    assert command.get_short_help_str(200) == listed.get_short_help_str(200)
    result = CliRunner().invoke(texbake, [name, "--help"])
    assert result.exit_code == 0 and max(map(len, result.output.splitlines())) <= 100
    others = result.output.partition("--help-all describes:\n")[2].partition("\n\n")[0]
    assert re.findall(r"(?<!\S)-[^-]", others) == []
    examples = examples_in(result.output)
    assert examples
    for example in examples:
        words = shlex.split(example)
        assert words[0] == name
        command.make_context(name, words[1:])  # raises where it does not parse


def test_version(run):
    done = run("--version")
    assert (done.returncode, done.stdout) == (0, f"texbake, version {package.__version__}\n")


@pytest.mark.parametrize("words", [[], ["--allow-outside"], ["--max-triangles", "5"]])
def test_a_missing_command_is_wrong_usage_and_shows_the_help(words):
    result = CliRunner().invoke(texbake, words)
    assert result.exit_code == 2
    assert "Meshes:" in result.output


@pytest.mark.parametrize(("error", "exit_code", "line"), [
    (FileError("a.ply: there is no such file"), 1, "texbake: a.ply: there is no such file"),
    (FileError("two\n  lines"), 1, "texbake: two lines"),
    (OptionError("size: 0"), 2, "texbake: size: 0 (see: texbake --help)"),
    (click.UsageError("Choose from:\n\ta,\n\tb"), 2, "choose from: a, b (see: texbake"),
    (MemoryError(), 1, "texbake: out of memory; try a smaller mesh or image"),
    (OSError(errno.ENOMEM, "Cannot allocate memory"), 1, "texbake: out of memory; try"),
    (KeyboardInterrupt(), 130, "texbake: interrupted"),
    (Terminated(signal.SIGTERM), 143, "texbake: terminated"),
])  # fmt: skip
def test_failures_are_one_line(error, exit_code, line):
    with pytest.raises(click.ClickException) as caught, failures_as_one_line(CONTEXT):
        raise error
    assert caught.value.exit_code == exit_code
    assert line in caught.value.message
    assert "\n" not in caught.value.message


def test_out_of_memory_names_what_the_command_has():
    for name, ways in (
        ("bake", "--max-memory 2G, a smaller --size, fewer --samples, fewer --threads"),
        ("convert", "a smaller mesh"),
    ):
        context = click.Context(texbake, info_name="texbake")
        context.invoked_subcommand = name
        with pytest.raises(click.ClickException) as caught, failures_as_one_line(context):
            raise MemoryError
        assert caught.value.message.startswith(f"texbake: out of memory; try {ways}")


@pytest.mark.skipif(os.name == "nt", reason="a folder in use cannot be deleted there")
def test_a_deleted_current_folder_is_an_error_of_one_line(tmp_path, monkeypatch):
    folder = tmp_path / "deleted"
    folder.mkdir()
    monkeypatch.chdir(folder)
    folder.rmdir()
    result = CliRunner().invoke(texbake, ["make", "plane", "-o", "a.obj"])
    assert result.exit_code == 1
    assert result.output == ("texbake: the current folder was deleted; change to another folder\n")


def test_a_bug_keeps_its_traceback(run, tmp_path):
    (tmp_path / "sitecustomize.py").write_text(
        "import texbake.mesh.files as files\nfiles.read_mesh = lambda *args, **options: 1 / 0\n"
    )
    done = run("info a.ply", env={**os.environ, "PYTHONPATH": str(tmp_path)})
    assert done.returncode == 1
    assert "ZeroDivisionError" in done.stderr and "Traceback" in done.stderr


def test_the_reader_of_a_pipe_may_leave(script):
    # The pipe's reading end is closed before anything is written.
    read_end, write_end = os.pipe()
    os.close(read_end)
    done = subprocess.run(
        [script, "--help"], stdout=write_end, stderr=subprocess.PIPE, text=True, timeout=60
    )
    os.close(write_end)
    assert done.stderr == ""


@pytest.mark.parametrize(("words", "expected"), [
    ("texbake bake",
     {"bake", "bake-normals", "bake-displacement", "bake-lightmap", "bake-texture"}),
    ("texbake info sc", {"scan.ply", "scans/"}),
    ("texbake bake a b --maps normal,dis", {"normal,displacement"}),
    ("texbake bake-texture a --camera sc", {"scan.ply", "scan.txt", "scans/"}),
    ("texbake bake-normals a b --space ", {"tangent", "object", "world"}),
])  # fmt: skip
def test_the_shell_completes(script, tmp_path, monkeypatch, words, expected):
    monkeypatch.chdir(tmp_path)
    for name in "scan.ply", "scan.txt":
        Path(name).touch()
    Path("scans").mkdir()
    _, *before, start = words.split(" ")
    shell = BashComplete(texbake, {}, "texbake", "_TEXBAKE_COMPLETE")
    assert {item.value for item in shell.get_completions(before, start)} == expected
    if before:
        return
    environment = {
        **os.environ, "_TEXBAKE_COMPLETE": "bash_complete", "COMP_WORDS": words, "COMP_CWORD": "1",
    }  # fmt: skip
    done = subprocess.run([script], capture_output=True, text=True, env=environment, timeout=60)
    assert {line.partition(",")[2] for line in done.stdout.splitlines()} == expected


def test_a_process_that_read_an_image_says_nothing_at_its_end(run, tmp_path):
    # OpenImageIO reports objects that Python never frees.
    package.write_image(np.zeros((8, 8)), tmp_path / "height.png", color=False)
    done = run("height-to-normal height.png -o slopes.png", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
