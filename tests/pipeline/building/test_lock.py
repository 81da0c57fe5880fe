"""One build at a time in a folder."""

import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import pytest

from texbake import FileError
from texbake.pipeline.building.build import build
from texbake.pipeline.building.lock import locked
from texbake.pipeline.building.options import BuildOptions


def test_a_second_build_is_told_who_is_there(write: Any, inline: Any) -> None:
    path = write()
    inside = path.parent / "build" / ".texbake"
    inside.mkdir(parents=True)
    with (
        locked(inside / "lock"),
        pytest.raises(FileError, match=r"build: another build works here \(process \d+ on \S+\)"),
    ):
        build(path, BuildOptions(wait=False), workers=inline())
    assert build(path, BuildOptions(wait=False), workers=inline()).ok


def test_it_waits_until_the_lock_is_let_go(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    path = tmp_path / "in" / "lock"
    told: list[str] = []
    order: list[str] = []

    def second() -> None:
        with locked(path, told=told.append):
            order.append("second")

    with locked(path):
        thread = threading.Thread(target=second)
        thread.start()
        while not told:
            time.sleep(0.01)
        order.append("first")
    thread.join()
    assert order == ["first", "second"]
    assert len(told) == 1 and told[0].endswith("waiting for it")


def test_a_killed_holder_holds_nothing(tmp_path: Path) -> None:
    code = (
        "import sys, time\nfrom pathlib import Path\n"
        "from texbake.pipeline.building.lock import locked\n"
        "with locked(Path(sys.argv[1])):\n    print('held', flush=True)\n    time.sleep(60)\n"
    )
    (tmp_path / "in").mkdir()
    path = tmp_path / "in" / "lock"
    with subprocess.Popen(
        [sys.executable, "-c", code, str(path)], stdout=subprocess.PIPE
    ) as process:
        assert process.stdout is not None and process.stdout.readline() == b"held\n"
        with pytest.raises(FileError), locked(path, wait=False):
            pass
        process.kill()
        process.wait()
        with locked(path, wait=False):
            pass
