"""A study as one self-contained page, which opens anywhere and without a network."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape

from texbake.pages.pictures import data_uri, png_of
from texbake.pages.shell import page_html
from texbake.pages.words import duration, memory, number
from texbake.study.findings import amount, findings, next_step
from texbake.study.plots import Plot
from texbake.study.result import KnobResult, Measurement, StudyResult

_STYLE = """
.truth { display: inline-block; border-radius: 1rem; padding: .05rem .7rem; font-size: .8rem;
  border: 1px solid var(--line); background: var(--wash); margin-right: .4rem;
  white-space: nowrap; }
ul.findings { margin: .5rem 0 1rem; padding-left: 1.2rem; max-width: 46rem; }
ul.findings li { margin: .25rem 0; }
.wide svg { display: block; width: 100%; height: auto; }
.plot svg { min-width: 30rem; max-width: 46rem; }
.all svg { min-width: 48rem; }
th, td { white-space: nowrap; }
th { white-space: normal; vertical-align: bottom; min-width: 4.5rem; }
th:first-child, td:first-child { text-align: left; white-space: nowrap; position: sticky; left: 0;
  background: var(--paper); }
td.words, th.words { text-align: left; min-width: 9rem; white-space: normal; }
tr.front td:first-child { font-weight: 600; }
tr.kept td { background: var(--kept); }
.range { color: var(--faint); font-size: .8rem; white-space: nowrap; }
.crops { display: grid; grid-template-columns: repeat(auto-fill, minmax(140px, 1fr)); gap: .75rem; }
@media (max-width: 600px) {
  th:first-child, td:first-child { white-space: normal; min-width: 6.5rem; max-width: 8rem; }
  .crops { grid-template-columns: repeat(auto-fill, minmax(104px, 1fr)); }
}
"""

_TITLE = "What accuracy costs in time"
_READING = (
    "Each point is a setting: its error over the time it takes. Both scales are logarithmic; down "
    "and to the left is better. Bars run from the shortest to the longest time of all rounds. "
    "Filled points are on the Pareto front, drawn as a dashed line: no other setting is both "
    "faster and more accurate. A ring marks where it stops paying off: beyond it, no step halves "
    "the error for four times the time."
)


def study_page(result: StudyResult, plots: Mapping[str, Plot], everything: Plot) -> str:
    """Return the page as HTML.

    Parameters
    ----------
    result
        What was measured.
    plots
        One for each knob, by its name.
    everything
        The plot of all knobs.
    """
    sections = "".join(_section(item, plots[item.knob.name]) for item in result.knobs)
    body = (
        f"<h1>{_TITLE}</h1>\n{_header(result)}"
        f"<section>\n<h2>Where each knob stops paying off</h2>\n{_summary(result)}"
        f"{_skipped(result)}</section>\n"
        f"<section>\n<h2>All settings</h2>\n<p>{_READING} Each frame has errors of one kind. Each "
        "knob has a front of its own, because different knobs answer different questions.</p>\n"
        f'<div class="wide all">{_titled(everything.svg, "All settings of all knobs")}</div>\n'
        f"</section>\n{sections}{_footer(result)}"
    )
    # The plots are drawn on white.
    return page_html(_TITLE, body, styles=[_STYLE], dark=False)


def _header(result: StudyResult) -> str:
    machine, inputs = result.machine, result.inputs
    names = {"high": "high-poly mesh", "low": "low-poly mesh", "scene": "scene"}
    given = ", ".join(f"{names[key]} <b>{escape(name)}</b>" for key, name in inputs.items())
    on = given or "generated meshes and scenes, most of which have a closed form"
    quick = (
        " This was a quick run over a small range: draw no conclusions from it."
        if result.options.quick
        else ""
    )
    return (
        f"<p>Measured on {on}.{quick}</p>\n"
        f'<p class="faint">{escape(str(machine["system"]))}, '
        f"{escape(str(machine['processor']))}, {machine['threads']} of {machine['processors']} "
        f"processors; {duration(result.seconds)} in all.</p>\n"
    )


def _summary(result: StudyResult) -> str:
    rows = []
    for item in result.knobs:
        for best in item.knees:
            kept = item.measurements[best]
            rows.append(
                f'<tr><td><a href="#{item.knob.name}">{escape(item.knob.title)}</a></td>'
                f'<td class="words">{escape(kept.setting.label)}</td>'
                f"<td>{escape(amount(kept.error, item.knob.unit))}</td>"
                f"<td>{duration(kept.median)}</td>"
                f'<td class="words">{escape(next_step(item, best))}</td></tr>\n'
            )
    return (
        '<div class="wide"><table>\n<tr><th>Knob</th><th class="words">pays off up to</th>'
        '<th>error there</th><th>time there</th><th class="words">the next step</th></tr>\n'
        f"{''.join(rows)}</table></div>\n"
    )


def _skipped(result: StudyResult) -> str:
    skipped = "".join(
        f"<li>{escape(name)} is left out: {escape(reason)}.</li>"
        for name, reason in result.skipped.items()
    )
    return f'<ul class="findings">{skipped}</ul>\n' if skipped else ""


def _section(result: KnobResult, plot: Plot) -> str:
    knob = result.knob
    sentences = "".join(f"<li>{escape(text)}</li>" for text in findings(result))
    words = "separate rays" if result.truth == "rays" else result.truth
    return (
        f'<section id="{knob.name}">\n<h2>{escape(knob.title)}</h2>\n<p>{escape(knob.about)}</p>\n'
        f'<p class="faint">On: {escape(result.subject)}.</p>\n'
        f'<p class="faint"><span class="truth">truth: {words}</span>'
        f"{escape(result.truth_text)}</p>\n"
        f'<ul class="findings">{sentences}</ul>\n'
        f'<div class="wide plot">{_titled(plot.svg, knob.title)}</div>\n'
        f"{_table(result)}{_crops(result)}</section>\n"
    )


def _table(result: KnobResult) -> str:
    names = list(dict.fromkeys(n for item in result.measurements for n in item.outcome.figures))
    heads = "".join(f"<th>{escape(name)}</th>" for name in names)
    front, knees = set(result.front), set(result.knees)
    rows = "".join(
        _row(item, names, result.knob.unit, on_front=i in front, kept=i in knees)
        for i, item in enumerate(result.measurements)
    )
    unit = f" ({escape(result.knob.unit)})" if result.knob.unit else ""
    return (
        f'<div class="wide"><table>\n<tr><th>setting</th><th>{escape(result.knob.error)}{unit}'
        f"</th><th>time</th><th>memory</th>{heads}</tr>\n{rows}</table></div>\n"
        '<p class="faint">Bold: on the Pareto front. Shaded: where it stops paying off. Time is '
        "the median of the rounds, with the range; memory is by how much it rose at its peak.</p>\n"
    )


def _row(item: Measurement, names: list[str], unit: str, *, on_front: bool, kept: bool) -> str:
    figures = item.outcome.figures
    cells = "".join(f"<td>{number(figures[n]) if n in figures else '–'}</td>" for n in names)
    marks = " ".join(name for name, is_so in (("front", on_front), ("kept", kept)) if is_so)
    low, high = min(item.seconds), max(item.seconds)
    return (
        f'<tr class="{marks}"><td>{escape(item.setting.label)}</td><td>{number(item.error)}</td>'
        f'<td>{duration(item.median)}<br><span class="range">{duration(low)} – {duration(high)}, '
        f"{len(item.seconds)} runs</span></td><td>{memory(item.peak_bytes)}</td>{cells}</tr>\n"
    )


def _crops(result: KnobResult) -> str:
    figures = "".join(
        f'<figure><img alt="{escape(item.setting.label)}" loading="lazy" '
        f'src="{data_uri(png_of(item.outcome.picture))}"><figcaption>'
        f"<b>{escape(item.setting.label)}</b><br>{escape(amount(item.error, result.knob.unit))}, "
        f"{duration(item.median)}</figcaption></figure>\n"
        for item in result.measurements
        if item.outcome.picture is not None
    )
    return f'<div class="crops">{figures}</div>\n' if figures else ""


def _titled(svg: str, title: str) -> str:
    """Add a title to an SVG, for those who cannot see it."""
    return svg.replace("<svg ", f'<svg role="img" aria-label="{escape(title)}" ', 1)


def _footer(result: StudyResult) -> str:
    return (
        "<section>\n<h2>How it was measured</h2>\n"
        "<p>The settings of a knob run in rounds, once in each round, in an order that changes "
        "from round to round, so that what disturbs the machine for a while disturbs all settings. "
        f"There are up to {result.options.repeats} rounds, fewer for slow settings. A first round "
        f"before them counts only for settings that take more than {result.options.seconds:g} s. "
        "Only the work itself is timed, not the comparison with the truth. Memory is the peak of "
        "resident memory above what it was before. All figures are in study.json and study.csv "
        "beside this page.</p>\n</section>\n"
    )
