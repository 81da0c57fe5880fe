"""USD files are read in this process, where a process of its own is not the point."""

from types import SimpleNamespace

import pytest

from texbake.child import Child
from texbake.mesh.files import reader_child, reader_process
from texbake.messages import pack, unpack


class Here(Child):
    """A child that answers about USD files in this process, with the same messages."""

    def ask(self, request, *, classes):
        if request[0] == "trimesh":
            return super().ask(request, classes=classes)
        return unpack(b"".join(pack(reader_child.answer_request(request))), classes)


@pytest.fixture(autouse=True)
def readers_here(request, monkeypatch):
    """Half a second less for each reading; `monkeypatch.undo()` brings the process back."""
    if request.path.name == "test_reader_process.py":
        return
    limits = SimpleNamespace(start=lambda: None, allow=lambda n_bytes: None)
    monkeypatch.setattr(reader_child, "LIMITS", limits)
    monkeypatch.setattr(reader_process, "Child", Here)
