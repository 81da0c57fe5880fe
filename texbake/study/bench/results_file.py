"""Results of the bench as JSON: their schema, cases written for other programs, and merging.

Whoever has a program that texbake cannot start writes the cases, bakes them, and sends a result
file with the maps beside it. Errors are then measured from the maps, so no stated
error has to be trusted. Where there is no map, the error in the file is shown as a stated one.

Based on: JSON Schema, draft 2020-12 (https://json-schema.org/draft/2020-12).
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

from pydantic import Field, ValidationError

from texbake.errors import FileFormatError
from texbake.files import PathLike, read_bytes, scratch_folder, write_files
from texbake.limits import file_beside
from texbake.mesh.files import write_mesh
from texbake.progress import Stages
from texbake.rendering.scene.file.tables import Table, file_schema
from texbake.rendering.scene.file.values import Number, Switch, Text, Whole, choice, first_error
from texbake.schema import JsonSchema
from texbake.study.bench.cases import made_case
from texbake.study.bench.map_tasks import Prepared
from texbake.study.bench.programs import Product, common_settings
from texbake.study.bench.result import FORMAT, VERSION, BenchResult, Contest, Failure
from texbake.study.bench.tasks import TASKS
from texbake.study.knob import Evaluation, Setting
from texbake.study.options import CASE_NAMES, MAX_TRIANGLES, TASK_NAMES, BenchOptions
from texbake.study.result import Measurement

SETTINGS = "settings.json"
_MOST_SECONDS = 1e9
_FILES = ("high", "high_obj", "low", "mesh", "scene")  # keys of a job that name a file


_TASK, _FORM = choice(TASK_NAMES), choice(("tangent", "object", "heights", "positions"))
_FORMAT = choice((FORMAT,))
_MAYBE: Any = None


class MachineTable(Table):
    """What a program ran on, without the name of a host or user."""

    system: Text = Field(description="Operating system.")
    processor: Text = Field(description="Kind of processor, such as x86_64.")
    processors: Whole = Field(description="Number of processors.")
    model: Text = Field(_MAYBE, description="Name of the processor or graphics card.")
    memory_bytes: Whole = Field(_MAYBE, description="Memory of the machine.")
    python: Text = Field(_MAYBE, description="Version of Python.")


class ProgramTable(Table):
    """A program that took part."""

    version: Text = Field(description="Its version.")
    machine: MachineTable = Field(description="What it ran on.")


class SettingTable(Table):
    """One setting of a program: how long it took, and what it made."""

    program: Text = Field(description="A key of programs.")
    setting: Text = Field(description="The name of the setting in settings.json.")
    seconds: list[Number] = Field(
        description="Time of each run by the clock, with start, reading and writing."
    )
    peak_bytes: Whole | None = Field(None, description="Peak resident memory.")
    output: Text | None = Field(None, description="What it made, as a path from this file.")
    form: _FORM = Field(  # type: ignore[valid-type]
        "",
        description="What the pixels of a map are: normals in tangent space (OpenGL) or in object "
        "space, heights in model units, or positions.",
    )
    error: Number | None = Field(
        None, description="In the unit of the task; measured again where the output is there."
    )
    figures: dict[str, Number | None] = Field({}, description="Further figures.")
    on_front: Switch = Field(_MAYBE, description="Whether none is faster and more accurate.")
    on_memory_front: Switch = Field(_MAYBE, description="The same of memory.")


class FailureTable(Table):
    """A setting that failed, with a wrong exit code or without a result."""

    program: Text = Field(description="A key of programs.")
    setting: Text = Field(description="The name of the setting.")
    reason: Text = Field(description="The exit code and the last line, or that it took too long.")


class ContestTable(Table):
    """One task on one case."""

    task: _TASK = Field(description="What was done.")  # type: ignore[valid-type]
    case: Text = Field(description="The name of a generated case, or of a mesh.")
    triangles: Whole = Field(
        description="Triangles the case was made with; 0 for own meshes.", ge=0, le=MAX_TRIANGLES
    )
    settings: list[SettingTable] = Field(description="What was measured.")
    left_out: list[FailureTable] = Field([], description="What failed.")
    subject: Text = Field("", description="What was worked on, in words.")
    truth: Text = Field("", description="Kind of truth that errors are measured against.")
    truth_text: Text = Field("", description="The same in a sentence.")
    error: Text = Field("", description="What the error is, in words.")
    unit: Text = Field("", description="The unit of the error.")


class ResultTable(Table):
    """Results of the bench."""

    format: _FORMAT = Field(description="What this file is.")  # type: ignore[valid-type]
    version: Whole = Field(description="Version of the format.", ge=VERSION, le=VERSION)
    date: Text = Field(description="Day of the measurement, such as 2026-11-27.")
    quick: Switch = Field(description="Whether only a small range was measured.")
    programs: dict[str, ProgramTable] = Field(description="Programs by name.")
    contests: list[ContestTable] = Field(description="Tasks on cases.")
    inputs: dict[str, str] = Field({}, description="Names of the user's meshes.")
    missing: dict[str, str] = Field({}, description="Programs that were not installed, and why.")
    repeats: Whole = Field(_MAYBE, description="Most timed runs of a setting.")
    seconds: Number = Field(_MAYBE, description="Time of the whole bench.")


def bench_schema() -> JsonSchema:
    """JSON Schema of result files, draft 2020-12."""
    return file_schema(ResultTable, "texbake bench results")


def read_results(path: PathLike) -> ResultTable:
    """Read and check a result file."""
    try:
        table = ResultTable.model_validate(json.loads(read_bytes(path)))
    except ValidationError as error:
        raise FileFormatError(f"{path}: {first_error(error)}") from error
    except (ValueError, RecursionError) as error:
        raise FileFormatError(f"{path}: it is not a result file: {error}") from error
    for item in (item for contest in table.contests for item in contest.settings):
        if item.program not in table.programs:
            raise FileFormatError(f"{path}: {item.program!r} is not one of its programs")
        if not all(0.0 < time < _MOST_SECONDS for time in item.seconds):
            raise FileFormatError(f"{path}: seconds must be above 0 and below {_MOST_SECONDS:g}")
        if item.error is not None and item.error < 0.0:
            raise FileFormatError(f"{path}: an error is below 0: {item.error:g}")
    return table


def export_cases(folder: PathLike, options: BenchOptions, stages: Stages) -> list[Path]:
    """Write a folder for each case: its meshes, and the jobs of all tasks in `settings.json`."""
    written = []
    for name in options.ordered_cases:
        here = Path(folder) / name
        here.mkdir(parents=True, exist_ok=True)
        with stages.stage(f"write {name}"):
            case = made_case(name, options.made_triangles)
            jobs: list[dict[str, Any]] = []
            for task in map(TASKS.__getitem__, options.ordered_tasks):
                prepared = task.prepare(case, options, here)
                if prepared is None:
                    continue
                given = dict(prepared.job)
                if "high" in given:  # for programs that read no PLY
                    given["high_obj"] = str(Path(given["high"]).with_suffix(".obj"))
                    given["has_normals"] = case.high.normals is not None
                    write_mesh(case.high, given["high_obj"])
                given |= {key: Path(given[key]).name for key in _FILES if key in given}
                jobs += [
                    {"task": task.name, "setting": label, **given, **added}
                    for label, added in common_settings(task.name, options)
                ]
            content = {
                "format": f"{FORMAT}-case",
                "version": VERSION,
                "case": name,
                "triangles": options.made_triangles,
                "quick": options.quick,
                "jobs": jobs,
            }
            text = json.dumps(content, indent=2) + "\n"
            written += write_files(here, {SETTINGS: text.encode("utf-8")})
    return written


def merge_results(
    result: BenchResult | None, paths: Iterable[PathLike], stages: Stages
) -> BenchResult:
    """Return a result with those of files added; errors are measured again where maps are."""
    for path in paths:
        found = read_results(path)
        if result is None:
            result = BenchResult(BenchOptions(quick=found.quick), {}, {}, {}, (), date=found.date)
        names = {name: _free(name, path, result) for name in found.programs}
        contests = {(c.task.name, c.case, c.triangles): c for c in result.contests}
        with scratch_folder() as folder:
            for table in found.contests:
                with stages.stage(f"judge {table.task}, {table.case}"):
                    judged = _judged(table, names, Path(path), found.quick, folder)
                key = (table.task, table.case, table.triangles)
                contests[key] = _joined(contests.get(key), judged)
        of_file = found.programs.items()
        result = replace(
            result,
            versions={**result.versions, **{names[n]: p.version for n, p in of_file}},
            machines={
                **result.machines,
                **{names[n]: p.machine.model_dump(exclude_none=True) for n, p in of_file},
            },
            contests=tuple(
                sorted(contests.values(), key=lambda c: (TASK_NAMES.index(c.task.name), c.case))
            ),
        )
    assert result is not None
    return result


def _free(name: str, path: PathLike, result: BenchResult) -> str:
    """Return the name of a program, with that of its file where another has it already."""
    return name if name not in result.versions else f"{name} ({Path(path).stem})"


def _joined(first: Contest | None, second: Contest) -> Contest:
    if first is None:
        return second
    return replace(
        first,
        measurements=first.measurements + second.measurements,
        failures=first.failures + second.failures,
        stated=first.stated + second.stated,
    )


def _judged(
    table: ContestTable, names: dict[str, str], path: Path, quick: bool, folder: Path
) -> Contest:
    """Return what a file has of one task on one case, judged by its maps where they are there."""
    task, prepared = TASKS[table.task], None
    if table.case in CASE_NAMES and any(_output(item, path) for item in table.settings):
        case = made_case(table.case, table.triangles)
        prepared = task.prepare(case, BenchOptions(quick=quick), folder)
    measurements: list[Measurement] = []
    failures = [
        Failure(names.get(f.program, f.program), f.setting, f.reason) for f in table.left_out
    ]
    stated: dict[str, None] = {}
    for item in table.settings:
        program = names.get(item.program, item.program)
        try:
            output = _output(item, path) if prepared is not None else None
            outcome = _outcome(item, prepared, output)
        except (OSError, ValueError) as error:
            failures.append(Failure(program, item.setting, str(error)))
            continue
        if output is None:
            stated[program] = None
        setting = Setting(item.setting, None, program)
        measurements.append(Measurement(setting, outcome, tuple(item.seconds), item.peak_bytes))
    words = {
        key: getattr(table if prepared is None else prepared, key)
        for key in ("subject", "truth", "truth_text")
    }
    return Contest(
        task, table.case, **words, measurements=tuple(measurements), failures=tuple(failures),
        triangles=table.triangles, stated=tuple(stated),
    )  # fmt: skip


def _output(item: SettingTable, path: Path) -> Path | None:
    """Return what a setting made, if it lies beside the result file or in a folder there."""
    output = file_beside(path, item.output) if item.output else path.parent
    return output if output.is_file() else None


def _outcome(item: SettingTable, prepared: Prepared | None, output: Path | None) -> Evaluation:
    if not item.seconds:
        raise ValueError("its file has no time of it")
    if prepared is not None and output is not None:
        outcome = prepared.judge(Product(output, item.form))
        if outcome.error == outcome.error:  # not NaN
            return outcome
        raise ValueError("nothing of its result can be compared")
    if item.error is None:
        raise ValueError(f"its file states no error, and {item.output or 'no output'} is not there")
    figures = {name: x for name, x in item.figures.items() if x is not None}
    return Evaluation(item.error, figures=figures)
