"""One build at a time in a folder."""

import errno
import os
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import pytest

from texbake import FileError
from texbake.building.build import build
from texbake.building.disk import clear, locked, owned_folder
from texbake.building.options import BuildOptions


def test_a_second_build_learns_who_holds_the_lock(write: Any, inline: Any) -> None:
    path = write()
    inside = path.parent / "build" / ".texbake"
    inside.mkdir(parents=True)
    with (
        locked(inside / "lock"),
        pytest.raises(
            FileError,
            match=r"build: another build is running in this folder \(process \d+ on \S+\)",
        ),
    ):
        build(path, BuildOptions(wait=False), workers=inline())
    assert build(path, BuildOptions(wait=False), workers=inline()).ok


def test_it_waits_until_the_lock_is_let_go(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    path = tmp_path / "in" / "lock"
    notes: list[str] = []
    order: list[str] = []

    def second() -> None:
        with locked(path, note=notes.append):
            order.append("second")

    with locked(path):
        thread = threading.Thread(target=second)
        thread.start()
        while not notes:
            time.sleep(0.01)
        order.append("first")
    thread.join()
    assert order == ["first", "second"]
    assert len(notes) == 1 and notes[0].endswith("waiting for it")


def test_a_killed_holder_holds_nothing(tmp_path: Path) -> None:
    code = (
        "import sys, time\nfrom pathlib import Path\n"
        "from texbake.building.disk import clear, locked, owned_folder\n"
        "with locked(Path(sys.argv[1])):\n    print('held', flush=True)\n    time.sleep(60)\n"
    )
    (tmp_path / "in").mkdir()
    path = tmp_path / "in" / "lock"
    with subprocess.Popen(
        [sys.executable, "-P", "-c", code, str(path)], stdout=subprocess.PIPE
    ) as process:
        assert process.stdout is not None and process.stdout.readline() == b"held\n"
        with pytest.raises(FileError), locked(path, wait=False):
            pass
        process.kill()
        process.wait()
        with locked(path, wait=False):
            pass


def test_folders_are_cleared_when_their_owners_are_dead(tmp_path: Path) -> None:
    program = (
        "import sys, time; from pathlib import Path\n"
        "from texbake.building.disk import owned_folder\n"
        "with owned_folder(Path(sys.argv[1])) as folder:\n"
        "    (folder / 'file').write_text('x'); print(folder, flush=True); time.sleep(60)\n"
    )
    parent = tmp_path / "tmp"
    with subprocess.Popen(
        [sys.executable, "-P", "-c", program, str(parent)], stdout=subprocess.PIPE, text=True
    ) as other:
        assert other.stdout is not None
        theirs = Path(other.stdout.readline().strip())
        (parent / "older").mkdir()  # without a lock
        with owned_folder(parent) as ours:
            clear(parent)
            assert {path for path in parent.iterdir() if path.is_dir()} == {ours, theirs}
            assert (theirs / "file").exists()
            other.kill()
            other.wait()
            clear(parent)
            assert {path for path in parent.iterdir() if path.is_dir()} == {ours}
    assert list(parent.iterdir()) == []
    clear(tmp_path / "nothing")


def test_many_make_folders_while_others_clear(tmp_path: Path) -> None:
    stop = threading.Event()

    def clears() -> None:
        while not stop.is_set():
            clear(tmp_path)

    cleaners = [threading.Thread(target=clears) for _ in range(3)]
    for thread in cleaners:
        thread.start()
    try:
        for _ in range(60):
            with owned_folder(tmp_path) as folder:
                (folder / "file").write_text("x")
                assert (folder / "file").exists()
    finally:
        stop.set()
        for thread in cleaners:
            thread.join()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(sys.platform == "win32", reason="locks by fcntl")
def test_a_file_system_without_locks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(descriptor: int, how: int) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr("fcntl.flock", refuse)
    message = "cannot be locked: No locks available; give a `folder`"
    with pytest.raises(FileError, match=message), locked(tmp_path / "lock"):
        pass
    with owned_folder(tmp_path / "tmp") as folder:
        clear(tmp_path / "tmp")
        assert folder.is_dir()
