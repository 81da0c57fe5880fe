"""USD files as stages: opened with errors of one line, and the library that does it.

usd-core, Pixar's own wheel, is optional: `pip install 'texbake[usd]'`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.errors import DependencyError, FileFormatError
from texbake.files import PathLike
from texbake.mesh.files.source import require_file


def require_usd(path: PathLike) -> None:
    """Raise `DependencyError` where USD cannot be read or written."""
    try:
        import pxr.Usd  # noqa: F401
    except ImportError as error:
        raise DependencyError(
            f"{path}: USD files need usd-core; pip install 'texbake[usd]', or use a .glb file"
        ) from error


def open_stage(path: PathLike) -> Any:
    """Open a .usd, .usda, .usdc or .usdz file with what it refers to.

    Raises
    ------
    DependencyError
        usd-core is not installed.
    FileError
        There is no such file.
    FileFormatError
        It is not a USD file, or it is damaged.
    """
    require_file(path)
    require_usd(path)
    from pxr import Sdf, Usd

    if Path(path).stat().st_size == 0:
        raise FileFormatError(f"{path}: the file is empty; write it again")
    with told_damage(path):
        # Not through the registry of layers, which would give what the file held when it was
        # last opened.
        layer = Sdf.Layer.FindOrOpen(str(path))
        if layer is not None:
            layer.Reload(True)
        stage = Usd.Stage.Open(str(path))
    if stage is None:
        raise FileFormatError(f"{path}: it is not a USD file; export it again")
    return stage


@contextmanager
def told_damage(path: PathLike) -> Iterator[None]:
    """Turn what the library complains of into `FileFormatError`.

    Values are read when they are first asked for, so that a stage which could be opened may still
    turn out to be damaged.
    """
    from pxr import Tf

    try:
        yield
    except (Tf.ErrorException, UnicodeDecodeError) as error:
        raise FileFormatError(
            f"{path}: it is not a USD file, or damaged: {_reason(error)}; export it again"
        ) from None


def numbers_of(path: PathLike, values: Any, kind: type[np.generic]) -> npt.NDArray[Any]:
    """Return what the library has read, which may be anything, as an array of a kind of number.

    Raises
    ------
    FileFormatError
        They are no numbers.
    """
    try:
        with np.errstate(invalid="ignore"):  # NaN that signals is NaN like any other
            return np.array(values, kind)
    except (TypeError, ValueError, OverflowError):
        raise FileFormatError(
            f"{path}: it holds {type(values).__name__} where numbers belong; export it again"
        ) from None


def _reason(error: Exception) -> str:
    """Return what the library complained of first, without its own places in its sources."""
    try:
        complaint = str(error).strip()
    except UnicodeDecodeError:  # it repeats what it could not read
        complaint = "it holds text that is not UTF-8"
    said = re.search(r" : '(.*?)'\s*$", complaint, re.DOTALL)
    words = said[1] if said else complaint
    first = words.split("Error in '")[0]
    return " ".join(first.split()).strip("'") or "no reason was given"
