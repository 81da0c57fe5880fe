"""Commands made from the verbs of the library, and their help: many options in sections."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Mapping, Sequence
from inspect import cleandoc
from pathlib import Path
from typing import Any

import click

from texbake.schema import option_fields
from texbake.verbs.verb import Extra, Options, Reads, Verb, Writes, paths_of

from .messages import command_line
from .options import (
    FOLDER,
    IMAGE_SUFFIXES,
    MESH_SUFFIXES,
    SCENE_SUFFIXES,
    WRITABLE_MESH_SUFFIXES,
    Decorator,
    options_of,
    output_folder,
    output_option,
)
from .printers import PRINTERS
from .streams import format_options, standard_streams
from .terminal import Terminal, terminal_options
from .types import FileOf, Names, ViewParam

_ALL = "help_all"
_INDENT = 4
# Suffixes by the kinds of `Reads`.
_READ = {
    "mesh": MESH_SUFFIXES,
    "image": IMAGE_SUFFIXES,
    "scene": SCENE_SUFFIXES,
    "camera": (".toml", ".txt", *MESH_SUFFIXES),
    "shown": (*MESH_SUFFIXES, ".toml"),
}
# For each kind of output: the file suffixes, and the metavar on help pages.
_OUTPUT_KINDS = {
    "mesh": (WRITABLE_MESH_SUFFIXES, "FILE"),
    "image": (IMAGE_SUFFIXES, "FILE"),
    "images": (IMAGE_SUFFIXES, "DIR|PICTURE"),
    "picture": ((".png",), "FILE.png"),
    "drawing": ((".png", ".svg"), "FILE"),
    "report": ((".json",), "FILE.json"),
    "hits": ((".npz",), "FILE.npz"),
    "page": ((".html",), "FILE.html"),
}


def command_of(verb: Verb) -> click.Command:
    """Return the command of a verb."""

    def command(terminal: Terminal, **values: Any) -> None:
        with standard_streams(verb, values) as named, terminal.progress() as progress:
            makers: dict[str, Callable[[], Any]] = {
                "progress": lambda: progress, "command": command_line, "clock": terminal.clock,
            }  # fmt: skip
            context = {name: make() for name, make in makers.items() if verb.takes(name)}
            result = verb.run(**_arguments(verb, named), **context)
        for warning in result.warnings:
            terminal.warn(warning)
        show = PRINTERS.get(verb.name)
        if show is None:
            terminal.summary(verb.table(result))
            files = paths_of(result.files)
            if named.get("output") == values.get("output"):
                terminal.wrote(files)
            elif beside := ", ".join(path.name for path in files[1:]):
                terminal.warn(f"standard output: left out {beside}; only the mesh is written")
        elif exit_code := show(terminal, result, values):
            click.get_current_context().exit(exit_code)

    command.__doc__ = verb.help
    add: Callable[..., Any] = terminal_options(command)
    for part in reversed(verb.parts):
        add = _parameter(verb, part)(add)
    examples = textwrap.indent(cleandoc(verb.examples), "      ")
    made = click.command(
        verb.name,
        cls=SectionedCommand,
        sections=verb.sections,
        common=verb.common,
        epilog=f"\n    \b\n    Example:\n{examples}\n    ",
    )(add)
    made.params += format_options(verb)
    return made


def _arguments(verb: Verb, values: dict[str, Any]) -> dict[str, Any]:
    """Return the arguments of the function, with its options as one object."""
    arguments = verb.prepare(values)
    for kind in {part.kind for part in verb.of_kind(Options) if not part.apart}:
        names = [item.name for item in option_fields(kind) if item.name in arguments]
        arguments["options"] = kind(**{name: arguments.pop(name) for name in names})
    return {name: value for name, value in arguments.items() if verb.takes(name)}


def _parameter(verb: Verb, part: Any) -> Decorator[Any]:
    """Return the argument or the options of a part."""
    if isinstance(part, Options):
        return options_of(part.kind, *part.names, **part.more)
    if isinstance(part, Extra):
        more = dict(part.more)
        if "choices" in more:
            more["type"] = click.Choice(more.pop("choices"))
        if "names" in more:
            more |= {"type": Names(more.pop("names")), "default": ()}
        for name, kind in (("is_folder", FOLDER), ("is_view", ViewParam())):
            if more.pop(name, False):
                more["type"] = kind
        if not part.flag.startswith("-"):
            return click.argument(part.flag, **more)
        return click.option(*part.flag.split(), help=part.help, **more)
    if isinstance(part, Reads):
        return _input(part)
    return _output(verb, part)


def _input(part: Reads) -> Decorator[Any]:
    kind = FileOf(part.suffixes or _READ[part.kind])
    if part.argument:
        return click.argument(part.name, type=kind, required=False)
    if part.required:
        many: dict[str, Any] = {"nargs": -1, "required": True} if part.many else {}
        return click.argument(part.name, type=kind, metavar=part.metavar, **many)
    flags = part.flags or (f"--{part.name.replace('_', '-')}",)
    metavar = part.metavar or part.kind.upper()
    return click.option(
        *flags, part.name, type=kind, metavar=metavar, help=part.help, multiple=part.many
    )


def _output(verb: Verb, part: Writes) -> Decorator[Any]:
    suffixes, metavar = _OUTPUT_KINDS.get(part.kind, ((), "DIR"))
    kind: click.Path = FileOf(part.suffixes or suffixes)
    if part.kind == "folder":
        kind = FOLDER
    elif part.like:
        kind, metavar = click.Path(path_type=Path), "FILE|DIR"
    metavar = part.metavar or metavar
    if part.name != "output":
        flag = f"--{part.name.replace('_', '-')}"
        return click.option(flag, part.name, type=kind, metavar=metavar, help=part.help)
    if part.default is not None:
        return output_folder(part.help, default=part.default, show_default=True)
    many = [item.name for item in verb.of_kind(Reads) if item.many and item.required]
    after = many[0] if many else None
    return output_option(kind, metavar, part.help, after=after, required=part.required)


class SectionedCommand(click.Command):
    """A command whose help shows examples first, then options by section, all in `--help-all`."""

    def __init__(
        self, *args: Any, sections: Mapping[str, Sequence[str]], common: Sequence[str], **extra: Any
    ) -> None:
        super().__init__(*args, **extra)
        self._sections, self._common = sections, common
        if sections:
            self.params.append(
                click.Option(
                    ["--help-all"],
                    is_flag=True,
                    is_eager=True,
                    expose_value=False,
                    callback=_show_all,
                    help="Describe all options and exit.",
                )
            )

    def format_help(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the usage, what the command does, its examples and its options."""
        self.format_usage(ctx, formatter)
        self.format_help_text(ctx, formatter)
        self.format_epilog(ctx, formatter)
        self.format_options(ctx, formatter)

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the sections."""
        options = {
            param.name: param for param in self.get_params(ctx) if isinstance(param, click.Option)
        }
        in_sections = {name for names in self._sections.values() for name in names}
        is_whole = ctx.meta.get(_ALL) or not self._sections
        hidden = in_sections.difference(() if is_whole else self._common)
        described: dict[str, Sequence[str]] = {
            "Options": [name for name in options if name not in hidden]
        }
        if is_whole:
            described |= self._sections
        for heading, names in described.items():
            records = [record for name in names if (record := options[name].get_help_record(ctx))]
            with formatter.section(heading):
                formatter.write_dl(records)
        if not is_whole:
            self._name_others(formatter, options, hidden)

    def _name_others(
        self, formatter: click.HelpFormatter, options: Mapping[Any, click.Option], hidden: set[str]
    ) -> None:
        """Write the flags of options that are not described, by section."""
        formatter.write("\nMore options, which --help-all describes:\n")
        for heading, names in self._sections.items():
            flags = ", ".join(max(options[name].opts, key=len) for name in names if name in hidden)
            indent = " " * _INDENT
            lines = textwrap.wrap(
                flags,
                formatter.width,
                initial_indent=indent,
                subsequent_indent=indent,
                break_on_hyphens=False,
            )
            formatter.write("\n".join([f"  {heading}:", *lines, ""]))


def _show_all(ctx: click.Context, _option: click.Parameter, is_asked: bool) -> None:
    if is_asked:
        ctx.meta[_ALL] = True
        click.echo(ctx.get_help())
        ctx.exit()
