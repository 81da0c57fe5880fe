"""Files appear whole or not at all; folders of results."""

import errno
import os
from pathlib import Path

import pytest

from texbake import FileError
from texbake.files import check_folder, check_writable, make_folder, replacing


def test_a_folder_is_made_with_those_it_is_in(tmp_path: Path) -> None:
    deep = tmp_path / "a" / "b"
    check_folder(deep)
    assert not (tmp_path / "a").exists()  # looking makes nothing
    assert make_folder(deep) == deep
    assert deep.is_dir()
    assert make_folder(deep) == deep  # it may be there


def test_a_file_is_no_folder(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    for folder in tmp_path / "file", tmp_path / "file" / "below":
        with pytest.raises(FileError, match="is a file"):
            check_folder(folder)
        with pytest.raises(FileError, match="cannot be made"):
            make_folder(folder)


def test_a_folder_must_be_open_to_writing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "access", lambda path, mode: False)  # an answer that root never gets
    with pytest.raises(FileError, match="cannot be written to"):
        check_folder(tmp_path / "a")


def test_a_file_appears_whole(tmp_path: Path) -> None:
    target = tmp_path / "map.png"
    with replacing(target) as temporary:
        temporary.write_bytes(b"whole")
        assert temporary.suffix == ".png"
        assert temporary.parent == tmp_path
        assert not target.exists()
    assert target.read_bytes() == b"whole"
    assert [path.name for path in tmp_path.iterdir()] == ["map.png"]


@pytest.mark.parametrize("stop", [ValueError, KeyboardInterrupt, SystemExit])
def test_an_interrupted_file_leaves_nothing_and_loses_nothing(
    tmp_path: Path, stop: type[BaseException]
) -> None:
    target = tmp_path / "map.png"
    target.write_bytes(b"before")

    def write_half() -> None:
        with replacing(target) as temporary:
            temporary.write_bytes(b"ha")
            raise stop

    with pytest.raises(stop):
        write_half()
    assert target.read_bytes() == b"before"
    assert [path.name for path in tmp_path.iterdir()] == ["map.png"]


def test_a_full_disk_is_one_clear_error(tmp_path: Path) -> None:
    target = tmp_path / "map.png"
    target.write_bytes(b"before")

    def fill_the_disk() -> None:
        with replacing(target):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with pytest.raises(FileError, match=r"map\.png: cannot be written: No space left on device"):
        fill_the_disk()
    assert target.read_bytes() == b"before"


def test_permissions_and_links_stay(tmp_path: Path) -> None:
    target, link = tmp_path / "real.png", tmp_path / "link.png"
    target.touch(mode=0o600)
    link.symlink_to(target)
    with replacing(link) as temporary:
        temporary.write_bytes(b"through the link")
    assert link.is_symlink()
    assert target.read_bytes() == b"through the link"
    assert target.stat().st_mode & 0o777 == 0o600


@pytest.mark.parametrize(
    ("name", "why"), [("", "it is a folder"), ("no/a.png", "there is no folder")]
)
def test_a_folder_that_cannot_be_written_is_refused_before_the_work(
    tmp_path: Path, name: str, why: str
) -> None:
    for look in (check_writable, lambda path: replacing(path).__enter__()):
        with pytest.raises(FileError, match=why):
            look(tmp_path / name)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
def test_a_pipe_or_a_device_is_not_replaced(tmp_path: Path) -> None:
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


def test_links_in_a_circle_are_reported(tmp_path: Path) -> None:
    link = tmp_path / "a.png"
    link.symlink_to(link)
    with pytest.raises(FileError, match="its links form a circle"):
        check_writable(link)
    assert link.is_symlink()
