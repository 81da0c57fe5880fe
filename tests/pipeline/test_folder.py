"""Folders of results."""

import os
from pathlib import Path

import pytest

from texbake import FileError
from texbake.pipeline.folder import check_folder, make_folder


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
    monkeypatch.setattr(os, "access", lambda path, mode: False)  # what root is never told
    with pytest.raises(FileError, match="cannot be written to"):
        check_folder(tmp_path / "a")
