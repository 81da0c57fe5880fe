"""Flags of commands, created from the option classes of the library.

An option class declares each option once: type, default, range, choices, help. This module turns
its fields into flags of a command, which receives the values under the names of the fields. Other
options that several commands share, such as the file of a report, are declared here as well.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar, get_args, get_origin

import click

from texbake.limits import whole_number
from texbake.mesh.files import (
    MESH_SUFFIXES as MESH_SUFFIXES,
    WRITABLE_MESH_SUFFIXES as WRITABLE_MESH_SUFFIXES,
)
from texbake.schema import OptionField, option_fields

from .types import NameAndStrength, Names, Numbers, Size, WholeNumbers

Command = TypeVar("Command", bound=Callable[..., Any])
Decorator = Callable[[Command], Command]

FOLDER = click.Path(path_type=Path, file_okay=False)
IMAGE_SUFFIXES = (".exr", ".hdr", ".jpg", ".jpeg", ".png", ".ppm", ".tga", ".tif", ".tiff")
SCENE_SUFFIXES = (".toml", ".glb", ".gltf")


def options_of(
    kind: type,
    *names: str,
    without: Collection[str] = (),
    required: Collection[str] = (),
    unset: bool = False,
    only_given: bool = False,
    defaults: Mapping[str, Any] | None = None,
) -> Decorator[Any]:
    """Add flags for fields in order; with `unset` or `only_given`, those left out are None."""
    fields = {field.name: field for field in option_fields(kind)}
    chosen = [fields[name] for name in names] or [
        field for field in fields.values() if field.name not in without
    ]
    return all_of(
        [
            _flag(
                replace(field, default=(defaults or {}).get(field.name, field.default)),
                required=field.name in required or field.required,
                unset=unset,
                only_given=only_given,
            )
            for field in chosen
        ]
    )


def all_of(options: Sequence[Decorator[Any]]) -> Decorator[Any]:
    """Add several options, in their order."""

    def add(command: Command) -> Command:
        for option in reversed(options):
            command = option(command)
        return command

    return add


def _flag(field: OptionField, *, required: bool, unset: bool, only_given: bool) -> Decorator[Any]:
    """Return the flag of one option."""
    option = field.option
    names = [option.flag or f"--{field.name.replace('_', '-')}", field.name]
    text = option.sentence
    if option.many and option.choices:
        text = f"{text} {', '.join(option.choices)}."
    default = None if unset or required else field.default
    if option.default and (field.optional or option.many) and not unset:
        text += f"  [default: {option.default}]"
    if field.kinds == (bool,):
        alone = "/" not in names[0]
        shown = None if field.optional or unset else default
        return click.option(
            *names, is_flag=True, default=shown, show_default=not alone and not unset, help=text
        )
    kind = _type(field)
    if isinstance(kind, Names):
        text = f"{text.rstrip('.')}: {', '.join(kind.known)}."
    if option.many:
        default = None
    elif isinstance(default, tuple):
        default = ("x" if isinstance(kind, Size) else ",").join(
            f"{v:g}" if isinstance(v, float) else str(v) for v in default
        )
    if only_given and default is not None:
        text, default = f"{text}  [default: {default}]", None
    # For click a default of None is one, and the option would never be missing.
    requirement = {"required": True} if required else {"default": default}
    return click.option(
        *names,
        type=kind,
        **requirement,
        multiple=option.many,
        show_default=default is not None,
        metavar=_metavar(field),
        help=text,
    )


def _type(field: OptionField) -> Any:
    """Return the click type that parses the values of an option."""
    kinds, words = field.kinds, field.option.choices
    tuples = [kind for kind in kinds if get_origin(kind) is tuple]
    if tuple[int, int] in tuples:
        return Size()
    if tuple[str, ...] in tuples:
        if field.option.many:
            return click.Choice(words) if words else str
        return Names(words)
    if tuple[int, ...] in tuples:
        return int if field.option.many else WholeNumbers()
    if tuple[str, float] in tuples:
        return NameAndStrength(words)
    if tuples and all(set(get_args(kind)) & {float, int} for kind in tuples):
        return Numbers(field.option.metavar or "", words)
    if words and kinds == (str,):
        return click.Choice(words)
    if str in kinds:
        return number_or_word if int in kinds and words else str
    return next((kind for kind in (int, float) if kind in kinds), str)


def _metavar(field: OptionField) -> str | None:
    words = field.option.choices
    if words and not field.option.metavar and field.kinds != (str,):
        return "|".join(map(str, words))
    return field.option.metavar if not isinstance(_type(field), Numbers | NameAndStrength) else None


def number_or_word(text: str | int) -> int | str:
    """Parse a number and leave words unchanged; the option class checks them."""
    number = whole_number(str(text))
    return text if number is None else number


class _Output(click.Option):
    """`-o`, which may be left out if the last argument is the output's name."""

    def __init__(self, *names: Any, after: str | None = None, **options: Any) -> None:
        # Eager, so that the output is split off the inputs before they are converted.
        super().__init__(*names, is_eager=True, **options)
        self._after = after

    def handle_parse_result(
        self, ctx: click.Context, opts: Mapping[str, Any], args: list[str]
    ) -> tuple[Any, list[str]]:
        """Take the name from the last argument; raise `UsageError` if there are two names."""
        assert self.name is not None and isinstance(opts, dict)
        named, last = self.name in opts, opts.get(self._after or _LAST)
        if self._after is not None and isinstance(last, tuple):
            if named or len(last) < 2:
                last = None
            elif os.path.exists(last[-1]):  # noqa: PTH110  # no error for a name that is too long
                raise click.UsageError(f"{last[-1]} exists; name the output with -o", ctx)
            else:
                opts[self._after], last = last[:-1], last[-1]
        if isinstance(last, str):
            if named:
                raise click.UsageError(f"two outputs are named: {opts[self.name]} and {last}", ctx)
            opts[self.name] = last
        return super().handle_parse_result(ctx, opts, args)


_LAST = "last_argument"


def output_option(
    kind: click.Path, metavar: str, text: str, *, after: str | None = None, **extra: Any
) -> Decorator[Any]:
    """Add `-o`, whose value may instead be the last argument."""
    option = click.option(
        "-o", "--output", cls=_Output, after=after, type=kind, metavar=metavar, help=text, **extra
    )
    if after is not None:
        return option
    last = click.argument(_LAST, required=False, type=kind, metavar="[OUTPUT]", expose_value=False)
    return all_of((last, option))


def output_folder(text: str, **extra: Any) -> Decorator[Any]:
    """Add `-o DIR`, which may be left out."""
    return click.option("-o", "--output", type=FOLDER, metavar="DIR", help=text, **extra)
