"""Files appear whole or not at all; folders of results."""

import errno
import os
import signal
import time
from contextlib import suppress
from pathlib import Path

import pytest

from texbake import FileError
from texbake.files import (
    appearing_together,
    check_folder,
    check_name,
    check_writable,
    is_file,
    is_folder,
    make_folder,
    remove_file,
    replacing,
    require_file,
    scratch_folder,
    write_files,
    written_file,
)


def test_a_folder_is_made_with_those_it_is_in(tmp_path):
    deep = tmp_path / "a" / "b"
    check_folder(deep)
    assert not (tmp_path / "a").exists()  # looking makes nothing
    assert make_folder(deep) == deep
    assert deep.is_dir()
    assert make_folder(deep) == deep  # it may be there


def test_a_file_is_no_folder(tmp_path):
    (tmp_path / "file").touch()
    for folder in tmp_path / "file", tmp_path / "file" / "below":
        with pytest.raises(FileError, match="is a file"):
            check_folder(folder)
        with pytest.raises(FileError, match="cannot be made"):
            make_folder(folder)


def test_a_folder_must_be_open_to_writing(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "access", lambda path, mode: False)  # an answer that root never gets
    with pytest.raises(FileError, match="cannot be written to"):
        check_folder(tmp_path / "a")


def test_a_file_appears_whole(tmp_path):
    target = tmp_path / "map.png"
    with replacing(target) as temporary:
        temporary.write_bytes(b"whole")
        assert temporary.suffix == ".png"
        assert temporary.parent == tmp_path
        assert not target.exists()
    assert target.read_bytes() == b"whole"
    assert [path.name for path in tmp_path.iterdir()] == ["map.png"]


def test_a_full_disk_is_one_clear_error(tmp_path):
    target = tmp_path / "map.png"
    target.write_bytes(b"before")

    def fill_the_disk():
        with replacing(target):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with pytest.raises(FileError, match=r"map\.png: cannot be written: No space left on device"):
        fill_the_disk()
    assert target.read_bytes() == b"before"


def test_permissions_and_links_stay(tmp_path):
    target, link = tmp_path / "real.png", tmp_path / "link.png"
    target.touch(mode=0o600)
    link.symlink_to(target)
    with replacing(link) as temporary:
        temporary.write_bytes(b"through the link")
    assert link.is_symlink()
    assert target.read_bytes() == b"through the link"
    assert target.stat().st_mode & 0o777 == 0o600


@pytest.mark.parametrize("name, why", [("", "it is a folder"), ("no/a.png", "there is no folder")])
def test_a_folder_that_cannot_be_written_is_refused_before_the_work(tmp_path, name, why):
    for look in (check_writable, lambda path: replacing(path).__enter__()):
        with pytest.raises(FileError, match=why):
            look(tmp_path / name)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
def test_a_pipe_or_a_device_is_not_replaced(tmp_path):
    pipe, link = tmp_path / "pipe.png", tmp_path / "link.png"
    os.mkfifo(pipe)
    link.symlink_to(pipe)
    for path in pipe, link:
        with pytest.raises(FileError, match="a device or a pipe"):
            check_writable(path)
        with pytest.raises(FileError, match="a device or a pipe"), replacing(path):
            pass
    assert pipe.is_fifo()
    assert sorted(tmp_path.iterdir()) == [link, pipe]


def test_links_in_a_circle_are_reported(tmp_path):
    link = tmp_path / "a.png"
    link.symlink_to(link)
    with pytest.raises(FileError, match="its links form a circle"):
        check_writable(link)
    assert link.is_symlink()


def test_files_appear_together(tmp_path):
    old, new = tmp_path / "old.txt", tmp_path / "new.txt"
    old.write_text("before")
    with appearing_together():
        for file in old, new, old:  # the last one counts
            with replacing(file) as temporary:
                temporary.write_text(f"{len(list(tmp_path.iterdir()))} files")
            assert old.read_text() == "before" and not new.exists()
            assert "files" in written_file(file).read_text()
    assert old.read_text() == "4 files" and new.read_text() == "3 files"
    assert {path.name for path in tmp_path.iterdir()} == {"old.txt", "new.txt"}
    assert written_file(new) == new


@pytest.mark.parametrize("stop", [ValueError, KeyboardInterrupt, SystemExit])
def test_an_interrupted_set_leaves_nothing_and_loses_nothing(tmp_path, stop):
    write_files(tmp_path, {"a": b"before", "b": b"before"})
    with pytest.raises(stop), appearing_together():
        write_files(tmp_path, {"a": b"after", "b": b"after", "c": b"after"})
        raise stop
    with pytest.raises(stop), replacing(tmp_path / "a") as temporary:
        temporary.write_bytes(b"af")
        raise stop
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {
        "a": b"before",
        "b": b"before",
    }


def test_files_in_scratch_folders_wait_for_no_others(tmp_path):
    with appearing_together(), scratch_folder() as folder:
        write_files(folder, {"a": b"there"})
        assert (folder / "a").read_bytes() == b"there"
        with replacing(tmp_path / "outer") as outer:
            write_files(outer.parent, {outer.name: b"whole"})  # by a writer that is atomic itself
            assert outer.read_bytes() == b"whole"
        assert not (tmp_path / "outer").exists()
    assert not folder.exists()
    assert (tmp_path / "outer").read_bytes() == b"whole"


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no timers on this system")
def test_a_signal_does_not_part_a_set(tmp_path, monkeypatch):
    # So that most time is moving.
    monkeypatch.setattr("texbake.files._write_to_disk", lambda path: None)
    names = [f"{number}" for number in range(40)]
    outcomes = set()
    before = signal.signal(signal.SIGALRM, signal.default_int_handler)
    try:
        for trial in range(12):
            write_files(tmp_path, dict.fromkeys(names, b"before"))
            with suppress(KeyboardInterrupt):
                with appearing_together():
                    write_files(tmp_path, dict.fromkeys(names, b"after"))
                    signal.setitimer(signal.ITIMER_REAL, 1e-6 + 1e-4 * trial)
                while True:  # until the signal has come
                    time.sleep(1.0)
            contents = [(tmp_path / name).read_bytes() for name in names]
            assert len(set(contents)) == 1
            outcomes.add(contents[0])
            assert len(list(tmp_path.iterdir())) == len(names)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    assert b"after" in outcomes


def test_content_is_on_the_disk_before_a_file_takes_its_name(tmp_path, monkeypatch):
    synchronized = []
    moved = []

    def fsync(descriptor):
        synchronized.append(Path(f"/proc/self/fd/{descriptor}").readlink())

    def move(source, target):
        assert Path(source) in synchronized
        moved.append(Path(target))
        rename(source, target)

    if not Path("/proc/self/fd").is_dir():
        pytest.skip("this system does not name the files of descriptors")
    rename = os.rename
    monkeypatch.setattr(os, "fsync", fsync)
    monkeypatch.setattr(os, "replace", move)
    write_files(tmp_path, {"a": b"a", "b": b"b"})
    with replacing(tmp_path / "c") as temporary:
        temporary.write_bytes(b"c")
    assert [path.name for path in moved] == ["a", "b", "c"]


def test_a_removal_waits_for_the_files_it_belongs_to(tmp_path):
    target, companion = tmp_path / "rock.obj", tmp_path / "rock.uvs.npz"
    target.write_bytes(b"before")
    companion.write_bytes(b"before")

    def write(stop):
        with appearing_together():
            with replacing(target) as temporary:
                temporary.write_bytes(b"after")
            remove_file(companion)
            assert companion.is_file()
            if stop:
                raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write(stop=True)
    assert {path.read_bytes() for path in tmp_path.iterdir()} == {b"before"}
    write(stop=False)
    assert [path.name for path in tmp_path.iterdir()] == ["rock.obj"]
    remove_file(companion)  # it may be gone already
    remove_file(target)
    assert not list(tmp_path.iterdir())


def test_a_file_written_after_its_removal_stays(tmp_path):
    target = tmp_path / "rock.uvs.npz"
    with appearing_together():
        for content in b"first", b"second":
            with replacing(target) as temporary:
                temporary.write_bytes(content)
            remove_file(target)
        with replacing(target) as temporary:
            temporary.write_bytes(b"third")
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [b"third"]


@pytest.mark.parametrize("name", ["a\0b", "x" * 300, "\ud800"])
@pytest.mark.parametrize(
    "look", [check_folder, check_name, check_writable, make_folder, remove_file, require_file]
)
def test_a_name_that_no_file_can_have_is_one_line(name, look, tmp_path):
    with pytest.raises(FileError) as refused:
        look(tmp_path / name)
    assert "\n" not in str(refused.value)
    assert not is_file(tmp_path / name) and not is_folder(tmp_path / name)
    check_name(tmp_path / "missing" / "file")
