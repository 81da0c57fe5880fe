"""Commands that are stopped: files are old or new, none is partial, and there is one line."""

import os
import random
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import click
import pytest
from click.testing import CliRunner
from texbake_cli.main import COMMANDS, texbake
from writing_commands import LINES, READING, contents, make_inputs

N_KILLS = int(os.environ.get("TEXBAKE_KILLS", "4"))
# What SIGKILL leaves behind, a later command removes: it comes last, before one that ends.
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGKILL)

# Their files are made of one another, or they are a `run`; all take long.
BUILDS = {"build", "watch"}
MEASURES = {"bench", "study", "demo"}
ONE_FILE = {
    "bake-displacement", "cage", "height-to-normal", "make", "normal-to-height", "pack-channels",
    "repair", "schema", "transform",
}  # fmt: skip


def test_every_command_that_writes_has_a_line():
    assert {lines[-1].split()[0] for lines in LINES.values()} == COMMANDS.keys() - READING
    for name in READING:
        command = texbake.get_command(click.Context(texbake), name)
        assert command is not None and not {"output", "report"} & {p.name for p in command.params}


@pytest.mark.parametrize("name", sorted(LINES.keys() - BUILDS - MEASURES))
def test_a_command_is_quiet_and_keeps_the_older_files_when_it_is_interrupted(
    name, workplace, invoke, monkeypatch, small_pictures
):
    make_inputs(workplace)
    *before, line = LINES[name]
    for prepare in before:
        invoke(prepare)
    inputs = contents(workplace)
    opened = os.open
    made: list[str] = []
    last = 0

    def open_file(path, flags, *rest):
        if flags & os.O_EXCL and Path(path).parent.is_relative_to(workplace):
            made.append(path)
            if len(made) == last:
                raise KeyboardInterrupt
        return opened(path, flags, *rest)

    monkeypatch.setattr("texbake.files.os.open", open_file)
    done = invoke(f"{line} --quiet")
    assert done.stdout == "" or name == "check"
    assert all(said.startswith("texbake: warning: ") for said in done.stderr.splitlines())
    last = len(made)
    for file in sorted(contents(workplace).keys() - inputs.keys()):
        (workplace / file).write_bytes(b"older")
    older = contents(workplace)
    assert sum(content == b"older" for content in older.values()) > (name not in ONE_FILE)
    made.clear()
    stopped = CliRunner().invoke(texbake, line.split())
    assert stopped.exit_code != 0 and len(made) == last
    assert contents(workplace) == older


def start(script, line, scratch):
    return subprocess.Popen(
        [script, *line.split(), "--quiet"], env={**os.environ, "TMPDIR": str(scratch)},
        stderr=subprocess.DEVNULL, start_new_session=True,
    )  # fmt: skip


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such signals")
@pytest.mark.parametrize("name", ["split-channels", "unwrap several"])
def test_killed_commands(name, workplace, script, tmp_path_factory):
    """`TEXBAKE_KILLS=100` kills each command that often."""
    make_inputs(workplace)
    inputs = contents(workplace)
    (line,) = LINES[name]
    scratch = tmp_path_factory.mktemp("scratch")
    began = time.monotonic()
    assert start(script, line, scratch).wait() == 0
    seconds = time.monotonic() - began
    new = contents(workplace)
    old = {**dict.fromkeys(new, b"older"), **inputs}
    luck = random.Random(16)
    for kill in range(N_KILLS):
        for file in new.keys() - inputs.keys():
            (workplace / file).write_bytes(b"older")
        process = start(script, line, scratch)
        time.sleep(luck.uniform(0.2, 1.0) * seconds)
        number = SIGNALS[kill * len(SIGNALS) // N_KILLS]
        process.send_signal(number)
        code = process.wait(timeout=60)
        found = contents(workplace)
        if code == 0:  # it was over before
            assert found == new
        elif number == signal.SIGKILL:
            assert all(found[file] in (old[file], new[file]) for file in new)
        else:
            assert found == old and not list(scratch.iterdir())
    assert start(script, line, scratch).wait() == 0
    assert contents(workplace) == new
    assert not list(scratch.iterdir())


def names_in(folder):
    """All names, including hidden ones such as those of half-written files."""
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize("line", [
    "unwrap low.obj -o there.glb --layout there.png",
    "bake-texture low.obj -o there.tif --procedure noise",
])  # fmt: skip
def test_a_full_disk_loses_nothing(workplace, run, line):
    def fill_the_disk():
        # A file may not grow past 4 KiB, as on a full disk.
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))

    # Once without the limit, so that no kernel is left to be compiled, and its code to be cached.
    assert run(line).returncode == 0
    name = line.split("-o ")[1].split()[0]
    Path(name).write_bytes(b"what was there")
    before = names_in(workplace)
    done = run(line, preexec_fn=fill_the_disk)
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1, done.stderr
    assert f"{name}: cannot be written" in done.stderr
    assert Path(name).read_bytes() == b"what was there"
    assert names_in(workplace) == before


@pytest.mark.parametrize("line", ["info low.obj", "bake --help"])
def test_what_cannot_be_printed(workplace, script, line):
    words = [script, *line.split()]
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(words, stdout=full, stderr=subprocess.PIPE, text=True, timeout=60)
    assert done.returncode == 1
    (said,) = done.stderr.splitlines()
    assert said == "texbake: standard output: cannot be written: No space left on device"
