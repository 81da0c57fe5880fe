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
    ("data", "message"),
    [
        (b"", "is empty"),
        (b"# nothing", "it has 0 words; a matrix needs 16 numbers"),
        (b"1 2 3", "it has 3 words; a matrix needs 16 numbers"),
        (b"1 " * 17, "it has 17 words; a matrix needs 16 numbers"),
        (b"1 " * 99999, "it has 99999 words; a matrix needs 16 numbers"),
        (b"nan " * 16, "line 1: 'nan' is not finite"),
        (b"1 1 1 1\n" * 3 + b"1 one 1 1", "line 4: 'one' is not a number"),
        (b"\xff\xfe\x00" * 99, "is not a matrix"),
    ],
)
def test_anything_else_is_one_error(data: bytes, message: str, tmp_path: Path) -> None:
    (tmp_path / "m.txt").write_bytes(data)
    with pytest.raises(FileFormatError, match=message):
        read_matrix(tmp_path / "m.txt")


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"none\.txt: there is no such file"):
        read_matrix(tmp_path / "none.txt")
