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
from texbake.building.locations import locked
from texbake.building.options import BuildOptions
from texbake.building.store import Store


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
        "from texbake.building.locations import locked\n"
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


@pytest.mark.skipif(sys.platform == "win32", reason="locks by fcntl")
def test_a_file_system_without_locks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(descriptor: int, how: int) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr("fcntl.flock", refuse)
    message = "cannot be locked: No locks available; give a `folder`"
    with pytest.raises(FileError, match=message), locked(tmp_path / "lock"):
        pass


def test_folders_of_steps_are_removed_once_nobody_works_in_them(tmp_path: Path) -> None:
    store = Store(str(tmp_path))
    with store.folder() as ours:
        for name, days in (("new", 6), ("old", 8)):  # of other machines
            (ours.parent / name / "in").mkdir(parents=True)
            then = time.time() - 86_400 * days
            os.utime(ours.parent / name, (then, then))
        store.clean()
        assert set(ours.parent.iterdir()) == {ours, ours.parent / "new"}
    assert not ours.exists()
