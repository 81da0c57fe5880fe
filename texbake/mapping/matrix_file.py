"""A file with a 4 x 4 matrix."""

from __future__ import annotations

import math
from pathlib import Path

from texbake.errors import FileError, FileFormatError
from texbake.mapping.options.checks import Matrix

_MOST_BYTES = 65536  # sixteen numbers never take more; a file that does is no matrix


def read_matrix(path: str | Path) -> Matrix:
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
    path = Path(path)
    try:
        with path.open("rb") as file:
            data = file.read(_MOST_BYTES + 1)
    except OSError as error:
        raise FileError(f"{path}: cannot be read: {error.strerror}") from error
    lines = [line.split("#")[0] for line in data.decode("utf-8", errors="replace").splitlines()]
    words = " ".join(lines).replace(",", " ").split()
    try:
        values = [float(word) for word in words]
    except ValueError:
        values = []
    if len(data) > _MOST_BYTES or len(values) != 16 or not all(map(math.isfinite, values)):
        raise FileFormatError(
            f"{path}: it is no matrix of 4 rows of 4 numbers; write 16 numbers, row by row"
        )
    a, b, c, d = ((v[0], v[1], v[2], v[3]) for v in (values[i : i + 4] for i in range(0, 16, 4)))
    return a, b, c, d
