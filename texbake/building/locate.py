"""Line numbers of the keys of a TOML file, which its parser does not report.

The file is cut into statements, each a small TOML file of its own, so that the parser itself says
which keys each one sets. Each character is looked at a few times at most, because a file may be a
single list of megabytes.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from typing import Any

from texbake.rendering.scene.file.values import place_of

# What a statement is cut at: line ends, unless they are in brackets or in a text of several lines.
# Whatever is not closed reaches to the end, so that nothing is read twice.
_TOKEN = re.compile(
    r'''
    """ (?: [^"\\]++ | \\. | "{1,2}+(?!") )*+ (?: "{3,5} | \\?\Z )
    | \'\'\' (?: [^']++ | '{1,2}+(?!') )*+ (?: '{3,5} | \Z )
    | " (?: [^"\\\n]++ | \\[^\n] )*+ "?
    | ' [^'\n]*+ '?
    | \#[^\n]*+
    | [\[\]{}\n]
    ''',
    re.DOTALL | re.VERBOSE,
)
_OPENING, _CLOSING = ("[", "{"), ("]", "}")


def line_of(text: str, place: str) -> int | None:
    r"""Return the line, from 1, of a key of a valid TOML text, or of the nearest place around it.

    >>> text = 'name = "x"\n[[assets]]\nsize.high = 3\n'
    >>> line_of(text, "assets[0].size.high"), line_of(text, "assets[0].size.low")
    (3, 3)
    """
    lines: dict[str, int] = {}
    tables: dict[str, int] = {}  # number of tables in each list of tables so far
    prefix = ""
    for line, statement in _statements(text.replace("\r\n", "\n")):
        if statement.startswith("["):
            prefix = _header(tomllib.loads(statement), tables)
            if prefix.endswith("]"):
                lines.setdefault(prefix[: prefix.rindex("[")], line)
            lines.setdefault(prefix, line)
        elif place.startswith(prefix):
            for key in _places(prefix, tomllib.loads(statement), place):
                lines.setdefault(key, line)
    while place and place not in lines:
        place = place[: max(place.rfind("."), place.rfind("["), 0)]
    return lines.get(place)


def _places(place: str, value: Any, searched: str) -> Iterator[str]:
    """Yield the places inside a value that begin the searched place, outermost first."""
    items: Any = ()
    if isinstance(value, dict):
        items = ((_step(place, key), inner) for key, inner in value.items())
    elif isinstance(value, list):
        items = ((f"[{index}]", inner) for index, inner in enumerate(value))
    for step, inner in items:
        if step and searched.startswith(step, len(place)):
            yield place + step
            yield from _places(place + step, inner, searched)


def _statements(text: str) -> Iterator[tuple[int, str]]:
    """Yield each statement with the number of its first line."""
    line, depth = 1, 0
    start, first = 0, 1  # of the statement
    for token in _TOKEN.finditer(text):
        sign = token[0]
        if sign in _OPENING:
            depth += 1
        elif sign in _CLOSING:
            depth -= 1
        line += sign.count("\n")
        if sign == "\n" and depth <= 0:
            yield from _unless_empty(first, text[start : token.end()])
            start, first, depth = token.end(), line, 0
    yield from _unless_empty(first, text[start:])


def _unless_empty(line: int, statement: str) -> Iterator[tuple[int, str]]:
    statement = statement.lstrip(" \t\n")
    if statement and not statement.startswith("#"):
        yield line, statement


def _step(place: str, key: str) -> str:
    if place and not key.startswith("<"):  # which messages leave out
        return f".{place_of([key])}"
    return place_of([key])


def _header(content: dict[str, Any], tables: dict[str, int]) -> str:
    """Return the place of the table that a header opens; of a list of tables, of its last one."""
    place = ""
    value: Any = content
    while value:
        if isinstance(value, list):
            tables[place] = tables.get(place, 0) + 1
            return f"{place}[{tables[place] - 1}]"
        ((key, value),) = value.items()
        place += _step(place, key)
        if isinstance(value, dict) and place in tables:
            place += f"[{tables[place] - 1}]"
    return place
