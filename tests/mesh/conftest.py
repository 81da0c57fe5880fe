"""Read USD files, Draco and other formats of libraries in this process."""

from types import SimpleNamespace

import pytest

from texbake.child import Child
from texbake.mesh.files import read_mesh, reader_process
from texbake.messages import pack, unpack


class Here(Child):
    """A child that answers in this process, with the same messages."""

    def ask(self, request, *, classes):
        return unpack(b"".join(pack(reader_process.answer_request(request))), classes)


@pytest.fixture(autouse=True)
def readers_here(request, monkeypatch):
    """Save a second per file, but in tests of the other process; `monkeypatch.undo()` undoes it."""
    if request.path.name == "test_reader_process.py":
        return
    limits = SimpleNamespace(start=lambda: None, allow=lambda n_bytes: None)
    monkeypatch.setattr(reader_process, "LIMITS", limits)
    monkeypatch.setattr(reader_process, "Child", Here)


@pytest.fixture
def read(request, tmp_path):
    """Read text or bytes as a file of the format that the module of the test is named after."""

    def read(content):
        path = tmp_path / f"mesh.{request.path.stem.removeprefix('test_')}"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return read_mesh(path)

    return read
