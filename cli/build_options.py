"""What `texbake build` and `texbake watch` both take; received as `options`, a `BuildOptions`."""

from __future__ import annotations

import functools
from dataclasses import fields
from typing import Any, cast

import click

from texbake.building.options import BuildOptions

from .options import Command, Decorator, number_option, output_folder

_OPTIONS: tuple[Decorator[Any], ...] = (
    click.option(
        "--only",
        multiple=True,
        metavar="ASSET",
        help="Build this asset, or those that a pattern such as 'orange*' matches; repeatable.",
    ),
    number_option(
        "--jobs",
        int,
        BuildOptions.jobs,
        "N",
        "Steps that run at once, each in a process of its own.  [default: one a processor]",
    ),
    number_option(
        "--threads",
        int,
        BuildOptions.threads,
        "N",
        "Threads of each step.  [default: the processors shared out among the jobs]",
    ),
    number_option(
        "--max-memory",
        str,
        BuildOptions.max_memory,
        "SIZE",
        "Memory that all running steps may be estimated to take, such as 8G; one that needs more "
        "runs alone.  [default: four fifths of the machine's]",
    ),
    click.option(
        "--scheduler",
        metavar="ADDRESS",
        help="Run the steps on the workers of a Dask scheduler, such as tcp://host:8786.",
    ),
    output_folder("Folder of what is built.  [default: what the file says, else build]"),
)


def build_options(command: Command) -> Command:
    """Add the options of a build."""

    @functools.wraps(command)
    def with_options(*args: Any, output: Any, **values: Any) -> None:
        names = [field.name for field in fields(BuildOptions) if field.name in values]
        chosen = {name: values.pop(name) for name in names}
        command(*args, options=BuildOptions(folder=output, **chosen), **values)

    wrapped: Any = with_options
    for option in reversed(_OPTIONS):
        wrapped = option(wrapped)
    return cast(Command, wrapped)
