"""Child processes, and messages between them: what an interrupt or a bad request leaves behind."""

import os
import subprocess
import sys

import numpy as np
import pytest

from texbake import child
from texbake.mesh.mesh import UvSet
from texbake.mesh.shapes import cube
from texbake.messages import MessageError, pack, unpack

WORKERS = "texbake.building.workers"


def test_an_interrupt_while_a_process_starts_leaves_no_files(tmp_path, monkeypatch):
    def interrupted(*args, **more):
        assert list(tmp_path.iterdir())
        raise KeyboardInterrupt

    monkeypatch.setattr(child.tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(child.subprocess, "Popen", interrupted)
    with pytest.raises(KeyboardInterrupt):
        child.Child(WORKERS).ask("anything")
    assert not list(tmp_path.iterdir())


def test_a_request_that_cannot_be_read_ends_the_process():
    request = (16).to_bytes(8, "little") + b"\xff" * 16
    with subprocess.Popen(
        [sys.executable, "-P", "-m", WORKERS], stdin=subprocess.PIPE, stderr=subprocess.PIPE
    ) as process:
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
def exec_child(tmp_path, monkeypatch):
    (tmp_path / "exec_worker.py").write_text(EXEC_WORKER)
    monkeypatch.syspath_prepend(tmp_path)
    worker = child.Child("exec_worker")
    yield worker
    worker.end()


def test_a_process_answers_until_it_ends_and_is_then_replaced(exec_child):
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


def test_values_come_as_they_were_sent():
    mesh = cube()
    uvs = np.zeros((1, 2))
    mesh = mesh.replace(uv_sets={"second": UvSet(uvs=uvs, faces=np.zeros_like(mesh.faces))})
    image = b"image"
    value = ({1: None, "a": True}, (1, 0.1, "\udc80ä"), image, (image, b""), mesh, np.zeros((0, 3)))
    message = b"".join(pack(value))
    classes = {"Mesh": type(mesh), "UvSet": UvSet}
    found = unpack(message, classes)
    assert found[:4] == value[:4]
    assert found[3][0] is found[2]
    assert found[5].shape == (0, 3)
    for name in ("positions", "faces", "normals", "normal_faces"):
        ours, theirs = getattr(mesh, name), getattr(found[4], name)
        if ours is not None:
            assert np.array_equal(ours, theirs) and ours.dtype == theirs.dtype
            assert theirs.flags.aligned
    assert found[4].uv_sets["second"].uvs.tolist() == [[0.0, 0.0]]
    for length in range(0, len(message) - 16, 7):
        with pytest.raises(MessageError):
            unpack(message[:length], classes)
    with pytest.raises(MessageError, match="Mesh"):
        unpack(message, {})


@pytest.mark.parametrize(
    "text",
    [b'{"array": "O", "shape": [1]}', b'{"array": "<f8", "shape": [99999999999999]}',
     b'{"array": "<f8", "shape": [-1]}', b'{"bytes": -8}', b"{}", b"x"],
)  # fmt: skip
def test_other_messages_are_refused(text):
    with pytest.raises(MessageError):
        unpack(len(text).to_bytes(8, "little") + text, {})
