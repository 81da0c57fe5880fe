"""Arrays in .npy files and uncompressed .npz archives.

They are read without trusting what the files promise.
"""

from __future__ import annotations

import math
import tokenize
import warnings
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from texbake.files import PathLike, replacing

DAMAGE = (
    ValueError, TypeError, KeyError, EOFError, RuntimeError, OverflowError, SyntaxError,
    Warning, zipfile.BadZipFile, zlib.error, tokenize.TokenError,
)  # fmt: skip
"""What numpy and zipfile raise for a damaged file. Headers of arrays are parsed as Python, and a
flipped bit may mark an entry as encrypted or compressed by an unknown method."""
_SUFFIX = ".npy"
_KINDS = "biufcU"  # Booleans, numbers and text
_HEADERS = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}


def write_arrays(path: PathLike, arrays: Mapping[str, npt.NDArray[Any]]) -> None:
    """Write arrays into an uncompressed archive; the file appears whole or not at all."""
    entries: dict[str, Any] = dict(arrays)  # as arrays, they fail the type of `allow_pickle`
    with replacing(path) as temporary, temporary.open("wb") as file:
        np.savez(file, **entries)


def read_arrays(path: PathLike) -> dict[str, npt.NDArray[Any]]:
    """Read the arrays of an archive by name, in no more memory than the file has bytes."""
    arrays = {}
    with Path(path).open("rb") as file, zipfile.ZipFile(file) as archive:
        entries = archive.infolist()
        if sum(entry.file_size for entry in entries) > Path(path).stat().st_size:
            raise ValueError("its entries are larger than the file")
        for entry in entries:
            if entry.compress_type != zipfile.ZIP_STORED or not entry.filename.endswith(_SUFFIX):
                raise ValueError(f"{entry.filename}: it is not an uncompressed array")
            with archive.open(entry) as content:
                arrays[entry.filename.removesuffix(_SUFFIX)] = _array(content)
    return arrays


def read_array_file(path: PathLike) -> npt.NDArray[Any]:
    """Read the array of a .npy file; raises what `read_arrays` raises."""
    with Path(path).open("rb") as file:
        return _array(file)


def _array(content: IO[bytes]) -> npt.NDArray[Any]:
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # numpy repairs some headers, and counts may overflow
        shape, is_fortran, dtype = _HEADERS[np.lib.format.read_magic(content)](content)
    data = content.read()
    if dtype.kind not in _KINDS or len(data) != math.prod(shape) * dtype.itemsize:
        raise ValueError("an array is not what its header promises")
    array = np.frombuffer(bytearray(data), dtype=dtype)
    return array.reshape(shape, order="F" if is_fortran else "C")
