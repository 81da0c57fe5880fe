"""What a kind of step is: what it takes, which choices it has, what it makes, and how."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator

from texbake.rendering.scene.file.faults import fault, shown
from texbake.rendering.scene.file.tables import Table, table
from texbake.rendering.scene.file.values import Text

Settings = dict[str, Any]
Sizes = Mapping[str, tuple["InputSize", ...]]


@dataclass(frozen=True)
class InputSize:
    """How large an input is, as far as that is known without reading it.

    Attributes
    ----------
    n_bytes : int
        Of the file.
    n_faces : int
        Triangles, about; 0 of what is no mesh.
    """

    n_bytes: int
    n_faces: int


@dataclass(frozen=True, kw_only=True)
class InputRole:
    """A file that a step takes.

    Attributes
    ----------
    name : str
        Its key in the pipeline file.
    required : bool
    many : bool
        Whether it is a list of one or more.
    """

    name: str
    required: bool = True
    many: bool = False


@dataclass(frozen=True, kw_only=True)
class Job:
    """One step of one asset, as its kind is asked to do it.

    Attributes
    ----------
    settings : dict
        All choices, as `StepKind.settings` gave them.
    inputs : dict of str to tuple of Path
        By role; a role that was not given is missing.
    outputs : dict of str to Path
        Where each output is to be put: all of them in one empty folder. One without suffix is a
        folder, which the step makes.
    threads : int
        To work with; no result may depend on it.
    most_memory : int, optional
        Bytes that it should keep to where it can; no result may depend on it.
    asset : str
        Its name; may be used only by kinds with `names_asset`.
    """

    settings: Settings
    inputs: Mapping[str, tuple[Path, ...]]
    outputs: Mapping[str, Path]
    threads: int
    most_memory: int | None = None
    asset: str = ""

    def input(self, role: str) -> Path | None:
        """Return the only file of a role, or None where it was not given."""
        files = self.inputs.get(role, ())
        return files[0] if files else None

    def file(self, role: str) -> Path:
        """Return the only file of a role that must be given."""
        return self.inputs[role][0]


@dataclass(frozen=True, kw_only=True)
class StepKind:
    """A kind of step.

    Attributes
    ----------
    name : str
        What `do` says in a pipeline file.
    does : str
        A line for a table of all kinds.
    options : type
        Dataclass of its choices, which checks them; it imports no numpy.
    without : tuple of str
        Fields of that class that are no choices in a pipeline: files, which are `inputs`, and
        `threads`.
    required : tuple of str
        Fields that must be given though they have a default.
    inputs : tuple of InputRole
    outputs : callable
        Settings to the files that the step makes: name to file name. The first is what a reference
        to the step alone means. A name without a suffix is a folder.
    run : callable
        Does a `Job` and returns figures of it, as plain values for JSON; imports what is heavy
        when it is called. It raises `TexbakeError` where the asset is at fault.
    memory : callable
        Settings and sizes of the inputs to the bytes that it is going to hold at most, about.
    check : callable, optional
        Raises `OptionError` where settings do not fit together with the roles that are given.
    revision : int
        Raised whenever the same settings give other results than before.
    names_asset : bool
        Whether the name of the asset is part of what it makes.
    """

    name: str
    does: str
    options: type
    inputs: tuple[InputRole, ...]
    outputs: Callable[[Settings], dict[str, str]]
    run: Callable[[Job], dict[str, Any]]
    memory: Callable[[Settings, Sizes], int]
    without: tuple[str, ...] = ("threads",)
    required: tuple[str, ...] = ()
    check: Callable[[Settings, frozenset[str]], None] | None = None
    revision: int = 1
    names_asset: bool = False
    model: type[Table] = field(init=False)

    def __post_init__(self) -> None:
        roles = {role.name: References if role.many else Text for role in self.inputs}
        common = {"do": Text, "after": References, "output": Text}
        model = table(
            self.options,
            name=self.name,
            without=self.without,
            required=(*self.required, *(role.name for role in self.inputs if role.required)),
            more={**common, **roles},
        )
        object.__setattr__(self, "model", model)

    @property
    def choices(self) -> list[str]:
        """Keys of its settings."""
        return [item.name for item in fields(self.options) if item.name not in self.without]

    def settings(self, given: Mapping[str, Any]) -> Settings:
        """Every choice, with defaults, as plain values for JSON.

        Parameters
        ----------
        given
            Keys of a checked table of this kind.

        Raises
        ------
        OptionError
            A value is not possible, or some do not fit together.
        """
        chosen = {name: given[name] for name in self.choices if name in given}
        values = asdict(self.options(**chosen))
        settings = {name: plain(values[name]) for name in self.choices}
        if self.check is not None:
            roles = frozenset(role.name for role in self.inputs if role.name in given)
            self.check(settings, roles)
        return settings

    def made(self, settings: Settings, **more: Any) -> Any:
        """Return the options that settings stand for, with fields that are no choices."""
        return self.options(**{name: tupled(settings[name]) for name in self.choices}, **more)


def plain(value: Any) -> Any:
    """Value as JSON has it: tuples become lists."""
    if isinstance(value, Mapping):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return value


def tupled(value: Any) -> Any:
    """Value of JSON as options classes have it: lists become tuples."""
    if isinstance(value, dict):
        return {key: tupled(item) for key, item in value.items()}
    return tuple(map(tupled, value)) if isinstance(value, list) else value


def _references(value: Any) -> Any:
    names = [value] if isinstance(value, str) else value
    if not isinstance(names, list) or not names or not all(isinstance(n, str) for n in names):
        raise fault(f"{shown(value)} is neither a name in quotes nor a list of some")
    return names


References = Annotated[list[str], BeforeValidator(_references)]
