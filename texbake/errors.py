"""Every error that a user can meet, as one tree.

A message says where, what, and what to do next, in one line::

    low.obj: it has no texture coordinates; make some with: texbake unwrap low.obj -o low_uv.obj

Messages name parameters of the library: an `OptionError` opens with those at fault, as Python has
them (`max_error: ...`), and elsewhere a parameter stands in backticks. The command line writes its
flags in their place.

The command line prints that line and exits 1, or 2 for an `OptionError`, which is wrong usage.
Anything else that is raised is a bug and keeps its traceback.
"""

from __future__ import annotations

import errno
import re
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from importlib import import_module
from typing import Any

_OPENING = re.compile(r"\w+(?:, \w+)*(?=: )")
_MOST_QUOTED = 60  # characters of a value that a message shows


def quoted(value: object) -> str:
    """Return a value as Python writes it, shortened in its middle, for a message.

    >>> quoted("wood"), len(quoted("wood" * 1000))
    ("'wood'", 60)
    """
    try:
        return shortened(repr(value))
    except RecursionError:  # lists in lists in lists
        return "a deeply nested value"


def shortened(text: str, most: int = _MOST_QUOTED) -> str:
    """Return text with an ellipsis for its middle where it is longer than `most` characters.

    >>> shortened("a name of a material", 9)
    'a na...al'
    """
    if len(text) <= most:
        return text
    n_end = (most - 3) // 3
    return f"{text[: most - 3 - n_end]}...{text[len(text) - n_end :]}"


def first_few(items: Iterable[str], most: int = 20) -> tuple[str, ...]:
    """Return each of some lines or names once, and of very many the first, and how many are left.

    >>> first_few(["a.png", "b.png", "a.png", "c.png"], most=1)
    ('a.png', 'and 2 more like these')
    """
    each = tuple(dict.fromkeys(items))
    if len(each) <= most:
        return each
    return (*each[:most], f"and {len(each) - most:,} more like these")


def similar(word: str, known: Iterable[str], cutoff: float = 0.6) -> str:
    """Return a question about the known word that is most like another one; "" if none is like it.

    >>> similar("heigth", ["normal", "height"])
    "did you mean 'height'?"
    """
    from difflib import get_close_matches  # takes a millisecond

    close = get_close_matches(word, known, n=1, cutoff=cutoff)
    return f"did you mean {quoted(close[0])}?" if close else ""


def require_known(name: str, value: object, known: Iterable[str]) -> None:
    """Raise `OptionError` unless the value of an option is one of those that are known."""
    if value not in (choices := tuple(known)):
        raise OptionError(
            f"{name}: {quoted(value)} is not known; it is one of {', '.join(choices)}"
        )


def require_least(name: str, value: float, least: int = 1) -> None:
    """Raise `OptionError` below the least value of an option, for NaN and for other objects."""
    try:
        is_enough = bool(value >= least)
    except (TypeError, ValueError):
        raise OptionError(f"{name}: {quoted(value)} is not a number") from None
    if not is_enough:
        raise OptionError(f"{name}: {value} is too small; it must be at least {least}")


def counted(n: int, one: str, many: str = "") -> str:
    """Return a number with what it counts; `many` is `one` with an s unless it is given.

    >>> counted(1, "face is", "faces are"), counted(1234, "texel")
    ('1 face is', '1,234 texels')
    """
    return f"{n:,} {one if n == 1 else many or one + 's'}"


def one_line(error: BaseException, most: int = 200) -> str:
    """Return what an error of a library says, on one line and shortened.

    >>> one_line(ValueError("no   number"))
    'no number'
    """
    return shortened(" ".join(str(error).split()), most)


class TexbakeError(Exception):
    """Root of everything that texbake raises on purpose."""


class OptionError(TexbakeError, ValueError):
    """An option has a value that it cannot have, or two options contradict each other.

    >>> OptionError("front, back: both are 0").parameters
    ('front', 'back')
    """

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters at fault, with which the message opens."""
        opening = _OPENING.match(str(self))
        return () if opening is None else tuple(opening[0].split(", "))


class DependencyError(TexbakeError, ImportError):
    """An optional or native library that the work needs is missing or does not load."""


_PACKAGES = {"PIL": "pillow", "collada": "pycollada"}  # where the name of a module differs


def require_library(module: str, what: object, package: str = "") -> Any:
    """Import a library for a feature; raise `DependencyError`, naming its `package` for pip."""
    try:
        return import_module(module)
    except ImportError as error:
        name = module.partition(".")[0]
        is_missing = isinstance(error, ModuleNotFoundError)
        state = "is missing" if is_missing else f"does not load ({one_line(error)})"
        package = package or _PACKAGES.get(name, name.lower())
        raise DependencyError(
            f"{what}: {name} {state}; install it with: pip install {package}"
        ) from error


class FileError(TexbakeError, OSError):
    """A file cannot be found, read or written."""


class FileFormatError(FileError, ValueError):
    """A file is not of a kind that texbake knows, or breaks the rules of its kind."""


class MeshError(TexbakeError, ValueError):
    """A mesh is not sound: not finite, an index out of range, arrays that do not fit together."""


class UvError(MeshError):
    """A mesh has no texture coordinates where they are needed, or none that cover any area."""


class UnwrapError(MeshError):
    """No atlas could be made for a mesh."""


class CageError(MeshError):
    """A cage does not fit the low-poly mesh that it is meant for."""


class MissError(TexbakeError):
    """More texels missed the high-poly mesh than the user allows."""


class CancelledError(TexbakeError):
    """A function given as `progress` returned False."""


class ReadWarning(UserWarning):
    """A reader left out or replaced something in a file, and read the rest."""


_LISTENER: ContextVar[Callable[[str], None] | None] = ContextVar("reading warnings", default=None)


def warn_of(path: object, what: str) -> None:
    """Warn, by `ReadWarning` or `heard_warnings`, of what a reader leaves out or replaces."""
    listener = _LISTENER.get()
    if listener is None:
        warnings.warn(f"{path}: {what}", ReadWarning, stacklevel=2)
    else:
        listener(f"{path}: {what}")


@contextmanager
def heard_warnings(listener: Callable[[str], None]) -> Iterator[None]:
    """Pass the warnings of readers in this block to a function, each line once.

    >>> with heard_warnings(print):
    ...     for _ in range(2):
    ...         warn_of("a.obj", "2 of 90 normals are not finite")
    a.obj: 2 of 90 normals are not finite
    """
    heard: set[str] = set()

    def listen(line: str) -> None:
        if line not in heard:
            heard.add(line)
            listener(line)

    token = _LISTENER.set(listen)
    try:
        yield
    finally:
        _LISTENER.reset(token)


def is_out_of_memory(error: BaseException) -> bool:
    """Whether an error means that memory ran out.

    >>> is_out_of_memory(MemoryError()), is_out_of_memory(OSError())
    (True, False)
    """
    return isinstance(error, MemoryError) or getattr(error, "errno", None) == errno.ENOMEM
