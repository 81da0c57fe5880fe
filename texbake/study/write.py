"""The files of a study: figures, plots and the page.

The page needs no other file and no network.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from texbake.files import PathLike, write_files
from texbake.pages.page import page_html, render
from texbake.pages.pictures import data_uri, png_of
from texbake.progress import Progress, Stages
from texbake.study.findings import amount, findings, next_step
from texbake.study.plots import Plot, all_plot, check_matplotlib, knob_plot
from texbake.study.result import Measurement, StudyResult, figure_names

if TYPE_CHECKING:
    from markupsafe import Markup


PAGE, JSON, ALL_PLOT = "study.html", "study.json", "all.png"


def write_study(result: StudyResult, folder: PathLike, *, progress: Progress = None) -> list[Path]:
    """Write everything that a study measured."""
    check_matplotlib()
    stages = Stages(progress)
    with stages.stage("draw plots", total=len(result.knobs) + 1, unit="plots") as advance:
        plots = {}
        for item in result.knobs:
            plots[item.knob.name] = knob_plot(item)
            advance(1)
        everything = all_plot(result.knobs)
        advance(1)
    with stages.stage("write"):
        files = {
            PAGE: study_page(result, plots, everything).encode("utf-8"),
            JSON: (json.dumps(result.to_json(), indent=2) + "\n").encode("utf-8"),
            ALL_PLOT: everything.png,
            **{f"{name}.png": plot.png for name, plot in plots.items()},
        }
        return write_files(folder, files)


TEMPLATES = Path(__file__).with_name("templates")
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

TITLE = "What accuracy costs in time"
_INPUTS = {"high": "high-poly mesh", "low": "low-poly mesh", "scene": "scene"}


def study_page(result: StudyResult, plots: Mapping[str, Plot], everything: Plot) -> str:
    """Return the page as HTML."""
    body = render(
        "study.html",
        folder=TEMPLATES,
        title=TITLE,
        result=result,
        inputs=_INPUTS,
        everything=titled(everything.svg, "All settings of all knobs"),
        plots={
            item.knob.name: titled(plots[item.knob.name].svg, item.knob.title)
            for item in result.knobs
        },
        amount=amount,
        figure_names=figure_names,
        findings=findings,
        next_step=next_step,
        uri_of=crop_uri,
    )
    # The plots are drawn on white.
    return page_html(TITLE, body, styles=[PAGE_STYLE], dark=False)


def crop_uri(item: Measurement) -> str:
    """Return the crop of a setting that has one."""
    assert item.outcome.picture is not None
    return data_uri(png_of(item.outcome.picture))


def titled(svg: str, title: str) -> Markup:
    """SVG of a plot with a name for screen readers."""
    from markupsafe import Markup, escape

    return Markup(svg.replace("<svg ", f'<svg role="img" aria-label="{escape(title)}" ', 1))
