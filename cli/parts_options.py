"""Options of a bake of many parts."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import click

from texbake.baking.parts.options import OCCLUDERS, TEXTURE_SETS, PartsOptions
from texbake.errors import FileError
from texbake.mesh.files import MESH_SUFFIXES

from .options import choice_option
from .types import FileOf

Command = TypeVar("Command", bound=Callable[..., Any])


def _more(side: str, kind: str) -> Callable[[Command], Command]:
    return click.option(
        f"--{side}",
        f"more_{side}",
        type=FileOf(MESH_SUFFIXES),
        multiple=True,
        metavar="MESH|DIR",
        help=f"Another {kind} mesh, or a folder of them; may be given several times.",
    )


_OPTIONS = (
    _more("high", "dense"),
    _more("low", "light"),
    click.option(
        "--match-by-name",
        is_flag=True,
        default=PartsOptions.match_by_name,
        help="Bake body_low from body_high, body_high_01, ... alone: groups of the meshes, or "
        "files; what has _ignore in its name is left out.",
    ),
    click.option(
        "--high-suffix",
        default=PartsOptions.high_suffix,
        show_default=True,
        metavar="WORD",
        help="End of the names of dense parts, in any case; a number may follow.",
    ),
    click.option(
        "--low-suffix",
        default=PartsOptions.low_suffix,
        show_default=True,
        metavar="WORD",
        help="End of the names of light parts, in any case.",
    ),
    choice_option(
        "--occluders",
        OCCLUDERS,
        PartsOptions.occluders,
        "What hides light from matched parts for ao, bent-normal and thickness: all dense parts, "
        "or the match alone.",
    ),
    choice_option(
        "--texture-sets",
        TEXTURE_SETS,
        PartsOptions.texture_sets,
        "Make maps of their own for each group of the light meshes (each part, where names are "
        "matched), or each material.",
    ),
    click.option(
        "--dry-run",
        is_flag=True,
        help="Only print who would be baked from whom, and what is left over.",
    ),
)


@dataclass(frozen=True)
class Asked:
    """What was asked for with these options.

    Attributes
    ----------
    high, low : tuple of Path
        Files, folders opened.
    options : PartsOptions
    dry_run : bool
    name : str
        What the asset is called.
    """

    high: tuple[Path, ...]
    low: tuple[Path, ...]
    options: PartsOptions
    dry_run: bool
    name: str

    @property
    def is_plain(self) -> bool:
        """Whether it is one high-poly and one low-poly mesh onto one set of maps."""
        import texbake

        return not (self.dry_run or texbake.needs_parts(self.high, self.low, self.options))


def parts_options(command: Command) -> Command:
    """Add what tells parts of an asset apart; `taken` takes them out again."""
    for option in reversed(_OPTIONS):
        command = option(command)
    return command


def taken(
    context: click.Context,
    high: Path | None,
    low: Path | None,
    name_pattern: str,
    options: dict[str, Any],
) -> Asked:
    """Take the options of `parts_options`, and the arguments, for what they ask.

    With `--high` a single argument is the light mesh.
    """
    more_high, more_low = options.pop("more_high"), options.pop("more_low")
    if more_high and low is None:
        high, low = None, high
    highs = [path for path in (high, *more_high) if path is not None]
    lows = [path for path in (low, *more_low) if path is not None]
    for name, paths in (("HIGH", highs), ("LOW", lows)):
        if not paths:
            raise click.UsageError(f"Missing argument '{name}'.", context)
    fields = ("match_by_name", "high_suffix", "low_suffix", "occluders", "texture_sets")
    chosen = {name: options.pop(name) for name in fields}
    return Asked(
        tuple(_files(highs)),
        tuple(_files(lows)),
        PartsOptions(udim="{udim}" in name_pattern, **chosen),
        options.pop("dry_run"),
        lows[0].stem,
    )


def _files(paths: Iterable[Path]) -> list[Path]:
    """Files, and the meshes in folders by name, each once."""
    found: dict[Path, None] = {}
    for path in paths:
        if not path.is_dir():
            found[path] = None
            continue
        inside = sorted(file for file in path.iterdir() if file.suffix.lower() in MESH_SUFFIXES)
        if not inside:
            raise FileError(f"{path}: there is no mesh in it; give a folder of mesh files")
        found.update(dict.fromkeys(inside))
    return list(found)
