"""The pipeline file: its assets, the steps that they go through, and where the results go.

Here each table is checked by itself, and the JSON Schema of the file is made from the same tables.
`graph` combines them into the steps of each asset and finds where their inputs come from.

Based on: JSON Schema, draft 2020-12 (https://json-schema.org/draft/2020-12).
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cache, cached_property
from pathlib import Path
from typing import Annotated, Any

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    ValidationError,
    WithJsonSchema,
    create_model,
)

from texbake.building.locate import line_of
from texbake.building.steps import STEP_KINDS
from texbake.errors import FileFormatError, OptionError, quoted
from texbake.files import PathLike, check_writable, read_bytes, replacing
from texbake.jobs.outputs import JobResult
from texbake.limits import folder_beside, toml_content
from texbake.records import dataclass
from texbake.rendering.scene.file.tables import (
    FileSchema,
    Table,
    described,
    file_schema,
    list_of,
    table,
)
from texbake.rendering.scene.file.values import (
    Text,
    first_error,
    format_value,
    key_error,
    nearest,
    option_error,
    place_of,
    validation_error,
)
from texbake.schema import JsonSchema
from texbake.verbs.step import Settings, StepKind

FOLDER = "build"


def _references(value: Any) -> Any:
    names = [value] if isinstance(value, str) else value
    if not isinstance(names, list) or not names or not all(isinstance(n, str) for n in names):
        raise validation_error(
            f"{format_value(value)} is neither a name in quotes nor a list of names"
        )
    return names


_NAME = {"type": "string"}
References = Annotated[
    list[str],
    BeforeValidator(_references),
    WithJsonSchema({"anyOf": [_NAME, {"type": "array", "items": _NAME, "minItems": 1}]}),
]


@dataclass(frozen=True, kw_only=True)
class AssetRule:
    """One `[[assets]]` table: one asset, or one for each file that matches."""

    index: int  # of the table
    name: str | None  # it may have names in braces
    # paths or patterns of each input; the first one distinguishes the assets
    inputs: dict[str, list[str]]
    steps: tuple[str, ...] | None  # steps to run; None for all
    options: dict[str, dict[str, Any]]  # settings of steps that differ for these assets


@dataclass(frozen=True, kw_only=True)
class StepTable:
    """A `[steps.NAME]` table with the options of an asset, checked."""

    name: str
    kind: StepKind
    settings: Settings  # all options, defaults included
    inputs: dict[str, list[str]]  # references by role
    after: tuple[str, ...]  # steps that must succeed first
    output: str | None  # pattern for the names of its outputs; None keeps them in the store only
    pipeline: Pipeline

    def fault(self, key: str, what: str) -> FileFormatError:
        """Return an error at a key of the table."""
        return self.pipeline.fault(("steps", self.name, key), what)


class Pipeline:
    """A pipeline file that has been read."""

    def __init__(self, path: PathLike, text: str, found: Any) -> None:
        self.path = Path(path).absolute()
        self._called = path
        self._text = text
        self._checked: dict[tuple[str, int], StepTable] = {}
        self._folder: str = found.folder or FOLDER
        self.store: str | None = found.store
        self.outputs: str | None = found.outputs
        self.steps: dict[str, dict[str, Any]] = found.steps  # only their `do` is checked so far
        self.checks: dict[str, Any] = found.check or {}  # of all steps that do not say otherwise
        self.rules = tuple(
            AssetRule(
                index=index,
                name=rule.name,
                inputs=rule.inputs or {},
                steps=None if rule.steps is None else tuple(rule.steps),
                options=rule.options or {},
            )
            for index, rule in enumerate(found.assets)
        )

    @cached_property
    def folder(self) -> Path:
        """Folder of the build; raises `FileError` where it is not in that of the file."""
        return folder_beside(self.path, self._folder)

    def fault(self, steps: tuple[int | str, ...], what: str) -> FileFormatError:
        """Return an error with file, line and key: `a.toml:12: steps.low.size: what`."""
        place = place_of(steps)
        return FileFormatError(f"{self._where(place)}: {place}: {what}")

    def step(self, name: str, rule: AssetRule) -> StepTable:
        """Return a step with the options that the assets of a rule have for it."""
        key = (name, rule.index if name in rule.options else -1)
        if key not in self._checked:
            self._checked[key] = self._check(name, rule.options.get(name, {}), rule.index)
        return self._checked[key]

    def _check(self, name: str, own: Mapping[str, Any], rule: int) -> StepTable:
        kind = STEP_KINDS[self.steps[name]["do"]]
        shared = self.checks if kind.name == "check" else {}
        table = {**shared, **self.steps[name], **own}
        try:
            values = model_of(kind).model_validate(table).set_values()
            settings = kind.settings(values)
        except (ValidationError, OptionError) as error:
            if isinstance(error, ValidationError):
                what = first_error(error)
            else:
                what = option_error((), error)
            key = what.partition(":")[0].partition(".")[0].partition("[")[0]
            where: tuple[int | str, ...] = ("steps", name)
            if key in own:
                where = ("assets", rule, "options", name)
            elif key in shared and key not in self.steps[name]:
                where = ("check",)
            place = place_of(where)
            raise FileFormatError(f"{self._where(f'{place}.{key}')}: {place}.{what}") from error
        inputs = {
            role.name: [values[role.name]]
            if isinstance(values[role.name], str)
            else list(values[role.name])
            for role in kind.inputs
            if role.name in values
        }
        return StepTable(
            name=name,
            kind=kind,
            settings=settings,
            inputs=inputs,
            after=tuple(values.get("after", ())),
            output=values.get("output"),
            pipeline=self,
        )

    def _where(self, place: str) -> str:
        line = line_of(self._text, place)
        return str(self._called) if line is None else f"{self._called}:{line}"


def read_pipeline(path: PathLike) -> Pipeline:
    """Read and check a pipeline file."""
    data = read_bytes(path)
    try:
        text = data.decode("utf-8-sig")
        content = toml_content(path, text)
    except UnicodeDecodeError as error:
        raise FileFormatError(f"{path}: it is not a pipeline file: it is not UTF-8 text") from error
    try:
        found = PipelineTable.model_validate(content)
    except ValidationError as error:
        what = first_error(error)
        line = line_of(text, what.partition(": ")[0])
        where = path if line is None else f"{path}:{line}"
        raise FileFormatError(f"{where}: {what}") from error
    pipeline = Pipeline(path, text, found)
    _check_names(pipeline)
    return pipeline


def _check_names(pipeline: Pipeline) -> None:
    """Raise where a rule names an unknown step, or an input has the name of a step."""
    for rule in pipeline.rules:
        place = ("assets", rule.index)
        for number, name in enumerate(rule.steps or ()):
            if name not in pipeline.steps:
                raise pipeline.fault(
                    (*place, "steps", number),
                    f"no step {quoted(name)}; {nearest(name, pipeline.steps)}",
                )
        for name in rule.options:
            if name not in pipeline.steps:
                raise pipeline.fault(
                    (*place, "options", name), f"no such step; {nearest(name, pipeline.steps)}"
                )
        for name in rule.inputs:
            if name in pipeline.steps:
                raise pipeline.fault(
                    (*place, "inputs", name), "a step has the same name; rename one of them"
                )
        if not rule.inputs and rule.name is None:
            raise pipeline.fault(place, "it has neither inputs nor a name; give one of them")


def _word(value: Any) -> str:
    if not isinstance(value, str) or not value or any(sign in value for sign in "./\\{}"):
        raise validation_error(
            f"{format_value(value)} is not a name; use one without . / \\ and braces"
        )
    return value


def _check_not_empty(items: Any) -> Any:
    if not items:
        raise validation_error("it is empty; a pipeline needs at least one asset and one step")
    return items


def _step(value: Any) -> Any:
    if not isinstance(value, dict):
        raise validation_error(f"{format_value(value)} is not a table; give one with: do = ...")
    if "do" not in value:
        raise key_error("do", f"it is missing; it is one of {', '.join(STEP_KINDS)}")
    if value["do"] not in STEP_KINDS:
        advice = nearest(str(value["do"]), STEP_KINDS)
        raise key_error("do", f"{format_value(value['do'])} is not a kind of step; {advice}")
    return value


Word = Annotated[str, BeforeValidator(_word)]
AssetTable: type[Table] = create_model(
    "Asset",
    __base__=Table,
    __doc__="One asset, or one for each file that its first input matches.",
    name=(
        described(Text, "Name of the asset; {stem} and {folder} of its first input are filled in."),
        None,
    ),
    inputs=(
        described(dict[Word, References], "Files of the asset by name, as paths or patterns."),
        None,
    ),
    steps=(described(References, "Steps that this asset needs; without it, all."), None),
    options=(
        described(
            dict[str, dict[str, Any]], "Options of steps that differ for this asset, by step."
        ),
        None,
    ),
)
PipelineTable: type[Table] = create_model(
    "PipelineFile",
    __base__=Table,
    __doc__="A pipeline: its assets, and the steps that each of them goes through.",
    folder=(described(Text, f"Folder of the outputs; without it, {FOLDER}."), None),
    store=(described(Text, "Folder or URL of stored results."), None),
    outputs=(described(Text, "Folder or URL of published outputs."), None),
    check=(described(dict[str, Any], "Options of all steps that check, such as `allow`."), None),
    assets=(described(list_of(AssetTable, _check_not_empty), "The assets to build."), ...),
    steps=(
        described(
            Annotated[
                dict[Word, Annotated[Any, BeforeValidator(_step)]], AfterValidator(_check_not_empty)
            ],
            "The steps by name.",
        ),
        Field(default=...),
    ),
)


@cache
def model_of(kind: StepKind) -> type[Table]:
    """Return the model of the tables of a kind of step."""
    roles = {
        role.name: described(
            References if role.many else Text,
            "Inputs of the asset, or outputs of other steps."
            if role.many
            else "An input of the asset, or an output of another step.",
        )
        for role in kind.inputs
    }
    common = {
        "do": described(Text, "What the step does."),
        "after": described(References, "Steps that must have succeeded before."),
        "output": described(Text, "Names of the files that are published, as a pattern."),
    }
    return table(
        kind.options,
        name=kind.name,
        without=kind.without,
        required=(*kind.required, *(role.name for role in kind.inputs if role.required)),
        more={**common, **roles},
    )


def pipeline_schema() -> JsonSchema:
    """JSON Schema of pipeline files, draft 2020-12, for editors to complete and check them by."""
    schema = file_schema(PipelineTable, "texbake pipeline")
    kinds = []
    for kind in STEP_KINDS.values():
        step = model_of(kind).model_json_schema(schema_generator=FileSchema)
        step["description"] = f"{kind.does[:1].upper()}{kind.does[1:]}."
        step["properties"]["do"] = {"const": kind.name, "description": step["description"]}
        step["required"] = sorted({"do", *step.get("required", ())})
        kinds.append(step)
    schema["properties"]["steps"]["additionalProperties"] = {"oneOf": kinds}
    return schema


def schema_file(schema: JsonSchema, output: PathLike) -> JobResult[JsonSchema]:
    """Write a JSON Schema to a file."""
    check_writable(output)
    with replacing(output) as partial:
        partial.write_text(json.dumps(schema, indent=2) + "\n", encoding="utf-8")
    return JobResult(files=(Path(output),), report=schema)
