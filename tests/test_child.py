"""Child processes: how they answer and end, and what interrupts leave behind."""

import os
import subprocess
import sys
from collections.abc import Iterator
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


# A worker that runs the request as code, and answers with its process id.
EXEC_WORKER = """
import os, sys
from texbake.child import serve

out = os.dup(1)
serve(lambda request: (exec(request), os.getpid())[1])
"""


@pytest.fixture
def exec_child(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[child.Child]:
    (tmp_path / "exec_worker.py").write_text(EXEC_WORKER)
    monkeypatch.syspath_prepend(tmp_path)
    worker = child.Child("exec_worker")
    yield worker
    worker.end()


def test_a_process_answers_until_it_ends_and_is_then_replaced(exec_child: child.Child) -> None:
    first = exec_child.ask("")
    assert exec_child.ask("x = 1") == first
    garbage = "gave an invalid answer"
    for request, reason in (
        ("print('oh', file=sys.stderr); os._exit(7)", "crashed (exit code 7, oh)"),
        ("os.write(out, bytes(8) + b'abc')", garbage),
        ("os.write(out, bytes([255] * 100))", garbage),
    ):
        with pytest.raises(child.ChildError) as error:
            exec_child.ask(request)
        assert error.value.reason == reason
        assert exec_child.ask("") != first
    last = exec_child.ask("")
    exec_child.end()
    with pytest.raises(ProcessLookupError):
        os.kill(last, 0)
