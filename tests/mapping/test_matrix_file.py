from __future__ import annotations

from pathlib import Path

import pytest

from texbake.errors import FileError, FileFormatError
from texbake.mapping.matrix_file import read_matrix

ROWS = ((1.0, 0.0, 0.0, 0.5), (0.0, 1.0, 0.0, 0.5), (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, -1.0, 2.0))


@pytest.mark.parametrize(
    "text",
    [
        "1 0 0 .5\n0 1 0 .5\n0 0 1 0\n0 0 -1 2\n",
        "1,0,0,0.5, 0,1,0,0.5, 0,0,1,0, 0,0,-1,2",
        "# a slide\n1 0 0 .5 # first\r\n0 1 0 5e-1 0 0 1 0\n\n0 0 -1 2",
    ],
)
def test_sixteen_numbers_row_by_row(text: str, tmp_path: Path) -> None:
    (tmp_path / "m.txt").write_text(text)
    assert read_matrix(tmp_path / "m.txt") == ROWS


@pytest.mark.parametrize(
    "data",
    [b"", b"1 2 3", b"1 " * 17, b"nan " * 16, b"one " * 16, b"\xff\xfe\x00" * 99, b"1 " * 99999],
)
def test_anything_else_is_one_error(data: bytes, tmp_path: Path) -> None:
    (tmp_path / "m.txt").write_bytes(data)
    with pytest.raises(FileFormatError, match="no matrix of 4 rows of 4 numbers"):
        read_matrix(tmp_path / "m.txt")


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"none\.txt: cannot be read"):
        read_matrix(tmp_path / "none.txt")
