"""The declaration of a verb: its files and options, around the function that does it.

The function takes paths and options and returns a `JobResult`. From its declaration come the checks
of its outputs, its report, the command (`texbake_cli.verbs`), the kind of step
(`texbake.verbs.step`) and the reference pages. This module and those of the verbs import nothing
heavy: what a verb needs is imported when it runs.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, replace
from functools import cached_property, wraps
from importlib import import_module
from importlib.util import find_spec
from inspect import Parameter, cleandoc, signature
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, cast

from texbake.files import appearing_together, check_folder, make_folder
from texbake.records import dataclass
from texbake.schema import THREADS_OPTION, option

if TYPE_CHECKING:
    from texbake.jobs.outputs import JobResult

Function = TypeVar("Function", bound=Callable[..., Any])
Rows = list[tuple[str, str]]

# Modules that define several verbs; the module of every other verb has its name.
_MODULES = {
    "map_bakes": ("bake-normals", "bake-displacement", "remap"),
    "texture_bakes": ("bake-texture", "bake-lightmap"),
    "channels": ("pack-channels", "split-channels"),
    "conversions": ("height-to-normal", "normal-to-height", "mipmap", "cubemap"),
    "meshes": ("repair", "transform", "convert", "remesh", "cage"),
    "whole_jobs": ("run", "lighten", "demo"),
}


@dataclass(frozen=True)
class Reads:
    """A file that a verb reads: an argument of the command, or an option if it is not required."""

    name: str  # parameter of the function
    kind: str = "mesh"  # `mesh`, `image`, `scene`, `camera`, or another with `suffixes` of its own
    help: str = ""
    _: KW_ONLY
    required: bool = True
    many: bool = False
    # its key in a pipeline file; "" for `name`, None where a step does not take it
    role: str | None = ""
    suffixes: tuple[str, ...] = ()
    metavar: str | None = None
    flags: tuple[str, ...] = ()
    argument: bool = False  # whether it is an argument although it is not required


@dataclass(frozen=True)
class Writes:
    """A file that a verb writes; `output` is required, unless that is False or it has a default."""

    name: str  # parameter of the function
    # A key of `OUTPUT_CHECKS`. The function checks the format of an `image`, and all of `images`,
    # which are one or a folder.
    kind: str
    help: str
    _: KW_ONLY
    required: bool = True
    default: str | None = None
    over: str = ""  # the input that it may replace
    like: str = ""  # the inputs whose names it takes where they are several; then it is a folder
    suffixes: tuple[str, ...] = ()
    metavar: str | None = None


class Options:
    """Fields of a class of options, at this place of the help page; all of them, or some by name.

    The function takes the instance as `options`; fields that stand `apart` are parameters of its
    own. `more` are settings of the flags: `without`, `unset`, `only_given`, `defaults`.
    """

    def __init__(self, kind: type, *names: str, apart: bool = False, **more: Any) -> None:
        self.kind, self.names, self.apart, self.more = kind, names, apart, more


class Extra:
    """A parameter of the function that is in no class of options: a flag, or an argument.

    `more` is what `click.option` takes, and its type: `choices`, of which one is chosen, `names`,
    of which several are, `is_folder` or `is_view`.
    """

    def __init__(self, flag: str, help: str = "", **more: Any) -> None:  # noqa: A002
        self.flag, self.help, self.more = flag, help, more


@dataclass(frozen=True)
class _Threads:
    threads: int | None = option(None, THREADS_OPTION)


THREADS = Options(_Threads, "threads", apart=True)
REPORT = Writes("report", "report", "Also write every setting and figure as JSON.")
PAGE = Writes(
    "html", "page", "Also write an HTML page with the meshes, their maps, errors and times."
)


@dataclass(frozen=True, kw_only=True, eq=False)
class Verb:
    """A declaration."""

    name: str
    run: Callable[..., JobResult[Any]]  # the public function
    parts: tuple[Any, ...]  # files and options, in the order of the help page
    examples: str
    # options by headings of the help page; all others come first
    sections: Mapping[str, Sequence[str]]
    # options of sections that `--help` describes as well, because most people use them
    common: Sequence[str]
    table: Callable[[Any], Rows]  # makes rows of a label and a figure from the result
    # turns values of the command into parameters of the function
    prepare: Callable[[dict[str, Any]], dict[str, Any]]

    @property
    def help(self) -> str:
        """Help of the command: the docstring, but for its sections."""
        return cleandoc(self.run.__doc__ or "").partition("\n\nParameters\n")[0]

    @cached_property
    def parameters(self) -> Mapping[str, Parameter]:
        """Parameters of the function."""
        return signature(self.run).parameters

    def takes(self, name: str) -> bool:
        """Whether the function has a parameter of this name, or passes on any."""
        return name in self.parameters or any(
            item.kind is Parameter.VAR_KEYWORD for item in self.parameters.values()
        )

    def of_kind(self, kind: type) -> list[Any]:
        """Return the parts of a kind, such as `Reads`."""
        return [part for part in self.parts if isinstance(part, kind)]


def _table(result: JobResult[Any]) -> Rows:
    return result.report.table()  # type: ignore[no-any-return]


def verb(
    *parts: Any,
    examples: str,
    sections: Mapping[str, Sequence[str]] | None = None,
    common: Sequence[str] = (),
    table: Callable[[Any], Rows] = _table,
    prepare: Callable[[dict[str, Any]], dict[str, Any]] = dict,
) -> Callable[[Function], Function]:
    """Declare a verb around its function, whose docstring is the help of the command.

    The function keeps its signature. It has the name of the verb, with `_file` or `_files` at the
    end. Its outputs are checked before it runs and appear together; its report is written to
    the file `report`, if any. The other parameters are those of `Verb`.
    """

    def declare(run: Function) -> Function:
        names = signature(run)

        @wraps(run)
        def whole(*args: Any, **more: Any) -> Any:
            arguments = {**names.bind(*args, **more).arguments, **more}
            with appearing_together():
                inputs = _inputs(made, arguments)
                _check_files(made, arguments, inputs)
                return _reported(run(*args, **more), arguments.get("report"), inputs)

        made = Verb(
            name=re.sub("_files?$", "", run.__name__).replace("_", "-"), run=whole, parts=parts,
            examples=examples, sections=sections or {}, common=common, table=table,
            prepare=prepare,
        )  # fmt: skip
        whole.verb = made  # type: ignore[attr-defined]
        return cast(Function, whole)

    return declare


def declarations(name: str) -> list[Any]:
    """Return all values in the module of a verb, importing only that; none where there is none."""
    stem = next((stem for stem, verbs in _MODULES.items() if name in verbs), name.replace("-", "_"))
    module = f"texbake.verbs.{stem}"
    return [] if find_spec(module) is None else list(vars(import_module(module)).values())


def find_verb(name: str) -> Verb | None:
    """Return a verb by its name; None where there is none."""
    found = (value.verb for value in declarations(name) if hasattr(value, "verb"))
    return next((each for each in found if each.name == name), None)


def paths_of(value: Any) -> list[Path]:
    """Return the paths in a parameter: one, several, or those of a mapping."""
    if isinstance(value, str | os.PathLike):
        return [Path(value)]
    if isinstance(value, Mapping):
        return paths_of(list(value.values()))
    if isinstance(value, list | tuple):
        return [path for item in value for path in paths_of(item)]
    return []


def outputs_like(inputs: Any, output: Any) -> list[Path]:
    """Return the output itself for one input, and files with the names of several in a folder."""
    sources = paths_of(inputs)
    if len(sources) == 1:
        return paths_of(output)
    return [Path(output) / path.name for path in sources]


def _inputs(verb: Verb, arguments: Mapping[str, Any]) -> dict[str, list[Path]]:
    """Files that a verb reads, by the names of its parameters and options."""
    options = arguments.get("options")
    return {
        part.name: paths_of(arguments.get(part.name, getattr(options, part.name, None)))
        for part in verb.of_kind(Reads)
    }


def _check_files(
    verb: Verb, arguments: Mapping[str, Any], inputs: Mapping[str, list[Path]]
) -> None:
    """Raise where an output cannot be written, or is an input or another output as well."""
    from texbake.jobs.outputs import OUTPUT_CHECKS, check_distinct, check_mesh

    outputs: dict[Writes, list[Path]] = {}
    for part in verb.of_kind(Writes):
        output = arguments.get(part.name)
        outputs[part] = (
            outputs_like(arguments[part.like], output) if part.like else paths_of(output)
        )
    check_distinct([path for paths in outputs.values() for path in paths])
    folders = {path for part, paths in outputs.items() if part.kind == "folder" for path in paths}
    for part, paths in outputs.items():
        kept = [path for name, read in inputs.items() if name != part.over for path in read]
        check_distinct(paths, kept)
        if part.like and len(paths) > 1:
            check_folder(arguments[part.name])
            for path in paths:
                check_mesh(path, folder_is_made=True)
        # Files may be given in place of a folder for them.
        elif part.kind != "folder" or isinstance(arguments.get(part.name), str | os.PathLike):
            for path in paths:
                if path.parent in folders:
                    make_folder(path.parent)
                OUTPUT_CHECKS[part.kind](path)


def _reported(
    result: JobResult[Any], report: Any, inputs: Mapping[str, list[Path]]
) -> JobResult[Any]:
    """Write the report of a result and the files it is made from, if a file for it is given."""
    if report is None or Path(report) in result.files:
        return result
    from texbake.jobs.outputs import write_report

    files = {name: [str(path) for path in paths] for name, paths in inputs.items() if paths}
    write_report(report, {**result.to_json(), "inputs": files})
    return replace(result, files=(*result.files, Path(report)))
