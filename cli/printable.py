"""Text from files and file names, made safe to print on a terminal."""

from __future__ import annotations

import re

# Control characters but the line feed, marks that reorder a line, and what stands for bytes that
# are not UTF-8.
_UNSAFE = re.compile(
    "[\x00-\x09\x0b-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069\ud800-\udfff]"
)


def printable(text: str) -> str:
    r"""Return text with control characters as escapes: it moves no cursor and sets no color.

    >>> print(printable("red\x1b[31m"))
    red\x1b[31m
    """
    return _UNSAFE.sub(lambda match: _escape(match[0]), text)


def in_line(text: str) -> str:
    r"""Return printable text without line feeds, so that a name cannot pass for a line of its own.

    >>> print(in_line("red\nwrote a.png"))
    red\x0awrote a.png
    """
    return printable(text).replace("\n", r"\x0a")


def _escape(character: str) -> str:
    code = ord(character)
    if 0xDC80 <= code <= 0xDCFF:  # a byte of a file name
        code -= 0xDC00
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}"
