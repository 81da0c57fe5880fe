"""Read USD files and Draco in this process, except in tests of the process that reads them."""

from types import SimpleNamespace

import pytest

from texbake.child import Child
from texbake.mesh.files import read_mesh, reader_process
from texbake.messages import pack, unpack


class Here(Child):
    """A child that answers in this process, but for trimesh, with the same messages."""

    def ask(self, request, *, classes):
        if request[0] == "trimesh":
            return super().ask(request, classes=classes)
        return unpack(b"".join(pack(reader_process.answer_request(request))), classes)


@pytest.fixture(autouse=True)
def readers_here(request, monkeypatch):
    """Save half a second per file; `monkeypatch.undo()` brings the other process back."""
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
