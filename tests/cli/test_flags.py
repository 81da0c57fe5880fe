"""Messages of the library in the flags of a command."""

from pathlib import Path

import click
import pytest
from click.testing import CliRunner
from texbake_cli.flags import with_flags
from texbake_cli.main import texbake

from texbake import OptionError


def command(name: str) -> click.Command:
    found = texbake.get_command(click.Context(texbake), name)
    assert found is not None
    return found


@pytest.mark.parametrize(
    ("name", "message", "shown"),
    [
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
    ],
)  # fmt: skip
def test_parameters_become_flags(name: str, message: str, shown: str) -> None:
    assert with_flags(message, command(name)) == shown


def test_a_file_with_the_name_of_a_parameter_keeps_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("maps").mkdir()
    done = CliRunner().invoke(texbake, ["bake", "maps", "low.obj", "-o", "baked"])
    assert done.exit_code == 1
    assert done.stderr.startswith("texbake: maps: there is no mesh in it")


def test_without_a_command_a_message_stays() -> None:
    assert with_flags("size: 0; raise `size`") == "size: 0; raise `size`"


def test_an_option_error_knows_its_parameters() -> None:
    assert OptionError("size: 0 is out of range").parameters == ("size",)
    assert OptionError("a/b.ply: two outputs").parameters == ()
