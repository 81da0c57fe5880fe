"""Folders and URLs, by the same predicates, and one build at a time in a folder."""

import errno
import os
import sys
import threading
import time
from pathlib import Path

import pytest

from texbake import BuildOptions, FileError, build, write_mesh
from texbake.building.locations import location_of, locked, matches
from texbake.building.store import Store
from texbake.mesh.shapes import uv_sphere


@pytest.fixture(params=["path", "file", "memory"])
def place(request, tmp_path):
    if request.param == "path":
        return str(tmp_path / "there")
    fsspec = pytest.importorskip("fsspec", reason="the extra `dask` is not installed")
    if request.param == "memory":
        fsspec.filesystem("memory").store.clear()
        return "memory://there"
    return f"file://{tmp_path}/there"


def test_files_come_back_as_they_were_put(place, tmp_path):
    location = location_of(place)
    source = tmp_path / "source"
    source.write_bytes(b"one")
    assert location.read("a/b") is None and location.signature("a/b") is None
    location.put(source, "a/b")
    before = location.signature("a/b")
    assert location.read("a/b") == b"one" and before is not None
    assert location.signature("a/b") == before
    source.write_bytes(b"two, longer")
    location.put(source, "a/b")
    assert location.read("a/b") == b"two, longer"
    assert location.signature("a/b") != before
    assert location.fetch("a/b", tmp_path).read_bytes() == b"two, longer"


def test_folders_are_moved_whole_and_removed(place, tmp_path):
    location = location_of(place)
    for number in range(2):  # the second finds the first there
        folder = tmp_path / f"folder{number}"
        (folder / "in").mkdir(parents=True)
        (folder / "in" / "x").write_bytes(b"x")
        (folder / "last").write_bytes(b"last")
        location.put_folder(folder, "ab/abc", "last")
        assert not folder.exists()
    assert location.read("ab/abc/in/x") == b"x"
    location.remove("ab/abc")
    location.remove("ab/abc")
    assert location.read("ab/abc/in/x") is None


def test_everything_behind_urls(write, run, tmp_path):
    fsspec = pytest.importorskip("fsspec", reason="the extra `dask` is not installed")
    memory = fsspec.filesystem("memory")
    memory.store.clear()
    for rings, name in enumerate(["a b", "c"], 4):
        write_mesh(uv_sphere(rings, 8), tmp_path / "mesh.ply")
        memory.put_file(str(tmp_path / "mesh.ply"), f"/scans/{name}.ply")
    head = 'store = "memory://store"\noutputs = "memory://out"\n'
    steps = """
[steps.clean]
do = "repair"
mesh = "high"
output = "{asset}/{asset}.{ext}"
[steps.look]
do = "preview"
mesh = "clean"
width = 32
height = 32
[steps.mips]
do = "mipmap"
image = "look"
output = "{asset}/mips"
"""
    path = write('[[assets]]\ninputs.high = "memory://scans/*.ply"\n', steps, head)
    result, ran = run(path)
    assert result.ok, result.failed
    assert len(ran) == 6
    names = memory.find("/out")
    assert "/out/a b/a b.ply" in names and "/out/c/mips/preview_5.png" in names
    assert run(path)[1] == []
    memory.rm_file("/out/c/c.ply")
    memory.pipe_file("/scans/c.ply", b"ply\nbroken\n")
    result, ran = run(path)
    assert ran == ["c.clean"] and len(result.failed) == 1


def test_locations_that_cannot_be_opened(tmp_path):
    pytest.importorskip("fsspec", reason="the extra `dask` is not installed")
    with pytest.raises(FileError, match="nowhere://x: cannot be reached"):
        location_of("nowhere://x")
    (tmp_path / "file").write_text("")
    with pytest.raises(FileError, match="cannot be made: Not a directory"):
        location_of(tmp_path / "file").put(tmp_path / "file", "a/b")


def test_patterns(tmp_path):
    for name in "a.ply", "b.ply", "[c].ply", "d.txt":
        (tmp_path / name).write_text("")
    (tmp_path / "e.ply").mkdir()
    assert [Path(name).name for name in matches("*.ply", tmp_path)] == ["[c].ply", "a.ply", "b.ply"]
    assert [Path(name).name for name in matches("[c].ply", tmp_path)] == ["[c].ply"]
    assert matches("*.obj", tmp_path) == []
    inside = tmp_path / "a[1]"
    (inside / "deep").mkdir(parents=True)
    for name in "x.ply", "deep/y.ply":
        (inside / name).write_text("")
    assert matches("*.ply", inside) == [f"{inside}/x.ply"]
    assert matches("**/*.ply", inside) == [f"{inside}/deep/y.ply", f"{inside}/x.ply"]
    assert matches("../*.txt", inside) == [f"{inside}/../d.txt"]
    assert matches(str(tmp_path / "*.txt"), inside) == [str(tmp_path / "d.txt")]


def test_errors_of_a_file_system_of_its_own_kind(monkeypatch):
    memory = pytest.importorskip("fsspec", reason="fsspec is not installed").filesystem("memory")

    class ClientError(Exception):
        """As botocore has it."""

    def refuse(*arguments, **more):
        raise ClientError("Access\nDenied")

    location = location_of("memory://there")
    monkeypatch.setattr(type(memory), "cat_file", refuse)
    with pytest.raises(FileError, match=r"memory://there/a: .* ClientError: Access Denied;"):
        location.read("a")
    monkeypatch.setattr(type(memory), "glob", refuse)
    with pytest.raises(FileError, match="ClientError"):
        matches("memory://there/*", Path())


def test_a_second_build_learns_who_holds_the_lock(write, inline):
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


def test_it_waits_until_the_lock_is_let_go(tmp_path):
    (tmp_path / "in").mkdir()
    path = tmp_path / "in" / "lock"
    notes = []
    order = []

    def second():
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


@pytest.mark.skipif(sys.platform == "win32", reason="locks by fcntl")
def test_a_file_system_without_locks(tmp_path, monkeypatch):
    def refuse(descriptor, how):
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr("fcntl.flock", refuse)
    message = "cannot be locked: No locks available; give a `folder`"
    with pytest.raises(FileError, match=message), locked(tmp_path / "lock"):
        pass


def test_folders_of_steps_are_removed_once_nobody_works_in_them(tmp_path):
    store = Store(str(tmp_path))
    with store.folder() as ours:
        for name, days in (("new", 6), ("old", 8)):  # of other machines
            (ours.parent / name / "in").mkdir(parents=True)
            then = time.time() - 86_400 * days
            os.utime(ours.parent / name, (then, then))
        store.clean()
        assert set(ours.parent.iterdir()) == {ours, ours.parent / "new"}
    assert not ours.exists()
