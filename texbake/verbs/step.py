"""A kind of step: its inputs and options, the files it makes, and the job that makes them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Annotated, Any

from texbake.progress import StageRecord
from texbake.records import dataclass
from texbake.schema import Option
from texbake.verbs.verb import Options, Reads, Verb, declarations

Settings = dict[str, Any]
Sizes = Mapping[str, tuple["InputSize", ...]]

# Formats of files that steps write.
MESH_FORMATS = ("obj", "ply", "glb", "stl", "off")
IMAGE_FORMATS = ("png", "exr", "tif", "tga")
FORMAT_OF_MESH = Option("Format of the mesh files.", choices=MESH_FORMATS)
FORMAT_OF_IMAGE = Option("Format of the images.", choices=IMAGE_FORMATS)
# Figures of memory were measured as the highest resident memory of worker processes and rounded up:
# a step that is overestimated waits a little longer, one that is underestimated may exhaust the
# machine. Bytes per triangle of a mesh that is read:
READ_FACE = 130
# ... and of floats per byte of a compressed image that is decoded.
DECODED = 40
# Figures that depend on the machine and the moment.
_UNSTEADY = frozenset({"stages", "seconds", "threads", "max_memory", "budget"})


@dataclass(frozen=True)
class InputSize:
    """The size of an input, as far as it is known without reading it."""

    n_bytes: int  # length of the file
    n_faces: int  # about how many triangles; 0 for files that are not meshes


@dataclass(frozen=True, kw_only=True)
class Job:
    """One step of one asset, to be run."""

    settings: Settings  # all options, as `StepKind.settings` returns them
    inputs: Mapping[str, tuple[Path, ...]]  # by role; a role that was not given is missing
    # Path of each output, all in one empty folder. An output without a suffix is a folder, which
    # the step makes.
    outputs: Mapping[str, Path]
    threads: int  # no result may depend on it
    # bytes that the step should not exceed if it can avoid it; no result may depend on it
    most_memory: int | None = None
    asset: str = ""  # name of the asset; only kinds with `names_asset` may use it

    def input(self, role: str) -> Path | None:
        """Return the only file of a role, or None where it was not given."""
        files = self.inputs.get(role, ())
        return files[0] if files else None

    def file(self, role: str) -> Path:
        """Return the only file of a role that must be given."""
        return self.inputs[role][0]


@dataclass(frozen=True, kw_only=True, eq=False)
class StepKind:
    """A kind of step."""

    name: str  # what `do` says in a pipeline file
    does: str  # one line for a table of all kinds
    options: type  # dataclass of its options, which checks them; it imports no numpy
    inputs: tuple[Reads, ...]
    # Takes settings and returns the files that the step makes, name to file name. A reference to
    # the step alone means the first. A file name without a suffix is a folder.
    outputs: Callable[[Settings], dict[str, str]]
    # Runs a `Job` and returns figures of it as plain values for JSON; imports heavy modules when it
    # is called. It raises `TexbakeError` where the asset is at fault.
    run: Callable[[Job], dict[str, Any]]
    # takes settings and sizes of the inputs and estimates the most bytes that the step holds
    memory: Callable[[Settings, Sizes], int]
    # fields of that class that are not options in a pipeline: files, which are `inputs`, and
    # `threads`
    without: tuple[str, ...] = ("threads",)
    required: tuple[str, ...] = ()  # fields that must be given although they have a default
    # raises `OptionError` where settings contradict the roles that are given
    check: Callable[[Settings, frozenset[str]], None] | None = None
    revision: int = 1  # incremented whenever the same settings give other results than before
    names_asset: bool = False  # whether the result contains the name of the asset

    @property
    def choices(self) -> list[str]:
        """Keys of its settings."""
        return [item.name for item in fields(self.options) if item.name not in self.without]

    def settings(self, given: Mapping[str, Any]) -> Settings:
        """Return every option, defaults included, as plain values for JSON."""
        chosen = {name: given[name] for name in self.choices if name in given}
        values = asdict(self.options(**chosen))
        settings = {name: to_jsonable(values[name]) for name in self.choices}
        if self.check is not None:
            self.check(settings, frozenset(role.name for role in self.inputs if role.name in given))
        return settings

    def made(self, settings: Settings, **more: Any) -> Any:
        """Return an instance of `options` from settings and from fields that are not settings."""
        return self.options(
            **{name: lists_to_tuples(settings[name]) for name in self.choices}, **more
        )


def step_of(
    function: Callable[..., Any],
    *,
    does: str,
    outputs: Callable[[Settings], dict[str, str]],
    memory: Callable[[Settings, Sizes], int],
    figures: Callable[[Any], dict[str, Any]] | None = None,
    options: type | None = None,
    format: tuple[Option, str] | None = None,  # noqa: A002
    prepare: Callable[[Job], dict[str, Any]] | None = None,
    **more: Any,
) -> StepKind:
    """Return the kind of step of a verb.

    It runs the function of the verb and takes `figures` of its result, unless `run` is given. Its
    options are those of the verb and, if `format` is given, a format with a default. `prepare`
    returns parameters of the function that are not inputs or settings of the same name; by default,
    `output` is the only output. `more` are further fields of `StepKind`.
    """
    verb: Verb = function.verb  # type: ignore[attr-defined]
    base = options or next(part.kind for part in verb.of_kind(Options) if not part.apart)
    if format is not None:
        values = {
            "__doc__": base.__doc__,
            "__annotations__": {"format": Annotated[str, format[0]]},
            "format": format[1],
        }
        base = dataclass(frozen=True, kw_only=True)(type(base.__name__, (base,), values))
    parts = {part.role or part.name: part for part in verb.of_kind(Reads) if part.role is not None}

    def run(job: Job) -> dict[str, Any]:
        arguments: dict[str, Any] = {
            part.name: job.inputs[role] if part.many else job.file(role)
            for role, part in parts.items()
            if role in job.inputs
        }
        alone = {**job.settings, "threads": job.threads, "mtl": False}
        arguments |= {name: value for name, value in alone.items() if name in verb.parameters}
        if prepare is None:
            (arguments["output"],) = job.outputs.values()
        else:
            arguments |= prepare(job)
        if "options" in verb.parameters:
            named = {item.name for item in fields(base)} - arguments.keys()
            threads = {"threads": job.threads} if "threads" in named else {}
            arguments.setdefault("options", kind.made(job.settings, **threads))
        assert figures is not None
        return figures(function(**arguments))

    more.setdefault("inputs", tuple(replace(part, name=role) for role, part in parts.items()))
    kind = StepKind(
        name=verb.name, does=does, options=base, outputs=outputs, memory=memory,
        **{"run": run, **more},
    )  # fmt: skip
    return kind


def find_step(name: str) -> StepKind:
    """Return a kind of step by its name, importing only the module of its verb."""
    found = (each for each in declarations(name) if isinstance(each, StepKind))
    return next(kind for kind in found if kind.name == name)


def n_faces(sizes: Sizes, *roles: str) -> int:
    """About how many triangles the inputs of some roles have."""
    return sum(size.n_faces for role in roles for size in sizes.get(role, ()))


def n_texels(settings: Settings) -> int:
    """How many texels a texture of the `size` in settings has."""
    side = settings["size"]
    return int(side[0] * side[1] if isinstance(side, list) else side * side)


def n_bytes(sizes: Sizes, *roles: str) -> int:
    """How long the files of some roles are."""
    return sum(size.n_bytes for role in roles for size in sizes.get(role, ()))


def to_jsonable(value: Any) -> Any:
    """Return a value as JSON has it: tuples become lists."""
    if isinstance(value, Mapping):
        return {key: to_jsonable(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [to_jsonable(item) for item in value]
    return value


def lists_to_tuples(value: Any) -> Any:
    """Return a value of JSON as options classes have it: lists become tuples."""
    if isinstance(value, dict):
        return {key: lists_to_tuples(item) for key, item in value.items()}
    return tuple(map(lists_to_tuples, value)) if isinstance(value, list) else value


def without_timings(report: Any) -> Any:
    """Return a report without times and threads, so that the same inputs give the same bytes."""
    if isinstance(report, Mapping):
        return {
            key: without_timings(value) for key, value in report.items() if key not in _UNSTEADY
        }
    if isinstance(report, list | tuple):
        return [without_timings(value) for value in report]
    return report


def stage_seconds(stages: list[StageRecord]) -> dict[str, float]:
    """Return the seconds of each stage, by its name."""
    return {stage.name: stage.seconds for stage in stages}
