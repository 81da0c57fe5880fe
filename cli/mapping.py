"""The options of `texbake unwrap` that make up `UnwrapOptions`, in sections."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any, cast

import click

from texbake.mapping.options import METHODS, UnwrapOptions
from texbake.mapping.options.atlas import QUALITIES
from texbake.mapping.options.projection import AXES, FITS, SURFACES, UNSEEN, VIAS
from texbake.mapping.options.transform import FLIPS, WARPS

from .options import Command, Decorator, choice_option, number_option, size_option
from .types import FileOf, NameAndStrength, Numbers, View

_BOX = "[default: the middle of the bounding box]"
_VECTOR = "X,Y,Z"


def _flag(name: str, text: str) -> Decorator[Any]:
    return click.option(name, is_flag=True, help=text)


def _numbers(flag: str, form: str, text: str, words: tuple[str, ...] = ()) -> Decorator[Any]:
    """Add an option of numbers; its default is shown where there is one."""
    default = getattr(UnwrapOptions, flag[2:].replace("-", "_"))
    shown = ",".join(f"{v:g}" for v in default) if isinstance(default, tuple) else default
    return click.option(
        flag, type=Numbers(form, words), default=shown, show_default=default is not None, help=text
    )


def _choice(flag: str, choices: tuple[str, ...], text: str) -> Decorator[Any]:
    return choice_option(flag, choices, getattr(UnwrapOptions, flag[2:].replace("-", "_")), text)


_OPTIONS: dict[str, tuple[Decorator[Any], ...]] = {
    "Method": (
        _choice("--method", METHODS, "How coordinates are made."),
        size_option(UnwrapOptions.size, "Texels of the texture that the coordinates are for."),
        click.option("--only", metavar="GROUP", help="Map the faces of one group alone."),
    ),
    "Atlas": (
        number_option(
            "--padding",
            int,
            UnwrapOptions.padding,
            "PX",
            "Texels that a bake may pad each chart by without meeting another's.",
        ),
        _choice(
            "--quality",
            QUALITIES,
            "fast: for large scans; good: charts relaxed and joined; best: fewer, packed better.",
        ),
        number_option(
            "--max-stretch", float, None, "L2", "Cut charts until none has more stretch than this."
        ),
        number_option(
            "--tiles", int, UnwrapOptions.tiles, "N", "UDIM tiles to spread charts over."
        ),
        _flag("--by-group", "Give each group of faces tiles of its own, at one texel density."),
        _flag("--keep", "Leave the coordinates that there are as charts, and pack them."),
        number_option(
            "--timeout", float, None, "SECONDS", "Then a part is cut in a simpler way instead."
        ),
    ),
    "Classical mappings": (
        _numbers(
            "--axis", _VECTOR, "Of a plane, cylinder or sphere.  [default: z, y, y]", tuple(AXES)
        ),
        _numbers("--center", _VECTOR, f"Of a cylinder, sphere or box.  {_BOX}"),
        _numbers("--normal", _VECTOR, "Planar: of the plane, instead of --axis."),
        _choice("--fit", FITS, "Planar: along the model's axes, or where its points spread most."),
        _flag("--sides", "Planar: put faces that look away beside the others."),
        _numbers("--theta", "A,B", "Angles, in degrees, that become s = 0 and s = 1."),
        _numbers(
            "--height",
            "A,B",
            "Cylindrical: heights above the center that become t = 0 and 1.  [default: the mesh's]",
        ),
        _flag("--caps", "Cylindrical: map the ends by a plane."),
        _flag("--overlap", "Box: all six planes share the square."),
        _choice("--surface", SURFACES, "Two-part: what the texture is put on first."),
        _choice("--via", VIAS, "Two-part: what leads from there to the object."),
        _numbers("--eye", _VECTOR, "Two-part via reflection: where it is seen from."),
        click.option(
            "--camera", type=View(), help="Projector: where it stands.  [default: 0,0, in front]"
        ),
        number_option(
            "--fov", float, UnwrapOptions.fov, "DEG", "Projector: its vertical field of view."
        ),
        click.option(
            "--matrix",
            type=FileOf((".txt",)),
            metavar="FILE",
            help="Projector: 4 x 4 numbers that take (x, y, z, 1) to (s, t, r, q).",
        ),
        _choice("--unseen", UNSEEN, "Projector: faces that it does not see."),
        _numbers(
            "--linear",
            "AU,BU,CU,AV,BV,CV",
            "Parametric: s = AU u + BU v + CU, t = AV u + BV v + CV.",
        ),
    ),
    "Afterwards, in this order": (
        click.option(
            "--warp",
            type=NameAndStrength(tuple(WARPS)),
            help="Bend (s, t).  [strengths: "
            + ", ".join(f"{name} {strength:g}" for name, strength in WARPS.items())
            + "]",
        ),
        choice_option("--flip", FLIPS, None, "Mirror about 1/2."),
        number_option(
            "--rotate", float, UnwrapOptions.rotate, "DEG", "Counter-clockwise about (1/2, 1/2)."
        ),
        _numbers("--scale", "S[,T]", "About (0, 0)."),
        number_option(
            "--texel-density", float, None, "PX", "Texels a model unit, for the mesh as a whole."
        ),
        _numbers("--offset", "S,T", "Added last."),
    ),
}


def sections() -> dict[str, list[str]]:
    """Names of the options under each heading of the help."""

    def names(options: tuple[Decorator[Any], ...]) -> list[str]:
        def probe() -> None:
            """Collect parameters, as click leaves them on a function."""

        for option in options:
            option(probe)
        return [param.name for param in getattr(probe, "__click_params__")]  # noqa: B009

    return {heading: names(options) for heading, options in _OPTIONS.items()}


def mapping_options(command: Command) -> Command:
    """Add how coordinates are made; received as `options`, which are `UnwrapOptions`."""

    @functools.wraps(command)
    def with_options(*args: Any, **values: Any) -> None:
        chosen = {f.name: values.pop(f.name) for f in fields(UnwrapOptions)}
        command(*args, options=_unwrap_options(**chosen), **values)

    wrapped: Callable[..., Any] = with_options
    for option in reversed([option for group in _OPTIONS.values() for option in group]):
        wrapped = option(wrapped)
    return cast(Command, wrapped)


def _unwrap_options(*, matrix: Path | None, **chosen: Any) -> UnwrapOptions:
    if matrix is None:
        return UnwrapOptions(**chosen)
    from texbake.mapping.matrix_file import read_matrix

    return UnwrapOptions(matrix=read_matrix(matrix), **chosen)
