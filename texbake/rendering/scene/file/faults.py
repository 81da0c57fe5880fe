"""What is wrong with a scene file, as one line: where it is, what it is, what was expected.

Checks raise `fault`; pydantic keeps the place, and `first_fault` makes the line of both.
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

from texbake.errors import FileFormatError, OptionError, TexbakeError
from texbake.files import PathLike

# Errors whose cause is most likely that of the others, first: a misspelled key is also missing.
_FIRST = ("key", "fault")
_EXPECTED = {
    "float_type": "not a number; give one such as 0.5",
    "finite_number": "not finite; give a number such as 0.5",
    "int_type": "not a whole number; give one such as 4",
    "bool_type": "neither true nor false",
    "string_type": "not text; put it in quotes",
    "list_type": "not a list; give one in brackets",
    "dict_type": "not a table",
}
# An error of an options class: maybe what it is of, then the option, then what is wrong.
_OPTION = re.compile(r"(?:[^:]*\.)?([\w-]+): (.*)", re.DOTALL)


def fault(what: str) -> PydanticCustomError:
    """Error of a value; `what` says what it is and what was expected."""
    return PydanticCustomError("fault", "{what}", {"what": what})


def key_fault(key: str, what: str) -> PydanticCustomError:
    """Error of a key in a table."""
    return PydanticCustomError("key", "{what}", {"what": what, "key": key})


def shown(value: Any) -> str:
    """Return a value of a file as a message has it: short, text in quotes."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, PurePath):
        return repr(str(value))
    text = "a table" if isinstance(value, dict) else repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def nearest(word: str, known: Iterable[str]) -> str:
    """`did you mean 'x'?`, or the known words where none is near."""
    words = list(known)
    close = get_close_matches(word, words, n=1, cutoff=0.6)
    return f"did you mean {close[0]!r}?" if close else f"known: {', '.join(words)}"


def place_of(steps: Sequence[int | str]) -> str:
    """`objects[1].material.roughness`; steps in angle brackets are no keys and are left out."""
    place = ""
    for step in steps:
        if isinstance(step, int):
            place += f"[{step}]"
        elif not step.startswith("<"):
            place += f".{step}" if place else step
    return place


def first_fault(error: ValidationError) -> str:
    """Place of the first error, and what is wrong there: `camera.fov: 'wide' is no number`."""
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
    """Line of an error of what is made at a place; that of an option may name it first."""
    message = str(error)
    named = _OPTION.fullmatch(message) if isinstance(error, OptionError) else None
    if named is None:
        return _line(steps, message)
    key, what = named[1].replace("-", "_"), named[2]
    return _line(steps if steps and steps[-1] == key else [*steps, key], what)


@contextmanager
def at(path: PathLike, *steps: int | str) -> Iterator[None]:
    """Give an error of what is made of a place in a file that place."""
    try:
        yield
    except TexbakeError as error:
        raise FileFormatError(f"{path}: {option_fault(steps, error)}") from error


def _line(steps: Sequence[int | str], what: str) -> str:
    place = place_of(steps)
    return f"{place}: {what}" if place else what
