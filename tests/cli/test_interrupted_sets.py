"""The files of a command appear together: one that is interrupted keeps all of the older ones."""

import os
from collections.abc import Callable
from pathlib import Path

import click
import pytest
from click.testing import CliRunner, Result
from texbake_cli.lazy import COMMANDS
from texbake_cli.main import texbake
from writing_commands import LINES, READING, contents, make_inputs

Invoke = Callable[..., Result]

# Their files are made of one another or written in one call; both take long.
BUILDS = {"build", "watch"}
MEASURES = {"bench", "study"}
ONE_FILE = {
    "bake-displacement", "cage", "height-to-normal", "make", "normal-to-height", "pack-channels",
    "repair", "schema", "transform",
}  # fmt: skip


def test_every_command_that_writes_has_a_line() -> None:
    assert {lines[-1].split()[0] for lines in LINES.values()} == COMMANDS.keys() - READING
    for name in READING:
        command = texbake.get_command(click.Context(texbake), name)
        assert command is not None and not {"output", "report"} & {p.name for p in command.params}


@pytest.mark.parametrize("name", sorted(LINES.keys() - BUILDS - MEASURES - ONE_FILE))
def test_an_interrupted_command_keeps_the_older_files(
    name: str, workplace: Path, invoke: Invoke, monkeypatch: pytest.MonkeyPatch
) -> None:
    make_inputs(workplace)
    *before, line = LINES[name]
    for prepare in before:
        invoke(prepare)
    inputs = contents(workplace)
    opened = os.open
    made: list[str] = []
    last = 0

    def open_file(path: str, flags: int, *rest: int) -> int:
        if flags & os.O_EXCL and Path(path).parent.is_relative_to(workplace):
            made.append(path)
            if len(made) == last:
                raise KeyboardInterrupt
        return opened(path, flags, *rest)

    monkeypatch.setattr("texbake.files.os.open", open_file)
    invoke(line)
    last = len(made)
    for file in sorted(contents(workplace).keys() - inputs.keys()):
        (workplace / file).write_bytes(b"older")
    older = contents(workplace)
    assert sum(content == b"older" for content in older.values()) > 1
    made.clear()
    stopped = CliRunner().invoke(texbake, line.split())
    assert stopped.exit_code != 0 and len(made) == last
    assert contents(workplace) == older
