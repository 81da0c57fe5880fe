"""What `texbake remap` does: read the trace, check the outputs, make maps, write, tell."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from texbake.files import check_folder, make_folder
from texbake.jobs.outputs import check_distinct, check_report
from texbake.progress import Stages

from .baking import check_map_files, clipped
from .map_options import map_files
from .terminal import Terminal


def remap_to_files(
    hits: Path,
    folder: Path,
    terminal: Terminal,
    suffix: str | None,
    pattern: str,
    report: Path | None,
    changes: dict[str, Any],
) -> None:
    """Make maps from a file of hits.

    Parameters
    ----------
    folder
        Of the maps; made if it is missing.
    suffix
        Of their files, without the dot; None for the usual one.
    pattern
        Of their names.
    changes
        Fields of `BakeOptions` that are to be other than they were in the bake.
    """
    check_folder(folder)
    check_report(report)
    from texbake.baking.bake import remap_hits
    from texbake.baking.hits_file import read_hits
    from texbake.jobs.outputs import write_report

    with terminal.progress() as progress:
        stages = Stages(progress)
        with stages.stage("read hits"):
            kept = read_hits(hits)
        options = replace(kept.report.options, **changes)
        files = map_files(folder, pattern, kept.report.low, options.maps, suffix)
        check_distinct([*files.values(), report], [hits])
        check_map_files(files, options)
        result = remap_hits(kept, options, progress=progress)
        with stages.stage("write maps"):
            make_folder(folder)
            written = {name: result.maps[name].write(path) for name, path in files.items()}
        reading, writing = stages.records
        figures = replace(result.report, stages=[reading, *result.report.stages, writing])
        if report is not None:
            coded = {name: asdict(file) for name, file in written.items()}
            write_report(report, {**figures.to_json(), "files": coded})
    for warning in clipped(written):
        terminal.warn(warning)
    terminal.summary(figures.table())
    terminal.wrote(path for path in (*files.values(), report) if path is not None)
