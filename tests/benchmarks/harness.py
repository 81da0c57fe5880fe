"""What the benchmarks share: data, runs in turn, child processes, tables, and their command lines.

A script has commands: functions whose keyword parameters are its options, with their defaults.
Programs that are compared take turns in one run, after a first round that does not count, so that
what disturbs the machine disturbs all of them. A cell has the median with the least and the
greatest; a ratio is that of the runs of one round.
"""

from __future__ import annotations

import argparse
import inspect
import json
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
DATA = Path(os.environ.get("TEXBAKE_DATA", ROOT.parent / "shared" / "data"))
SCENES = ROOT / "samples" / "scenes"
PAIRS = ("koala", "skull", "spot", "penguin")


def read_pair(name: str) -> tuple[Any, Any]:
    """High-poly and low-poly mesh of a pair of the data folder."""
    import texbake

    folder = DATA / "pairs" / name
    return texbake.read_mesh(folder / "high.obj"), texbake.read_mesh(folder / "low_uv.obj")


@dataclass
class Runs:
    """Seconds of one contender, round by round, and its last result."""

    seconds: list[float] = field(default_factory=list)
    result: Any = None

    @property
    def median(self) -> float:
        return statistics.median(self.seconds)

    def cell(self, digits: int = 2, unit: float = 1.0) -> str:
        """Median, least and greatest, each divided by a unit."""
        middle, low, high = (
            f"{value / unit:.{digits}f}"
            for value in (self.median, min(self.seconds), max(self.seconds))
        )
        return f"{middle} ({low} to {high})"

    def times(self, other: Runs, digits: int = 2) -> str:
        """How many times another contender's seconds these are."""
        ratios = [a / b for a, b in zip(self.seconds, other.seconds, strict=True)]
        return Runs(ratios).cell(digits)

    def spread(self) -> str:
        """The seconds of every other run over those of the rest: 1.00 without noise."""
        return f"{statistics.median(self.seconds[::2]) / statistics.median(self.seconds[1::2]):.2f}"


def in_turn(
    functions: Mapping[Any, Callable[[], Any]],
    rounds: int,
    clock: Callable[[], float] = time.process_time,
) -> dict[Any, Runs]:
    """Time functions in turn, every other round backwards; the first round does not count."""
    runs = {key: Runs() for key in functions}
    keys = list(functions)
    for number in range(-1, rounds):
        for key in keys if number % 2 else reversed(keys):
            start = clock()
            runs[key].result = functions[key]()
            if number >= 0:
                runs[key].seconds.append(clock() - start)
    return runs


def table(*heads: str) -> Callable[..., None]:
    """Print the head of a table in Markdown; return what prints a row."""
    print(f"| {' | '.join(heads)} |\n{'|---' * len(heads)}|", flush=True)
    return lambda *cells: print(f"| {' | '.join(map(str, cells))} |", flush=True)


def in_child(function: Callable[..., Any], *arguments: Any, timeout: float | None = None) -> Any:
    """What a function of a script returns in a process of its own; values are those of JSON."""
    words = json.dumps(arguments, default=str)
    command = [sys.executable, sys.argv[0], "--child", function.__name__, words]
    done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True, timeout=timeout)
    return json.loads(done.stdout.splitlines()[-1])


def run_commands(module: Mapping[str, Any], *commands: Callable[..., None]) -> None:
    """Run the command that the command line names, or a function of the module for a parent."""
    if sys.argv[1:2] == ["--child"]:
        print(json.dumps(module[sys.argv[2]](*json.loads(sys.argv[3]))))
        return
    parser = argparse.ArgumentParser(description=(module["__doc__"] or "").splitlines()[0])
    parsers = parser.add_subparsers(required=True)
    for command in commands:
        about = inspect.getdoc(command) or ""
        own = parsers.add_parser(
            command.__name__, help=about.splitlines()[0], description=about,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )  # fmt: skip
        own.set_defaults(command=command)
        for name, parameter in inspect.signature(command).parameters.items():
            _add(own, name, parameter)
    options = vars(parser.parse_args())
    command = options.pop("command")
    rest = [
        value
        for name, parameter in inspect.signature(command).parameters.items()
        if parameter.kind is parameter.VAR_POSITIONAL
        for value in options.pop(name)
    ]
    command(*rest, **options)


def _add(parser: argparse.ArgumentParser, name: str, parameter: inspect.Parameter) -> None:
    """Add a parameter as an option; names without a flag for `*names`."""
    default, flag = parameter.default, f"--{name.replace('_', '-')}"
    if parameter.kind is parameter.VAR_POSITIONAL:
        parser.add_argument(name, nargs="*")
    elif isinstance(default, bool):
        parser.add_argument(flag, action="store_true")
    elif isinstance(default, tuple):
        parser.add_argument(flag, nargs="+", type=type(default[0]), default=default)
    else:
        kind = str if default is None else type(default)
        parser.add_argument(flag, type=kind, default=default)
