"""Error messages for scene files, in one line: the place, the value and what was expected.

Checks raise `fault`, pydantic records the place, and `first_fault` combines both to a message.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from pathlib import PurePath
from typing import Any

from pydantic import ValidationError
from pydantic_core import PydanticCustomError

from texbake.errors import FileFormatError, OptionError, TexbakeError, quoted, shortened
from texbake.files import PathLike

# Kinds of errors to report first, since they may cause others: a misspelled key is also missing.
_FIRST = ("key", "fault")
_MOST_KNOWN = 400  # characters of a list of words, which a file can make as long as it likes
_EXPECTED = {
    "float_type": "not a number; give one such as 0.5",
    "finite_number": "not finite; give a number such as 0.5",
    "int_type": "not a whole number; give one such as 4",
    "bool_type": "neither true nor false",
    "string_type": "not text; put it in quotes",
    "list_type": "not a list; give one in brackets",
    "dict_type": "not a table",
}
# Message of an options class: an optional owner, the option, and what is wrong.
_OPTION = re.compile(r"(?:[^:]*\.)?([\w-]+): (.*)", re.DOTALL)


def fault(what: str) -> PydanticCustomError:
    """Error for a value; `what` says what is wrong and what was expected."""
    return PydanticCustomError("fault", "{what}", {"what": what})


def key_fault(key: str, what: str) -> PydanticCustomError:
    """Error for a key in a table."""
    return PydanticCustomError("key", "{what}", {"what": what, "key": key})


def shown(value: Any) -> str:
    """Format a value of a file for a message: shortened, with text in quotes."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, PurePath):
        return quoted(str(value))
    return "a table" if isinstance(value, dict) else quoted(value)


def nearest(word: str, known: Iterable[str]) -> str:
    """Suggest a similar word (`did you mean 'x'?`), or list the known words."""
    words = list(known)
    close = get_close_matches(word, words, n=1, cutoff=0.6)
    if close:
        return f"did you mean {quoted(close[0])}?"
    return shortened(f"known: {', '.join(words)}", _MOST_KNOWN)


def place_of(steps: Sequence[int | str]) -> str:
    """Format a place as `objects[1].material.roughness`, without steps in angle brackets."""
    place = ""
    for step in steps:
        if isinstance(step, int):
            place += f"[{step}]"
        elif not step.startswith("<"):
            place += f".{shortened(step)}" if place else shortened(step)
    return place


def first_fault(error: ValidationError) -> str:
    """Format the first error with its place: `camera.fov: 'wide' is not a number`."""
    errors = error.errors(include_url=False)
    order = {kind: rank for rank, kind in enumerate(_FIRST)}
    worst = min(errors, key=lambda item: order.get(item["type"], len(order)))
    steps, kind = list(worst["loc"]), worst["type"]
    context = worst.get("ctx", {})
    if kind == "key":
        return f"{place_of([*steps, context['key']])}: {context['what']}"
    if kind == "fault":
        what = str(context["what"])
    elif kind == "value_error":
        return option_fault(steps, context["error"])
    elif kind == "missing":
        what = "it is missing"
    else:
        what = f"{shown(worst['input'])} is {_EXPECTED.get(kind, worst['msg'])}"
    return _line(steps, what)


def option_fault(steps: Sequence[int | str], error: Exception) -> str:
    """Format an error raised while building the object at a place; it may start with an option."""
    message = str(error)
    named = _OPTION.fullmatch(message) if isinstance(error, OptionError) else None
    if named is None:
        return _line(steps, message)
    key, what = named[1].replace("-", "_"), named[2]
    return _line(steps if steps and steps[-1] == key else [*steps, key], what)


@contextmanager
def at(path: PathLike, *steps: int | str) -> Iterator[None]:
    """Add the place in the file to errors raised in this context."""
    try:
        yield
    except TexbakeError as error:
        raise FileFormatError(f"{path}: {option_fault(steps, error)}") from error


def _line(steps: Sequence[int | str], what: str) -> str:
    place = place_of(steps)
    return f"{place}: {what}" if place else what
