"""What every command does alike: outputs are checked, reported and listed."""

import json
import shlex
import shutil
from dataclasses import fields
from pathlib import Path
from typing import get_origin

import click
import pytest
from click.testing import CliRunner
from texbake_cli.main import COMMANDS, texbake
from writing_commands import LINES, contents, make_inputs

from texbake import write_mesh
from texbake.baking.texture.options import PhotoOptions, SolidOptions
from texbake.mesh.shapes import uv_sphere
from texbake.schema import option_fields
from texbake.verbs.verb import Options, Reads, Writes, find_verb

VERBS = {name: verb for name in COMMANDS if (verb := find_verb(name)) is not None}
CONTEXT = click.Context(texbake)


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("inputs")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        write_mesh(uv_sphere(12, 24).replace(uvs=None, uv_faces=None), "high.ply")
        write_mesh(uv_sphere(8, 12), "low.obj")
        make_inputs(folder)
    return folder


@pytest.fixture
def run(inputs, tmp_path, monkeypatch, small_pictures):
    folder = tmp_path / "here"
    shutil.copytree(inputs, folder)
    monkeypatch.chdir(folder)

    def run(words):
        return CliRunner().invoke(texbake, words, standalone_mode=True)

    return run


def prepared(name, run):
    """Run what comes before the line of a command; return the words of the line."""
    *before, line = LINES[name]
    for earlier in before:
        assert run(shlex.split(earlier)).exit_code == 0
    return [word for word in shlex.split(line) if word != "--report" and word != "r.json"]


def with_output(words, output):
    if "-o" not in words:
        return [*words[:-1], "-o", output]
    place = words.index("-o") + 1
    return [*words[:place], output, *words[place + 1 :]]


def values(name, words):
    command = texbake.get_command(click.Context(texbake), name)
    return command.make_context(name, words[1:]).params


def outputs_of(name):
    return VERBS[name].of_kind(Writes)


WRITING = [name for name in VERBS if any(part.name == "output" for part in outputs_of(name))]


@pytest.mark.parametrize("name", VERBS)
def test_a_verb_takes_every_file_that_it_declares(name):
    verb = VERBS[name]
    parts = [part.name for part in (*verb.of_kind(Reads), *verb.of_kind(Writes))]
    options = {item.name for part in verb.of_kind(Options) for item in fields(part.kind)}
    assert [part for part in parts if not verb.takes(part) and part not in options] == []


# Of these, only the main file or the folder is listed; the others are neither verbs nor quick.
FOLDERS = {"preview"}
NO_VERBS = {"bench", "build", "study", "watch"}


@pytest.mark.parametrize("name", sorted(LINES.keys() - NO_VERBS))
def test_a_command_lists_all_files_that_it_writes(name, run):
    words = prepared(name, run)
    parts = VERBS[words[0]].of_kind(Writes) if words[0] in VERBS else ()
    reports = any(part.kind == "report" for part in parts)
    before = contents(Path())
    done = run([*words, "--verbose", *(["--report", "figures.json"] if reports else [])])
    assert done.exit_code == 0, done.output
    wrote = {row.removeprefix("wrote ") for row in done.stdout.splitlines() if row[:6] == "wrote "}
    after = contents(Path())
    assert name in FOLDERS or {file for file in after if after[file] != before.get(file)} == wrote
    assert before.keys() <= after.keys()
    assert "Stages\n" in done.stdout and "  total" in done.stdout.splitlines()[-1]
    assert not reports or json.loads(Path("figures.json").read_text())


@pytest.mark.parametrize("name", WRITING)
def test_no_output_replaces_an_input_or_another_output(name, run):
    verb, words = VERBS[name], prepared(name, run)
    given, (over,) = values(name, words), [p.over for p in outputs_of(name) if p.name == "output"]
    read = [
        str(given[part.name])
        for part in verb.of_kind(Reads)
        if isinstance(given.get(part.name), Path) and part.name != over
    ]
    before = contents(Path())
    for path in read:
        done = run(with_output(words, path))
        assert done.exit_code in (1, 2) and len(done.stderr.splitlines()) == 1, done.stderr
    if any(part.kind == "report" for part in verb.of_kind(Writes)):
        same = str(given["output"])
        done = run([*words, "--report", same])
        assert done.exit_code == 2 and "two outputs have this name" in done.stderr
    assert contents(Path()) == before


@pytest.mark.parametrize("name", [name for name in VERBS if outputs_of(name)])
def test_an_output_that_cannot_be_written_is_one_line(name, run):
    words = prepared(name, run)
    before = contents(Path())
    for part in outputs_of(name):
        suffix = "" if part.kind == "folder" else ".png"
        if part.name == "output":
            suffix = Path(str(values(name, words)["output"])).suffix
            line = with_output(words, f"low.obj/inside{suffix}")
        else:
            suffix = {"page": ".html", "report": ".json", "hits": ".npz"}.get(part.kind, suffix)
            line = [*words, f"--{part.name.replace('_', '-')}", f"low.obj/inside{suffix}"]
        done = run(line)
        assert done.exit_code == 1 and done.stdout == "", done.output
        (said,) = done.stderr.splitlines()
        assert said.startswith("texbake: low.obj/inside")
        assert contents(Path()) == before


def wrong_values(item):
    option = item.option
    if option.choices and not any(kind in (str, float, int) for kind in item.kinds[1:]):
        yield "nonsense"
    ends = (option.low, -1), (option.above, 0), (option.below, 0), (option.high, 1)
    yield from (f"{end + step:g}" for end, step in ends if end is not None)


# Option classes that are not read: a procedure has no photographs, and photographs no procedure.
UNREAD = {"bake-texture": PhotoOptions, "bake-texture photos": SolidOptions}


@pytest.mark.parametrize("name", [*sorted(VERBS.keys() & LINES.keys()), "bake-texture photos"])
def test_a_value_out_of_its_range_or_choices_is_wrong_usage(name, run):
    words = prepared(name, run)
    params = {param.name: param for param in texbake.get_command(CONTEXT, words[0]).params}
    for part in VERBS[words[0]].of_kind(Options):
        if part.kind is UNREAD.get(name):
            continue
        for item in option_fields(part.kind):
            param = params.get(item.name)
            if param is None or param.is_flag or any(map(get_origin, item.kinds)):
                continue
            for value in wrong_values(item):
                result = run([*words, param.opts[0], value])
                assert (result.exit_code, result.stdout) == (2, ""), (param.opts, value)
                (line,) = result.stderr.splitlines()
                assert param.opts[0] in line
