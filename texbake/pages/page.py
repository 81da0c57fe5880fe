"""The frame of every page: one file that holds all it shows and loads nothing else.

Pages are made from the Jinja templates in `templates`, which escape every value, so that no file
name or message can run a script. The page also forbids its browser to load anything (Content
Security Policy): pictures are data in the page, and only the scripts written into it run, known by
their hashes.

Based on: Content Security Policy Level 3, W3C, 2025.
"""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texbake.files import PathLike, replacing
from texbake.pages.figures import duration, memory, number

if TYPE_CHECKING:
    from jinja2 import Environment
    from markupsafe import Markup

_ASSETS = Path(__file__).with_name("assets")
_TEMPLATES = Path(__file__).with_name("templates")


def asset(name: str) -> str:
    """Text of a style sheet or script in `assets`."""
    return (_ASSETS / name).read_text(encoding="utf-8")


def three_js() -> str:
    """Source of three.js, with its license; it makes the global `THREE`.

    It is the file `build/three.min.js` of release 0.149.0, as its authors publish it: the last
    release with a build that one script tag holds and that does not print a warning.
    """
    return asset("three.min.js")


def render(template: str, *, folder: Path | None = None, **values: Any) -> Markup:
    """Render a Jinja template; every value is escaped, unless it is `Markup`.

    Templates can use the macros of `parts.html` and the filters `number`, `duration` and `memory`.

    Parameters
    ----------
    template
        Name of the file.
    folder
        Where it is; None for `templates` here.
    **values
        Variables of the template. Using one that is not given is an error.
    """
    from markupsafe import Markup

    return Markup(_environment(folder).get_template(template).render(values))


@lru_cache(maxsize=8)
def _environment(folder: Path | None) -> Environment:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader([*([folder] if folder else []), _TEMPLATES]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters |= {"number": number, "duration": duration, "memory": memory}
    return environment


def page_html(
    title: str,
    body: Markup,
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
        Title of the window; plain text.
    body
        What stands in `main`, as `render` returns it. Plain text is escaped.
    styles
        Style sheets that follow the common one.
    scripts
        Run in this order, once the page is there.
    data
        Identifier to text that scripts read, such as `as_json` makes. It is written as it is, and
        so must not contain `</`.
    dark
        Whether the page follows the reader's choice of a dark color scheme.
    """
    from markupsafe import Markup

    sheets = [asset("base.css"), *([asset("dark.css")] if dark else []), *styles]
    html = render(
        "page.html",
        title=title,
        body=body,
        policy=Markup(_policy(scripts)),
        scheme="light dark" if dark else "light",
        style=Markup("".join(sheets)),
        scripts=[Markup(script) for script in scripts],
        data={name: Markup(text) for name, text in (data or {}).items()},
    )
    return str(html)


def write_page(path: PathLike, html: str) -> None:
    """Write a page; the file appears whole or not at all.

    Raises
    ------
    FileError
        It cannot be written.
    """
    with replacing(path) as temporary:
        # A name with bytes that are not text must not prevent the page.
        temporary.write_text(html, encoding="utf-8", errors="replace")


def as_json(values: Any) -> str:
    """JSON that can stand inside a page: `<` is escaped, so that no tag begins in it."""
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
