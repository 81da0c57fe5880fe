"""Temporary files of killed processes are cleared away; those of living ones stay."""

import os
import subprocess
import sys

import pytest

from texbake import unfinished
from texbake.files import appearing_together, make_folder, new_scratch_folder, replacing

KILLED = """
import os, sys
from pathlib import Path
from texbake.files import appearing_together, new_scratch_folder, replacing

with appearing_together():
    for name in "map.png", "mesh.obj":
        with replacing(Path(sys.argv[1]) / name) as temporary:
            temporary.write_bytes(b"whole")
    (new_scratch_folder() / "copy.bin").write_bytes(b"copy")
    if sys.argv[2] == "wait":
        print("ready", flush=True)
        sys.stdin.read()
    os._exit(1)
"""


@pytest.fixture
def scratch(tmp_path, monkeypatch):
    """A folder that temporary folders of this process and of its children are in."""
    folder = tmp_path / "scratch"
    folder.mkdir()
    monkeypatch.setenv("TMPDIR", str(folder))
    monkeypatch.setattr("tempfile.tempdir", None)
    return folder


def start(folder, how):
    pipe = subprocess.PIPE
    return subprocess.Popen(
        [sys.executable, "-P", "-c", KILLED, str(folder), how], stdin=pipe, stdout=pipe
    )


def write(folder):
    unfinished._LOOKED_THROUGH.clear()
    with replacing(folder / "other.png") as temporary:
        temporary.write_bytes(b"other")
    new_scratch_folder().rmdir()


@pytest.mark.skipif(sys.platform != "linux", reason="which processes live is read in /proc")
def test_what_a_killed_process_left_is_cleared(tmp_path, scratch):
    outputs = tmp_path / "outputs"
    outputs.mkdir()
    (outputs / "map.png").write_bytes(b"older")
    with start(outputs, "end") as killed:
        assert killed.wait() == 1
    assert len(list(outputs.iterdir())) == 3 and len(list(scratch.iterdir())) == 1
    write(outputs)
    assert {file.name for file in outputs.iterdir()} == {"map.png", "other.png"}
    assert (outputs / "map.png").read_bytes() == b"older"
    assert not list(scratch.iterdir())


def test_what_a_living_process_writes_stays(tmp_path, scratch):
    outputs = tmp_path / "outputs"
    outputs.mkdir()
    with start(outputs, "wait") as living:
        assert living.stdout.readline() == b"ready\n"
        before = {*outputs.iterdir(), *scratch.iterdir()}
        assert len(before) == 3
        write(outputs)
        assert {*outputs.iterdir(), *scratch.iterdir()} == before | {outputs / "other.png"}
        living.stdin.close()


def test_what_another_machine_left_stays(tmp_path):
    ended = subprocess.Popen([sys.executable, "-P", "-c", ""])
    ended.wait()
    name = unfinished.unfinished_name(tmp_path, ".png")
    machine = name.split("-")[1]
    others = [
        name.replace(f"-{machine}-", "-0123abcd-").replace(f"-{os.getpid()}-", f"-{ended.pid}-"),
        ".texbake-notes.png",
        "texbake-1",
    ]
    for other in others:
        (tmp_path / other).touch()
    write(tmp_path)
    assert {file.name for file in tmp_path.iterdir()} == {*others, "other.png"}


def test_folders_made_for_files_that_never_came_are_removed(tmp_path):
    (tmp_path / "there").mkdir()

    def write_into(stop):
        with appearing_together():
            for folder in "deep/er", "there":
                make_folder(tmp_path / folder)
            with replacing(tmp_path / "deep" / "er" / "map.png") as temporary:
                temporary.write_bytes(b"whole")
            if stop:
                raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_into(stop=True)
    assert [path.name for path in tmp_path.iterdir()] == ["there"]
    write_into(stop=False)
    assert (tmp_path / "deep" / "er" / "map.png").read_bytes() == b"whole"
