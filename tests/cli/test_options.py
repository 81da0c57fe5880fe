"""Options of the command line against those of the API."""

import dataclasses

import click
import pytest
from click.testing import CliRunner
from texbake_cli.main import texbake
from texbake_cli.options import IMAGE_SUFFIXES
from writing_commands import LINES

from texbake import BakeOptions, RenderOptions, RunOptions, UnwrapOptions, write_mesh
from texbake.jobs.options import DemoOptions
from texbake.mesh.shapes import cube
from texbake.texture.image_formats import check_image_format


def parsed(line):
    """Values of the options of a command, after its defaults."""
    name, *words = line.split()
    command = texbake.get_command(click.Context(texbake), name)
    return command.make_context(name, words).params


@pytest.mark.parametrize(("line", "options"), [
    ("bake-normals a b -o c.png", BakeOptions()),
    ("bake-displacement a b -o c.png", BakeOptions()),
    ("bake a b -o c", BakeOptions()),
    ("unwrap a -o b.obj", UnwrapOptions()),
    ("compare a b", RenderOptions()),
    ("run a -o b --faces 500", RunOptions()),
    ("demo", DemoOptions()),
])  # fmt: skip
def test_defaults_are_those_of_the_api(line, options):
    values = parsed(line)
    shared = [field.name for field in dataclasses.fields(options) if field.name in values]
    assert len(shared) >= 3
    if isinstance(options, RunOptions):  # None becomes what a preset would choose
        assert RunOptions(**{name: values[name] for name in shared}) == options
        return
    for name in shared:
        if isinstance(options, RenderOptions) and name == "size":
            continue
        assert values[name] == getattr(options, name), name


# Of these, the folder has a default.
DEFAULT = ("bench", "build", "demo", "study", "watch")
OUTPUTS = [line for *_, line in LINES.values() if " -o " in line and line.split()[0] not in DEFAULT]


@pytest.mark.parametrize("line", OUTPUTS)
def test_the_output_may_also_be_the_last_argument(line):
    words = line.split()
    place = words.index("-o")
    name = words.pop(place + 1)
    words.remove("-o")
    expected = parsed(line)
    # Before the options that follow it, and after all of them.
    for at in place, len(words):
        assert parsed(" ".join([*words[:at], name, *words[at:]])) == expected
    # Of these, one more name is one more input.
    if words[0] not in ("unwrap", "pack-textures"):
        with pytest.raises(click.UsageError, match=f"two outputs are named: {name} and other"):
            parsed(f"{line} other")


def test_an_input_is_not_taken_for_the_output(tmp_path):
    there = tmp_path / "b.obj"
    write_mesh(cube(), there)
    with pytest.raises(click.UsageError, match=r"b\.obj exists; name the output with -o"):
        parsed(f"unwrap a.obj {there}")
    with pytest.raises(click.UsageError, match="Missing parameter: output"):
        parsed("unwrap a.obj")


def test_a_preview_overrides_only_set_options_and_shows_all_defaults():
    names = ("size", "view", "up", "supersampling", "edges")
    assert {parsed("preview a -o b.png")[name] for name in names} == {None}
    assert parsed("preview a -o b.png --up z --size 8")["up"] == "z"
    options = RenderOptions()
    shown = " ".join(CliRunner().invoke(texbake, ["preview", "--help"]).output.split())
    view = ",".join(f"{angle:g}" for angle in options.view)
    size = f"{options.width}x{options.height}"
    for default in (size, view, options.up, options.supersampling, options.edges):
        assert f"[default: {default}]" in shown


@pytest.mark.parametrize("suffix", IMAGE_SUFFIXES)
def test_images_are_recognized_in_every_format_offered(suffix):
    assert check_image_format(f"a{suffix}") in (8, 16, 32)
