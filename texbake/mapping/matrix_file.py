"""A file with a 4 x 4 matrix."""

from __future__ import annotations

from texbake.errors import FileFormatError
from texbake.files import PathLike
from texbake.mapping.options.checks import Matrix
from texbake.mesh.files.source import parse_row, read_lines


def read_matrix(path: PathLike) -> Matrix:
    """Read sixteen numbers, row by row, with blanks, commas or line breaks between them.

    Parameters
    ----------
    path
        Text; what stands after `#` in a line is left out.

    Returns
    -------
    4 tuples of 4 floats
        The rows.

    Raises
    ------
    FileError
        The file cannot be read.
    FileFormatError
        It holds something else than sixteen finite numbers.
    """
    lines = read_lines(path, "a matrix")
    n_words = sum(len(line.words) for line in lines)
    if n_words != 16:
        raise FileFormatError(
            f"{path}: it has {n_words} words; a matrix needs 16 numbers, row by row"
        )
    values = [v for line in lines for v in parse_row(path, line, len(line.words), "a matrix")]
    a, b, c, d = ((v[0], v[1], v[2], v[3]) for v in (values[i : i + 4] for i in range(0, 16, 4)))
    return a, b, c, d
