"""Limits of what a file can make texbake do: image sizes, repeated triangles, other files.

A small file can hold an image of gigabytes, or name any file of the machine. Each limit is an
environment variable, so that worker processes have it too; `texbake --max-image`, `texbake
--max-triangles` and `texbake --allow-outside` set them.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from texbake.errors import FileError, FileFormatError, OptionError, quoted
from texbake.files import PathLike, is_file

MAX_IMAGE = "TEXBAKE_MAX_IMAGE"
"""Environment variable: an image may have as many pixels as a square with this side."""
MAX_TRIANGLES = "TEXBAKE_MAX_TRIANGLES"
"""Environment variable: how many triangles a file may have once its meshes are repeated."""
ALLOW_OUTSIDE = "TEXBAKE_ALLOW_OUTSIDE"
"""Environment variable: 1 if a file may name files outside its own folder."""

DEFAULT_MAX_IMAGE = 16384
_MOST_DIGITS = 18  # which 64 bits hold
_MOST_CHANNELS = 4  # of the greatest image; one of more channels has fewer pixels
_LONGEST_TOML = 4_000_000  # characters; 30,000 assets of a pipeline
LONGEST_NAME = 400
"""Characters of a path that a file names."""


@contextmanager
def raised_limits(
    *, max_image: int | None = None, max_triangles: int | None = None, allow_outside: bool = False
) -> Iterator[None]:
    """Raise limits, images by their side in pixels, for the block and processes it starts."""
    allows_outside()
    if max_image is None:
        _max_image()
    if max_triangles is None:
        most_triangles(0)
    before = {name: os.environ.get(name) for name in (MAX_IMAGE, MAX_TRIANGLES, ALLOW_OUTSIDE)}
    for name, number in ((MAX_IMAGE, max_image), (MAX_TRIANGLES, max_triangles)):
        if number is not None:
            os.environ[name] = str(number)
    if allow_outside:
        os.environ[ALLOW_OUTSIDE] = "1"
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name, None)
            if value is not None:
                os.environ[name] = value


def whole_number(text: str) -> int | None:
    """Return the number that a text is; None if it is none, or has more than 18 digits.

    >>> whole_number("16384"), whole_number("-1"), whole_number("9" * 5000)
    (16384, None, None)
    """
    return int(text) if text.isdecimal() and len(text) <= _MOST_DIGITS else None


def require_image_size(path: PathLike, width: int, height: int, n_channels: int) -> None:
    """Raise `FileFormatError` if an image has too many pixels, by default 16,384 squared."""
    side = _max_image()
    n_pixels = max(width * height, -(-width * height * n_channels // _MOST_CHANNELS))
    if n_pixels > side * side:
        needed = math.isqrt(n_pixels - 1) + 1
        raise FileFormatError(
            f"{path}: it has {width} x {height} pixels of {n_channels} "
            f"channel{'s' * (n_channels != 1)}, more than {side} x {side}; if you trust the file, "
            f"read it with texbake --max-image {needed}"
        )


def _max_image() -> int:
    text = os.environ.get(MAX_IMAGE, "") or str(DEFAULT_MAX_IMAGE)
    side = whole_number(text)
    if side is None or not 1 <= side <= 1 << 20:
        raise OptionError(f"{MAX_IMAGE}: {quoted(text)} is not a number of pixels, such as 16384")
    return side


def most_triangles(default: int) -> int:
    """Return how many triangles a file may have once its meshes are repeated."""
    text = os.environ.get(MAX_TRIANGLES, "")
    number = whole_number(text) if text else default
    if number is None:
        raise OptionError(f"{MAX_TRIANGLES}: {quoted(text)} is not a number of triangles")
    return number


def allows_outside() -> bool:
    """Whether files may name files outside their own folders."""
    text = os.environ.get(ALLOW_OUTSIDE, "")
    if text not in ("", "0", "1"):
        raise OptionError(f"{ALLOW_OUTSIDE}: {quoted(text)} is neither 1 nor 0")
    return text == "1"


def file_beside(path: PathLike, name: str) -> Path:
    """Return the path of a file that another file names, relative to its folder."""
    if len(name) > LONGEST_NAME:
        raise FileError(f"{path}: it names {quoted(name)}, which is too long for a file")
    folder = Path(path).parent
    place = folder / _with_slashes(folder, name)
    if not is_within(folder, place) and not allows_outside():
        raise FileError(
            f"{path}: it names {quoted(str(name))}, which lies outside its folder; if you trust "
            "the file, read it with texbake --allow-outside"
        )
    return place


def folder_beside(path: PathLike, name: str) -> Path:
    """Return the path of a folder that a file names, to write into."""
    place = file_beside(path, name)
    if not is_within(real_path(path, ""), real_path(path, name)) and not allows_outside():
        raise FileError(
            f"{path}: links lead from {quoted(str(name))} out of its folder; if you trust the "
            "file, read it with texbake --allow-outside"
        )
    return place


def _with_slashes(folder: Path, name: str) -> str:
    """Replace the backslashes of Windows in a name by slashes, unless such a file exists."""
    return name.replace("\\", "/") if "\\" in name and not is_file(folder / name) else name


def real_path(path: PathLike, name: str) -> str:
    """Return a path that is equal for all names by which a file names another one."""
    if len(name) > LONGEST_NAME:  # the system would be asked about each of its parts
        return name
    folder = Path(path).parent
    place = folder / _with_slashes(folder, name)
    try:
        return os.path.realpath(place)
    except (OSError, ValueError):  # no file can have such a name
        return str(place)


def toml_content(path: PathLike, text: str) -> dict[str, Any]:
    """Parse a file in TOML."""
    import tomllib

    if len(text) > _LONGEST_TOML:
        raise FileFormatError(
            f"{path}: it has {len(text):,} characters, more than {_LONGEST_TOML:,}; divide a "
            "pipeline into several, and put objects of a scene together into a .glb file"
        )
    try:
        content = tomllib.loads(text.replace("\r\n", "\n"))
    except (ValueError, RecursionError) as error:  # ValueError: also of a number of 5,000 digits
        raise FileFormatError(f"{path}: it is not TOML: {error}") from error
    if _has_long_integer(content):  # which not even a message could show
        raise FileFormatError(f"{path}: it is not TOML: an integer has more than 64 bits")
    return content


def _has_long_integer(content: object) -> bool:
    """Whether a table or list, or one in it, holds an integer that 64 bits do not."""
    found = [content]
    while found:
        value = found.pop()
        if isinstance(value, dict):
            found += value.values()
        elif isinstance(value, list):
            found += value
        elif isinstance(value, int) and not -(1 << 63) <= value < 1 << 63:
            return True
    return False


def is_within(folder: PathLike, place: PathLike) -> bool:
    """Whether a path lies in a folder or below, by their names."""
    inside, outside = (os.path.abspath(path) for path in (place, folder))  # noqa: PTH100
    return Path(inside).is_relative_to(outside)


_SECONDS = {"ms": 1e-3, "min": 60.0, "s": 1.0, "h": 3600.0}


def parse_seconds(value: str | float) -> float:
    """Parse `20s`, `500ms`, `2min`, `1h`, or a plain number of seconds.

    >>> parse_seconds("1.5min")
    90.0
    """
    word = str(value).strip()
    unit = next((unit for unit in _SECONDS if word.endswith(unit)), "")
    try:
        number = float(word.removesuffix(unit))
    except ValueError:
        number = math.nan
    if not 0.0 < number < math.inf:
        raise OptionError(
            f"time_budget: {quoted(word)} is not a duration; give one such as 20s or 2min"
        )
    return number * _SECONDS.get(unit, 1.0)
