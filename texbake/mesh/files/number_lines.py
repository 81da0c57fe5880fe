"""Files of numbers in text, line by line."""

from __future__ import annotations

import math
from typing import NamedTuple

from texbake.errors import FileFormatError
from texbake.files import PathLike
from texbake.mesh.files.source import map_file, require_text


class Line(NamedTuple):
    """A line with something on it: its number in the file, from 1, and its words."""

    number: int
    words: list[str]


def read_lines(path: PathLike, kind: str) -> list[Line]:
    """Words of each line; blanks and commas part them, `#` begins a comment, empty lines go.

    Parameters
    ----------
    path
    kind
        What messages call such a file, as "a profile".

    Raises
    ------
    FileError
        The file is missing or cannot be read.
    FileFormatError
        It is empty, or no text.
    """
    data = map_file(path)
    require_text(path, data, kind)
    try:
        text = data.tobytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise FileFormatError(f"{path}: it is not {kind}; it is not text in UTF-8") from error
    words = (line.partition("#")[0].replace(",", " ").split() for line in text.splitlines())
    return [Line(number, found) for number, found in enumerate(words, start=1) if found]


def parse_row(path: PathLike, line: Line, n_numbers: int, what: str) -> list[float]:
    """Finite numbers of a line that must have so many; `what` says what they are."""
    if len(line.words) != n_numbers:
        raise FileFormatError(
            f"{path}: line {line.number}: it has {len(line.words)} words; "
            f"{what} needs {n_numbers} numbers"
        )
    row = []
    for word in line.words:
        try:
            row.append(float(word))
        except ValueError as error:
            raise FileFormatError(
                f"{path}: line {line.number}: {word[:20]!r} is not a number"
            ) from error
        if not math.isfinite(row[-1]):
            raise FileFormatError(f"{path}: line {line.number}: {word[:20]!r} is not finite")
    return row
