"""Flags of commands, created from the option classes of the library.

An option class declares each option once: type, default, range, choices, help. This module turns
its fields into flags of a command, which receives the values under the names of the fields. Other
options that several commands share, such as the file of a report, are declared here as well.
"""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar, get_args, get_origin

import click
from click.core import ParameterSource

from texbake import BakeOptions, BuildOptions, RenderOptions
from texbake.limits import whole_number
from texbake.mesh.files import (
    MESH_SUFFIXES as MESH_SUFFIXES,
    WRITABLE_MESH_SUFFIXES as WRITABLE_MESH_SUFFIXES,
)
from texbake.schema import OptionField, option_field, option_fields
from texbake.verbs.verb import PAGE, REPORT

from .types import FileOf, NameAndStrength, Names, Numbers, Size, ViewParam

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
    defaults: Mapping[str, Any] | None = None,
) -> Decorator[Any]:
    """Add flags for the fields of an option class, in their order."""
    fields = {field.name: field for field in option_fields(kind)}
    chosen = [fields[name] for name in names] or [
        field for field in fields.values() if field.name not in without
    ]
    given = defaults or {}
    return all_of(
        [
            _flag(
                replace(field, default=given.get(field.name, field.default)),
                required=field.name in required or field.required,
                unset=unset,
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


def _flag(field: OptionField, *, required: bool, unset: bool) -> Decorator[Any]:
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
    # For click a default of None is one, and the option would never be missing.
    given = {"required": True} if required else {"default": default}
    return click.option(
        *names,
        type=kind,
        **given,
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
    if field.option.many and tuple[int, ...] in tuples:
        return int
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


def build_options(*, without: Collection[str] = ()) -> Decorator[Any]:
    """Add the options of a build; the command receives them as `options`, `BuildOptions`."""
    hidden = {"folder", *without}
    names = [field.name for field in option_fields(BuildOptions) if field.name not in hidden]
    folder = option_field(BuildOptions, "folder").option
    flags = (
        options_of(BuildOptions, *names),
        output_folder(f"{folder.help}  [default: {folder.default}]"),
    )

    def add(command: Command) -> Command:
        @functools.wraps(command)
        def with_options(*args: Any, output: Path | None, **values: Any) -> None:
            chosen = {name: values.pop(name) for name in names}
            command(*args, options=BuildOptions(folder=output, **chosen), **values)

        return all_of(flags)(with_options)  # type: ignore[no-any-return]

    return add


def mesh_argument(name: str) -> Decorator[Any]:
    """Add an argument that names a mesh file to read."""
    return click.argument(name, type=FileOf(MESH_SUFFIXES))


def image_option(flag: str, text: str) -> Decorator[Any]:
    """Add an option that names an image file to read."""
    return click.option(flag, type=FileOf(IMAGE_SUFFIXES), metavar="IMAGE", help=text)


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


def output_folder(text: str, *, required: bool = False, **extra: Any) -> Decorator[Any]:
    """Add `-o DIR`; if it is required, it may also be the last argument."""
    if required:
        return output_option(FOLDER, "DIR", text, required=True)
    return click.option("-o", "--output", type=FOLDER, metavar="DIR", help=text, **extra)


def picture_option(flag: str, text: str) -> Decorator[Any]:
    """Add an option that names an additional picture to write."""
    return click.option(flag, type=FileOf((".png",)), metavar="FILE.png", help=text)


report_option = click.option(
    "--report",
    type=FileOf((".json",)),
    metavar="FILE.json",
    help=REPORT.help,
)
html_option = click.option("--html", type=FileOf((".html",)), metavar="FILE.html", help=PAGE.help)
threads_option = options_of(BakeOptions, "threads")


_PICTURE = ("view", "up", "back_faces", "supersampling")
_PIXELS = click.option(
    "--size",
    type=Size(),
    default=f"{RenderOptions.width}x{RenderOptions.height}",
    show_default=True,
    help="Width and height of the picture in pixels.",
)


def picture_changes(command: Command) -> Command:
    """Add the options of a picture and a turntable; the command receives those given, as a dict.

    The scene file determines the others.
    """

    @functools.wraps(command)
    def with_changes(*args: Any, **options: Any) -> None:
        source = click.get_current_context().get_parameter_source
        picture = {name: options.pop(name) for name in ("size", *_PICTURE)}
        given = {
            name: value
            for name, value in picture.items()
            if source(name) not in (ParameterSource.DEFAULT, None)
        }
        size = given.pop("size", None)
        command(*args, picture={**({} if size is None else _sides(size)), **given}, **options)

    view = option_field(RenderOptions, "view")
    turns = click.option(
        "--view",
        type=ViewParam(),
        default=",".join(f"{angle:g}" for angle in RenderOptions.view if angle is not None),
        show_default=True,
        help=f"{view.option.help.rstrip('.')}; or a whole turn of N pictures.",
    )
    return all_of((_PIXELS, turns, options_of(RenderOptions, *_PICTURE[1:])))(with_changes)  # type: ignore[no-any-return]


def _sides(size: int | tuple[int, int]) -> dict[str, Any]:
    width, height = (size, size) if isinstance(size, int) else size
    return {"width": width, "height": height}
