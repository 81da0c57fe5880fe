"""A study as one self-contained page, which opens anywhere and without a network."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texbake.pages.page import page_html, render
from texbake.pages.pictures import data_uri, png_of
from texbake.study.findings import amount, findings, next_step
from texbake.study.plots import Plot
from texbake.study.result import KnobResult, Measurement, StudyResult, figure_names

if TYPE_CHECKING:
    from markupsafe import Markup

_TEMPLATES = Path(__file__).with_name("templates")
PAGE_STYLE = """
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
_INPUTS = {"high": "high-poly mesh", "low": "low-poly mesh", "scene": "scene"}


def study_page(result: StudyResult, plots: Mapping[str, Plot], everything: Plot) -> str:
    """Return the page as HTML."""
    body = render(
        "study.html",
        folder=_TEMPLATES,
        title=_TITLE,
        inputs=[(_INPUTS[key], name) for key, name in result.inputs.items()],
        quick=result.options.quick,
        machine=result.machine,
        seconds=result.seconds,
        summary=[_best(item, best) for item in result.knobs for best in item.knees],
        skipped=list(result.skipped.items()),
        everything=titled(everything.svg, "All settings of all knobs"),
        knobs=[_knob(item, plots[item.knob.name]) for item in result.knobs],
        repeats=result.options.repeats,
        warm_up=result.options.seconds,
    )
    # The plots are drawn on white.
    return page_html(_TITLE, body, styles=[PAGE_STYLE], dark=False)


def _best(item: KnobResult, best: int) -> dict[str, Any]:
    """A row of the summary: a setting beyond which a knob stops paying."""
    kept = item.measurements[best]
    return {
        "name": item.knob.name,
        "title": item.knob.title,
        "label": kept.setting.label,
        "error": amount(kept.error, item.knob.unit),
        "median": kept.median,
        "next": next_step(item, best),
    }


def _knob(result: KnobResult, plot: Plot) -> dict[str, Any]:
    """Values of the section of a knob."""
    knob = result.knob
    front, knees = set(result.front), set(result.knees)
    return {
        "name": knob.name,
        "title": knob.title,
        "about": knob.about,
        "error": knob.error,
        "unit": knob.unit,
        "subject": result.subject,
        "truth": "separate rays" if result.truth == "rays" else result.truth,
        "truth_text": result.truth_text,
        "findings": findings(result),
        "plot": titled(plot.svg, knob.title),
        "names": figure_names(result.measurements),
        "rows": [
            {"marks": _marks(front=i in front, kept=i in knees), **setting_row(item)}
            for i, item in enumerate(result.measurements)
        ],
        "crops": crops(result.measurements, knob.unit),
    }


def _marks(**given: bool) -> str:
    return " ".join(name for name, is_so in given.items() if is_so)


def setting_row(item: Measurement) -> dict[str, Any]:
    """Values of a row of the table of settings."""
    return {
        "label": item.setting.label,
        "error": item.error,
        "median": item.median,
        "low": min(item.seconds),
        "high": max(item.seconds),
        "runs": len(item.seconds),
        "memory": item.peak_bytes,
        "figures": item.outcome.figures,
    }


def crops(measurements: Sequence[Measurement], unit: str) -> list[dict[str, Any]]:
    """Values of the crops of those settings that have one."""
    return [
        {
            "series": item.setting.series,
            "label": item.setting.label,
            "uri": data_uri(png_of(item.outcome.picture)),
            "error_text": amount(item.error, unit),
            "median": item.median,
        }
        for item in measurements
        if item.outcome.picture is not None
    ]


def titled(svg: str, title: str) -> Markup:
    """SVG of a plot with a name for screen readers."""
    from markupsafe import Markup, escape

    return Markup(svg.replace("<svg ", f'<svg role="img" aria-label="{escape(title)}" ', 1))
