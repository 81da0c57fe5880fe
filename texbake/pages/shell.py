"""The frame of every page: one file that holds all it shows, and may ask for nothing else.

The page itself forbids its browser to load anything (Content Security Policy): pictures are data
in the page, and of scripts only those that were written into it run, known by their hashes.

Based on: Content Security Policy Level 3, W3C, 2025.
"""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from texbake.files import PathLike, replacing

_ASSETS = Path(__file__).with_name("assets")


def asset(name: str) -> str:
    """Text of a style sheet or script that lies in `assets`."""
    return (_ASSETS / name).read_text(encoding="utf-8")


def page_html(
    title: str,
    body: str,
    *,
    styles: Sequence[str] = (),
    scripts: Sequence[str] = (),
    data: Mapping[str, str] | None = None,
    dark: bool = True,
) -> str:
    """Return a whole page.

    Parameters
    ----------
    title
        As the window shows it; plain text.
    body
        HTML of what stands in `main`.
    styles
        Style sheets that follow the common one.
    scripts
        Run in their order when the page is there.
    data
        Identifier to text that scripts read, such as `as_json` makes; it stands in the page as it
        is and so must not hold `</`.
    dark
        Follow the reader's choice of a dark scheme.
    """
    sheets = [asset("base.css"), *([asset("dark.css")] if dark else []), *styles]
    blocks = "".join(
        f'<script type="text/plain" id="{escape(name)}">{text}</script>\n'
        for name, text in (data or {}).items()
    )
    run = "".join(f"<script>{script}</script>\n" for script in scripts)
    scheme = "light dark" if dark else "light"
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{_policy(scripts)}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<meta name="color-scheme" content="{scheme}">\n'
        f"<title>{escape(title)}</title>\n<style>{''.join(sheets)}</style>\n</head>\n"
        f"<body>\n<main>\n{body}</main>\n{blocks}{run}</body>\n</html>\n"
    )


def write_page(path: PathLike, html: str) -> None:
    """Write a page; the file appears whole or not at all.

    Raises
    ------
    FileError
        It cannot be written.
    """
    with replacing(path) as temporary:
        # A name with bytes that are no text must not cost the page.
        temporary.write_text(html, encoding="utf-8", errors="replace")


def as_json(values: Any) -> str:
    """JSON that can stand inside a page: `<` is written so that no tag begins in it."""
    return json.dumps(values, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")


def _policy(scripts: Sequence[str]) -> str:
    hashes = " ".join(
        f"'sha256-{base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()}'"
        for script in scripts
    )
    return (
        f"default-src 'none'; img-src data:; style-src 'unsafe-inline'; "
        f"script-src {hashes or chr(39) + 'none' + chr(39)}; base-uri 'none'; form-action 'none'"
    )
