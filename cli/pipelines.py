"""`texbake build`, `watch` and `schema`: the assets of a pipeline."""

from __future__ import annotations

import functools
import json
import sys
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import texbake
from texbake import BuildOptions, TexbakeError
from texbake.errors import counted
from texbake.progress import Stages
from texbake.schema import option_fields, option_of

from .messages import command_line
from .options import Command, Decorator, all_of, options_of, output_folder, output_option
from .signals import FAILED
from .terminal import Terminal, columns, complain, say, terminal_options
from .types import FileOf

if TYPE_CHECKING:
    from texbake.building.build import PlannedStep
    from texbake.building.report import BuildResult
    from texbake.building.schedule import BuildEvent, BuildListener

_MOST_SHOWN = 20  # failures; of further ones only the number is printed


def _build_options(*, without: Collection[str] = ()) -> Decorator[Any]:
    """Add the options of a build; the command receives them as `options`, `BuildOptions`."""
    hidden = {"folder", *without}
    names = [field.name for field in option_fields(BuildOptions) if field.name not in hidden]
    folder = option_of(BuildOptions, "folder")
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


@click.command(
    epilog="""
    \b
    Example:
      texbake build studio.toml
      texbake build studio.toml --plan
      texbake build studio.toml --jobs 8 --max-memory 24G
      texbake build studio.toml --only "orange*" --verify
      texbake build studio.toml --html build.html
      texbake build studio.toml --scheduler tcp://render-01:8786
    """
)
@click.argument("pipeline", type=FileOf((".toml",)), metavar="PIPELINE.toml")
@click.option("--plan", is_flag=True, help="Print what would run and why, and build nothing.")
@_build_options()
@click.option(
    "--html",
    type=FileOf((".html",)),
    metavar="FILE.html",
    help="Also write a page of all assets: pictures, errors, times, and links to their own pages.",
)
@terminal_options
@click.pass_context
def build(
    ctx: click.Context,
    pipeline: Path,
    plan: bool,
    html: Path | None,
    options: BuildOptions,
    terminal: Terminal,
) -> None:
    """Build the assets of a pipeline file.

    Only what changed runs again. An asset that fails does not stop the others; build.json in the
    folder says how each one ended. Exits with 1 if any failed.
    """
    if plan:
        from texbake.building.build import plan_build

        _print_plan(plan_build(pipeline, options), terminal)
        return
    with _show_progress(terminal) as listener, Stages().part("build"):
        result = texbake.build(
            pipeline, options, html=html, command=command_line(), listener=listener
        )
    _print_result(result, terminal)
    if html is not None:
        terminal.wrote([html])
    if not result.ok:
        ctx.exit(FAILED)


def _print_plan(steps: list[PlannedStep], terminal: Terminal) -> None:
    counts: dict[str, int] = {}
    for step in steps:
        counts[step.state] = counts.get(step.state, 0) + 1
    rows = [("asset", "step", "", "why")]
    rows += [(s.asset, s.step, s.state, s.why) for s in steps if s.state != "current" or s.why]
    if len(rows) > 1:
        columns(rows)
    terminal.summary([("steps", ", ".join(f"{n:,} {state}" for state, n in counts.items()))])


@contextmanager
def _show_progress(terminal: Terminal) -> Iterator[BuildListener]:
    """Show a build as a live table on a terminal or as JSON lines; yield its listener."""
    if terminal.kind == "json" and not terminal.quiet:
        yield _print_json
    elif terminal.kind == "auto" and not terminal.quiet and sys.stderr.isatty():
        from .live import BuildTable

        with BuildTable() as table:
            yield table.add
    else:
        yield lambda event: _print_note(event, terminal)


def _print_json(event: BuildEvent) -> None:
    sys.stderr.write(json.dumps(event.to_json()) + "\n")
    sys.stderr.flush()


def _print_note(event: BuildEvent, terminal: Terminal) -> None:
    if event.event == "note" and event.message and not terminal.quiet:
        complain(event.message)


def _print_result(result: BuildResult, terminal: Terminal) -> None:
    """Print the warnings, failures and figures of a build."""
    for asset in result.assets:
        for step in asset.steps:
            for note in step.notes:
                terminal.warn(f"{asset.name}: {step.step}: {note}")
    for asset in result.failed[:_MOST_SHOWN]:
        complain(f"{asset.name}: {asset.error}")
    if (n_more := len(result.failed) - _MOST_SHOWN) > 0:
        complain(f"{counted(n_more, 'more asset')} failed; build.json lists them")
    terminal.summary(result.table())
    terminal.wrote([result.folder / "build.json"])


@click.command(
    epilog="""
    \b
    Example:
      texbake watch studio.toml
      texbake watch studio.toml --only hero --jobs 1
    """
)
@click.argument("pipeline", type=FileOf((".toml",)), metavar="PIPELINE.toml")
@_build_options(without=("wait", "prune", "verify"))
@terminal_options
def watch(pipeline: Path, options: BuildOptions, terminal: Terminal) -> None:
    """Build again whenever a file changes, until Ctrl-C.

    Checks the pipeline file, and every file that it reads, twice a second.
    """
    from texbake.building.build import watch as watch_pipeline

    def built(result: BuildResult | TexbakeError) -> None:
        if isinstance(result, TexbakeError):
            complain(str(result))
        else:
            _print_result(result, terminal)
        if not terminal.quiet:
            say("watching ...")

    with _show_progress(terminal) as listener:
        watch_pipeline(pipeline, options, listener=listener, built=built)


@click.command(
    epilog="""
    \b
    Example:
      texbake schema scene -o scene.schema.json
      texbake schema pipeline
    """
)
@click.argument(
    "file", type=click.Choice(("pipeline", "scene", "bench")), metavar="pipeline|scene|bench"
)
@output_option(
    FileOf((".json",)), "FILE.json", "Write the schema to this file.  [default: print it]"
)
@terminal_options
def schema(file: str, output: Path | None, terminal: Terminal) -> None:
    """Print the JSON Schema of pipeline files, scene files or bench results.

    With it, an editor completes and checks TOML files as you type. In VS Code, install the
    extension Even Better TOML and put the line "#:schema scene.schema.json" at the top of a scene
    file.
    """
    if file == "bench":
        from texbake.study.bench.results_file import bench_schema as schema_of
    elif file == "scene":
        from texbake.rendering.scene.file.schema import scene_schema as schema_of
    else:
        from texbake.building.file import pipeline_schema as schema_of
    if output is None:
        say(json.dumps(schema_of(), indent=2))
    else:
        from texbake.building.file import schema_file

        terminal.wrote(schema_file(schema_of(), output).files)
