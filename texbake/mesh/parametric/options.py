"""Every choice of a surface to be made, with its default, written once for the API and the CLI."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from typing import Any

from texbake.errors import OptionError

# Making so many takes about 6 GB: 4 million triangles of patches were measured to take 1.2 GB.
MAX_TRIANGLES = 20_000_000

# The shapes, and what each of them reads, with its default; None where there is none.
SHAPE_DEFAULTS: dict[str, dict[str, Any]] = {
    "plane": {"resolution": (1, 1), "width": 2.0, "height": 2.0},
    "cylinder": {
        "resolution": (64, 16),
        "radius": 1.0,
        "height": 2.0,
        "sides": None,
        "caps": False,
    },
    "cone": {"resolution": (64, 16), "radius": 1.0, "height": 2.0, "sides": None, "caps": False},
    "sphere": {"resolution": (64, 32), "radius": 1.0},
    "torus": {"resolution": (96, 48), "radius": 1.0, "minor_radius": 0.4},
    "mobius": {"resolution": (128, 16), "radius": 1.0, "width": 0.8, "twists": 1},
    "revolution": {"resolution": (64, 1), "profile": None, "turns": 1.0, "crease": 30.0},
    "bezier": {"resolution": (16, 16), "patches": None},
    "height-field": {"resolution": None, "image": None, "width": 2.0, "height": 0.25},
}
SHAPES = tuple(SHAPE_DEFAULTS)
# What a shape cannot be made without.
_SOURCES = {"revolution": "profile", "bezier": "patches", "height-field": "image"}
# Fewest squares along u and v; those that go around close on themselves.
_LEAST_RESOLUTIONS = {
    "cylinder": (3, 1),
    "cone": (3, 1),
    "sphere": (3, 2),
    "torus": (3, 3),
    "mobius": (3, 1),
    "revolution": (3, 1),
}


@dataclass(frozen=True, kw_only=True)
class MakeOptions:
    """What `make` does where the caller does not say otherwise.

    None stands for the shape's own default, which `SHAPE_DEFAULTS` has. An option that the shape
    does not read must not be given. Lengths are in model units.

    Attributes
    ----------
    resolution : int or (int, int), optional
        Squares along u and v, each of two triangles. Flat `sides` have whole squares: the number
        along u is rounded up; None makes one of each side. Straight pieces of a `profile` share
        the number along v by their lengths, and each has at least one. Of patches: squares of
        each. Of a height field: None makes one vertex of each pixel.
    radius : float, optional
        Of a cylinder, sphere or the foot of a cone; of the circle that the middle of a torus' tube
        or of a Möbius strip follows.
    height : float, optional
        Of a plane, cylinder or cone; of a height field where the image is 1.
    width : float, optional
        Of a plane or height field along x; of a Möbius strip across.
    minor_radius : float, optional
        Of a torus' tube; below `radius`.
    sides : int, optional
        Flat sides that a cylinder or cone has instead of a round one: a prism or pyramid.
    caps : bool, optional
        Close a cylinder or cone with flat ends.
    twists : int, optional
        Half turns of a Möbius strip: odd numbers have one side, even ones two; negative ones turn
        the other way.
    turns : float, optional
        How far a profile is swept about the axis: above 0, and 1 for a whole turn.
    crease : float, optional
        Degrees, 0 to 90: a profile that turns by more has an edge there, by less it is shaded
        smooth.
    profile : path or (n, 2) array, optional
        Radius and height of points from one end to the other; of a file, see `read_profile`.
    patches : path or (n, 4, 4, 3) array, optional
        Control points of bicubic Bézier patches; of a file, see `read_patches`.
    image : (H, W) or (H, W, C) array, optional
        Heights, row 0 at the top; of colors their mean is taken, without alpha.
    """

    resolution: int | tuple[int, int] | None = None
    radius: float | None = None
    height: float | None = None
    width: float | None = None
    minor_radius: float | None = None
    sides: int | None = None
    caps: bool | None = None
    twists: int | None = None
    turns: float | None = None
    crease: float | None = None
    profile: Any = field(default=None, compare=False)
    patches: Any = field(default=None, compare=False)
    image: Any = field(default=None, compare=False)

    def __post_init__(self) -> None:
        for name in "radius", "height", "width", "minor_radius", "turns", "crease":
            _check_number(name, getattr(self, name))
        for name in "radius", "height", "width", "minor_radius", "turns":
            value = getattr(self, name)
            if value is not None and not value > 0:
                raise OptionError(f"{_shown(name)}: {value} is out of range; it must be above 0")
        if self.turns is not None and self.turns > 1:
            raise OptionError(f"turns: {self.turns} is out of range; 1 is a whole turn")
        if self.crease is not None and not 0 <= self.crease <= 90:
            raise OptionError(f"crease: {self.crease} is out of range; it must be 0 to 90 degrees")
        _check_whole("twists", self.twists)
        _check_whole("sides", self.sides)
        if self.sides is not None and self.sides < 3:
            raise OptionError(f"sides: {self.sides} is out of range; it must be 3 or more")
        if self.resolution is not None:
            _check_resolution(self.resolution)

    def settings(self, shape: str) -> dict[str, Any]:
        """Give what a shape reads, with its defaults filled in; `resolution` as two numbers.

        Raises
        ------
        OptionError
            There is no such shape, an option that it does not read was given, one that it needs
            is missing, or two do not fit together.
        """
        if shape not in SHAPE_DEFAULTS:
            raise OptionError(f"shape: {shape} is not one of {', '.join(SHAPES)}")
        defaults = SHAPE_DEFAULTS[shape]
        for option in fields(self):
            if option.name not in defaults and getattr(self, option.name) is not None:
                raise OptionError(f"{_shown(option.name)}: the shape {shape} does not use it")
        if shape in _SOURCES and getattr(self, _SOURCES[shape]) is None:
            raise OptionError(f"{_SOURCES[shape]}: the shape {shape} needs it")
        settings = {
            name: default if getattr(self, name) is None else getattr(self, name)
            for name, default in defaults.items()
        }
        if self.resolution is None and self.sides is not None:
            settings["resolution"] = (self.sides, 1)
        if isinstance(settings["resolution"], int):
            settings["resolution"] = (settings["resolution"], settings["resolution"])
        _check_fit(shape, settings)
        return settings


def check_triangles(n_triangles: int) -> None:
    """Raise `OptionError` where a mesh would be too large."""
    if n_triangles > MAX_TRIANGLES:
        raise OptionError(
            f"resolution: it makes {n_triangles:,} triangles; {MAX_TRIANGLES:,} are the most"
        )


def _check_fit(shape: str, settings: dict[str, Any]) -> None:
    if settings["resolution"] is not None:
        least = _LEAST_RESOLUTIONS.get(shape, (1, 1))
        if any(have < want for have, want in zip(settings["resolution"], least, strict=True)):
            shown = "x".join(str(count) for count in settings["resolution"])
            raise OptionError(
                f"resolution: {shown} is too small; the shape {shape} needs {least[0]}x{least[1]}"
            )
        n_u, n_v = settings["resolution"]
        check_triangles(2 * max(n_u, settings.get("sides") or 0) * n_v)
    if shape == "torus" and settings["minor_radius"] >= settings["radius"]:
        raise OptionError(
            f"minor-radius: {settings['minor_radius']} is not below the radius, "
            f"{settings['radius']}; the tube would cut itself"
        )
    if shape == "mobius" and abs(settings["twists"]) > settings["resolution"][0]:
        raise OptionError(
            f"twists: {settings['twists']} half turns do not show on "
            f"{settings['resolution'][0]} squares along u; raise the resolution"
        )
    if shape == "mobius" and settings["width"] >= 2 * settings["radius"]:
        raise OptionError(
            f"width: {settings['width']} is not below twice the radius, {settings['radius']}; "
            "the strip would cut itself"
        )


def _shown(name: str) -> str:
    """Name of an option as the command line has it."""
    return name.replace("_", "-")


def _check_number(name: str, value: object) -> None:
    if value is not None and not (isinstance(value, (int, float)) and math.isfinite(value)):
        raise OptionError(f"{_shown(name)}: {value!r} is not a finite number")


def _check_whole(name: str, value: object) -> None:
    if value is not None and not isinstance(value, int):
        raise OptionError(f"{name}: {value!r} is not a whole number")


def _check_resolution(value: object) -> None:
    counts = value if isinstance(value, tuple) else (value, value)
    if len(counts) != 2 or not all(isinstance(count, int) for count in counts):
        raise OptionError(f"resolution: {value!r} is neither a number nor (along u, along v)")
    for count in counts:
        if count < 1:
            raise OptionError(f"resolution: {count} is out of range; it must be 1 or more")
