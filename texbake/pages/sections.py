"""Parts of a page: figures, tables, times, pictures, the command to paste."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np

from texbake.pages.pictures import data_uri, picture_codes, png_of
from texbake.pages.words import duration, memory
from texbake.progress import StageRecord
from texbake.rendering.compare import Comparison
from texbake.rendering.panels import MAX_ANGLE_DEG, colored_angles

Rows = Sequence[tuple[str, str]]

_LEGEND_STEPS = 24


def section(title: str, inside: str, *, name: str = "", about: str = "") -> str:
    """Return a section with a heading; `about` is a sentence of plain text below it."""
    words = f'<p class="faint">{escape(about)}</p>\n' if about else ""
    place = f' id="{name}"' if name else ""
    return f"<section{place}>\n<h2>{escape(title)}</h2>\n{words}{inside}</section>\n"


def tiles(rows: Rows) -> str:
    """Return the few figures that matter, large."""
    items = "".join(
        f"<div><dt>{escape(label)}</dt><dd>{escape(value)}</dd></div>" for label, value in rows
    )
    return f'<dl class="tiles">{items}</dl>\n'


def warning_list(warnings: Sequence[str]) -> str:
    """Return what the reader should look at; "" without any."""
    if not warnings:
        return ""
    items = "".join(f"<li>{escape(text)}</li>" for text in warnings)
    return f'<ul class="warnings" aria-label="Warnings">{items}</ul>\n'


def figure_table(rows: Rows) -> str:
    """Return labels and figures; a row without a value is a heading."""
    lines = "".join(
        f"<tr><th>{escape(label.strip())}</th><td>{escape(value)}</td></tr>\n"
        if value
        else f'<tr><th class="heading" colspan="2">{escape(label)}</th></tr>\n'
        for label, value in rows
    )
    return f'<table class="figures">\n{lines}</table>\n'


def stage_table(stages: Sequence[StageRecord]) -> str:
    """Return what each stage took, with bars."""
    longest = max((stage.seconds for stage in stages), default=0.0) or 1.0
    lines = "".join(
        f'<tr><th>{escape(stage.name)}</th><td class="bar"><svg viewBox="0 0 100 8" '
        f'preserveAspectRatio="none" aria-hidden="true"><rect width="'
        f'{100 * stage.seconds / longest:.2f}" height="8"/></svg></td>'
        f"<td>{duration(stage.seconds)}</td></tr>\n"
        for stage in stages
    )
    total = sum(stage.seconds for stage in stages)
    peaks = [stage.peak_memory_bytes for stage in stages if stage.peak_memory_bytes]
    peak = f", peak memory {memory(max(peaks))}" if peaks else ""
    return (
        f'<table class="stages">\n{lines}<tr class="total"><th>total</th><td></td>'
        f'<td>{duration(total)}</td></tr>\n</table>\n<p class="faint">{duration(total)} in '
        f"all{peak}.</p>\n"
    )


def command_box(command: str) -> str:
    """Return a command to paste, with a button that copies it."""
    return (
        '<div class="command"><pre tabindex="0"><code id="command">'
        f"{escape(command)}</code></pre>"
        '<button type="button" data-copies="command">Copy</button></div>\n'
    )


def comparison_figures(comparison: Comparison) -> str:
    """Return the pictures of a comparison and the map of its errors."""
    frames = comparison.high_frame, comparison.bare_frame, comparison.mapped_frame
    names = "Dense", "Bare", "With its maps"
    notes = (
        "",
        f"normals off by {comparison.bare.mean_deg:.2f}° in the mean",
        f"normals off by {comparison.mapped.mean_deg:.2f}° in the mean",
    )
    figures = "".join(
        _figure(png_of(frame.color), name, escape(note))
        for frame, name, note in zip(frames, names, notes, strict=True)
    )
    errors = _figure(png_of(comparison.difference()), "Error of the normals", legend())
    return f'<div class="pictures">{figures}{errors}</div>\n'


def angle_colors() -> list[str]:
    """Return the colors of angles from 0 to `MAX_ANGLE_DEG` in even steps, as CSS has them."""
    angles = np.linspace(0.0, MAX_ANGLE_DEG, _LEGEND_STEPS, dtype=np.float32)
    codes = picture_codes(colored_angles(angles[None, :]))[0]
    return [f"#{red:02x}{green:02x}{blue:02x}" for red, green, blue in codes.tolist()]


def legend() -> str:
    """Return the scale of angles."""
    colors = ",".join(angle_colors())
    return (
        f'<span class="scale">0° <i style="background:linear-gradient(90deg,{colors})"></i> '
        f"{MAX_ANGLE_DEG:g}° and more</span>"
    )


def _figure(png: bytes, name: str, note: str) -> str:
    return (
        f'<figure><img alt="{escape(name)}" src="{data_uri(png)}">'
        f"<figcaption><b>{escape(name)}</b> {note}</figcaption></figure>\n"
    )
