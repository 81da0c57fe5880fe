"""The frame of every page: a single file that contains everything it shows.

Pages are rendered from the Jinja templates in `templates`, which escape every value, so no file
name or message can run a script. A Content Security Policy also forbids the browser to load
anything: pictures are data URIs, and only the scripts in the page run, identified by their hashes.

Based on: Content Security Policy Level 3, W3C, 2025.
"""

from __future__ import annotations

import base64
import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texbake.core import portable_math as pm
from texbake.errors import require_library
from texbake.files import PathLike, replacing

if TYPE_CHECKING:
    from jinja2 import Environment
    from markupsafe import Markup

_ASSETS = Path(__file__).with_name("assets")
_TEMPLATES = Path(__file__).with_name("templates")


def asset(name: str) -> str:
    """Return the text of a style sheet or script in `assets`."""
    return (_ASSETS / name).read_text(encoding="utf-8")


def render(template: str, *, folder: Path | None = None, **values: Any) -> Markup:
    """Render a Jinja template; every value is escaped, unless it is `Markup`.

    Templates can use the macros of `parts.html` and the filters `number`, `duration` and `memory`.
    A template in `folder` comes before that of `templates`; a missing value is an error.
    """
    from markupsafe import Markup

    return Markup(_environment(folder).get_template(template).render(values))


@lru_cache(maxsize=8)
def _environment(folder: Path | None) -> Environment:
    require_library("jinja2", "pages")
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
    """Return a whole page."""
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
    """Write a page. If writing fails, no partial file is left behind."""
    with replacing(path) as temporary:
        # File names may contain bytes that are not valid text.
        temporary.write_text(html, encoding="utf-8", errors="replace")


def as_json(values: Any) -> str:
    """Return JSON for use inside a page; `<` is escaped, so that it contains no tags."""
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


def number(x: float) -> str:
    """Format a number with three digits, without an exponent unless it is very small or large.

    >>> [number(x) for x in (0.0, 0.123456, 12.3456, 1234.6, 0.0000123, float("nan"))]
    ['0', '0.123', '12.3', '1,235', '1.2e-05', '–']
    """
    if not math.isfinite(x):
        return "–"
    if x == 0.0:
        return "0"
    size = abs(x)
    if size < 1e-4:
        return f"{x:.1e}"
    if size >= 1000.0:
        return f"{x:,.0f}"
    digits = max(2 - math.floor(pm.log10(size)), 0)
    text = f"{x:.{digits}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def duration(seconds: float) -> str:
    """Format a time with a suitable unit: `1.2 ms`, `3.4 s`, `13.5 min`, `2.1 h`."""
    if seconds < 1.0:
        return f"{number(1000.0 * seconds)} ms"
    if seconds < 120.0:
        return f"{number(seconds)} s"
    return f"{number(seconds / 60.0)} min" if seconds < 7200.0 else f"{number(seconds / 3600.0)} h"


def memory(n_bytes: int | None) -> str:
    """Format a number of bytes in MB or GB."""
    if n_bytes is None:
        return "–"
    return f"{number(n_bytes / 1e9)} GB" if n_bytes >= 1e9 else f"{number(n_bytes / 1e6)} MB"
