"""Lines of the keys of a TOML file, which its parser does not tell.

A file is cut into statements, each of which is a small TOML file of its own, so that the parser
itself says what keys it sets.
"""

from __future__ import annotations

import tomllib
from typing import Any

from texbake.rendering.scene.file.faults import place_of

Steps = list[int | str]


def key_lines(text: str) -> dict[str, int]:
    r"""Line, from 1, of every key of a valid TOML text, by its place as messages name it.

    >>> key_lines('name = "x"\n[[assets]]\nsize.high = 3\n')
    {'name': 1, 'assets[0]': 2, 'assets': 2, 'assets[0].size': 3, 'assets[0].size.high': 3}

    Values that are tables or lists over several lines have all their keys at the first of these.
    """
    lines: dict[str, int] = {}
    tables: dict[str, int] = {}  # how many tables each list of tables has so far
    prefix: Steps = []
    statement, start = "", 1
    for number, line in enumerate(text.replace("\r\n", "\n").split("\n"), 1):
        start = start if statement else number
        statement += line + "\n"
        try:
            content = tomllib.loads(statement)
        except tomllib.TOMLDecodeError:
            continue  # it goes on in the next line
        if statement.lstrip().startswith("["):
            prefix = _header(content, tables)
            _note(prefix, {}, start, lines)
        else:
            _note(prefix, content, start, lines)
        statement = ""
    return lines


def line_of(lines: dict[str, int], place: str) -> int | None:
    """Line of a place, or of the nearest place around it that has one."""
    while place:
        if place in lines:
            return lines[place]
        cut = max(place.rfind("."), place.rfind("["))
        place = place[: max(cut, 0)]
    return None


def _header(content: dict[str, Any], tables: dict[str, int]) -> Steps:
    """Steps to the table that a header opens; each list of tables stands for its last one."""
    steps: Steps = []
    value: Any = content
    while value:
        if isinstance(value, list):
            place = place_of(steps)
            tables[place] = tables.get(place, 0) + 1
            steps.append(tables[place] - 1)
            break
        ((key, value),) = value.items()
        steps.append(key)
        place = place_of(steps)
        if isinstance(value, dict) and place in tables:
            steps.append(tables[place] - 1)
    return steps


def _note(prefix: Steps, value: Any, line: int, lines: dict[str, int]) -> None:
    lines.setdefault(place_of(prefix), line)
    if prefix and isinstance(prefix[-1], int):
        lines.setdefault(place_of(prefix[:-1]), line)
    lines.pop("", None)
    items: Any = ()
    if isinstance(value, dict):
        items = value.items()
    elif isinstance(value, list):
        items = enumerate(value)
    for key, inner in items:
        _note([*prefix, key], inner, line, lines)
