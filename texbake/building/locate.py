"""Line numbers of the keys of a TOML file, which its parser does not report.

The file is cut into statements, each a small TOML file of its own, so that the parser itself says
which keys each one sets.
"""

from __future__ import annotations

import tomllib
from typing import Any

from texbake.rendering.scene.file.faults import place_of

Steps = list[int | str]
# Characters to parse, of which each line of a statement takes all before it again.
_MOST_WORK, _COST_OF_A_LINE = 4_000_000, 50


def key_lines(text: str) -> dict[str, int]:
    r"""Return the line, from 1, of every key of a valid TOML text, by its place as in messages.

    >>> key_lines('name = "x"\n[[assets]]\nsize.high = 3\n')
    {'name': 1, 'assets[0]': 2, 'assets': 2, 'assets[0].size': 3, 'assets[0].size.high': 3}

    All keys of a table or list that spans several lines are at its first line. Lines that come
    late in a long file, or after statements of hundreds of lines, are left out.
    """
    lines: dict[str, int] = {}
    tables: dict[str, int] = {}  # number of tables in each list of tables so far
    prefix: Steps = []
    statement, start = "", 1
    work = 0
    for number, line in enumerate(text.replace("\r\n", "\n").split("\n"), 1):
        start = start if statement else number
        statement += line + "\n"
        work += len(statement) + _COST_OF_A_LINE
        if work > _MOST_WORK:
            break
        try:
            content = tomllib.loads(statement)
        except tomllib.TOMLDecodeError:
            continue  # the statement continues in the next line
        if statement.lstrip().startswith("["):
            prefix = _header(content, tables)
            _note(prefix, {}, start, lines)
        else:
            _note(prefix, content, start, lines)
        statement = ""
    return lines


def line_of(lines: dict[str, int], place: str) -> int | None:
    """Return the line of a place, or of the nearest place around it that has one."""
    while place:
        if place in lines:
            return lines[place]
        cut = max(place.rfind("."), place.rfind("["))
        place = place[: max(cut, 0)]
    return None


def _header(content: dict[str, Any], tables: dict[str, int]) -> Steps:
    """Return the path to the table that a header opens; a list of tables means its last one."""
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
