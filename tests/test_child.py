"""Child processes: what an interrupt and a bad request leave behind."""

import subprocess
import sys
from pathlib import Path

import pytest

from texbake import child

WORKERS = "texbake.building.workers"


def test_an_interrupt_while_a_process_starts_leaves_no_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*args: object, **more: object) -> None:
        assert list(tmp_path.iterdir())
        raise KeyboardInterrupt

    monkeypatch.setattr(child.tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(child.subprocess, "Popen", interrupted)
    with pytest.raises(KeyboardInterrupt):
        child.Child(WORKERS).ask("anything")
    assert not list(tmp_path.iterdir())


def test_a_request_that_cannot_be_read_ends_the_process() -> None:
    request = (16).to_bytes(8, "little") + b"\xff" * 16
    with subprocess.Popen(
        [sys.executable, "-P", "-m", WORKERS], stdin=subprocess.PIPE, stderr=subprocess.PIPE
    ) as process:
        assert process.stdin is not None
        process.stdin.write(request)
        process.stdin.flush()  # and stays open: the end of the pipe is not what ends it
        try:
            assert process.wait(60) == 1
        finally:
            process.kill()
