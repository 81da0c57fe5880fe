"""Arrays in an uncompressed .npz archive, read without trusting what it says of itself."""

from __future__ import annotations

import math
import zipfile
from pathlib import Path
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from texbake.files import PathLike

_SUFFIX = ".npy"
_KINDS = "biuf"  # Booleans, integers and floats
_HEADERS = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}


def read_arrays(path: PathLike) -> dict[str, npt.NDArray[Any]]:
    """Read the arrays of an archive by name.

    No more memory is taken than the file has bytes: entries are not compressed, hold just what
    their headers promise, and share no bytes of the file.

    Raises
    ------
    OSError
        The file cannot be read.
    Exception
        What `zipfile` and `numpy` raise for a damaged file; `ValueError` where an entry promises
        what is not there.
    """
    with Path(path).open("rb") as file, zipfile.ZipFile(file) as archive:
        entries = archive.infolist()
        if sum(entry.file_size for entry in entries) > Path(path).stat().st_size:
            raise ValueError("its entries are larger than the file")
        arrays = {}
        for entry in entries:
            if entry.compress_type != zipfile.ZIP_STORED or not entry.filename.endswith(_SUFFIX):
                raise ValueError(f"{entry.filename}: it is not an uncompressed array")
            with archive.open(entry) as content:
                arrays[entry.filename.removesuffix(_SUFFIX)] = _array(content, entry.file_size)
    return arrays


def _array(content: IO[bytes], size: int) -> npt.NDArray[Any]:
    """The array of an entry of `size` bytes."""
    read_header = _HEADERS[np.lib.format.read_magic(content)]
    shape, is_fortran, dtype = read_header(content)
    data = content.read(size)
    if dtype.kind not in _KINDS or len(data) != math.prod(shape) * dtype.itemsize:
        raise ValueError("an array is not what its header promises")
    array = np.frombuffer(bytearray(data), dtype=dtype)
    return array.reshape(shape, order="F" if is_fortran else "C")
