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
    r"""Return the line, from 1, of a key of a valid TOML text, by its place as in messages.

    That of the nearest place around it, if the key is not in the text; None if nothing around it
    is. All keys of a table or list that spans several lines are at its first line.

    >>> text = 'name = "x"\n[[assets]]\nsize.high = 3\n'
    >>> line_of(text, "assets[0].size.high"), line_of(text, "assets[0].size.low")
    (3, 3)
    """
    search = _Search(place)
    tables: dict[str, int] = {}  # number of tables in each list of tables so far
    prefix, is_near = "", True
    for line, statement in _statements(text.replace("\r\n", "\n")):
        if statement.startswith("["):
            prefix = _header(tomllib.loads(statement), tables)
            is_near = search.leads_to(prefix)
            if prefix.endswith("]"):
                search.note(prefix[: prefix.rindex("[")], line)
            search.note(prefix, line)
        elif is_near:
            search.note_all(prefix, tomllib.loads(statement), line)
    return search.line


class _Search:
    """The line of a place, or of the nearest one around it so far."""

    def __init__(self, place: str) -> None:
        self._place = place
        self._length = 0  # of the nearest place
        self.line: int | None = None

    def leads_to(self, place: str) -> bool:
        """Whether the searched place is this one, or in it."""
        return self._goes_on("", place)

    def _goes_on(self, place: str, step: str) -> bool:
        """Whether a place that leads to the searched one still does so after one more step."""
        end = len(place) + len(step)
        return self._place.startswith(step, len(place)) and (
            end == 0 or self._place[end : end + 1] in ("", ".", "[")
        )

    def note(self, place: str, line: int) -> None:
        """Note the line of a place; the first one counts."""
        if len(place) > self._length and self.leads_to(place):
            self._length, self.line = len(place), line

    def note_all(self, place: str, value: Any, line: int) -> None:
        """Note the line of all that is in a value, as far as it leads to the searched place."""
        self.note(place, line)
        items: Any = ()
        if isinstance(value, dict):
            items = ((_step(place, key), inner) for key, inner in value.items())
        elif isinstance(value, list):
            items = ((f"[{index}]", inner) for index, inner in enumerate(value))
        for step, inner in items:
            if self._goes_on(place, step):
                self.note_all(place + step, inner, line)


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
