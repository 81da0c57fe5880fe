"""Help of a command: examples first, then the options; many options in sections."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import click

_ALL = "help_all"
_INDENT = 4


class SectionedCommand(click.Command):
    """A command whose options stand under headings in its help.

    With sections, `--help` describes the options without a section and the `common` ones, and names
    the others; `--help-all` describes all of them.
    """

    def __init__(
        self,
        *args: Any,
        sections: Mapping[str, Sequence[str]],
        common: Sequence[str],
        **extra: Any,
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
