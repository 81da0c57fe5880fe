"""Every option of `make`, with the defaults of each shape."""

from __future__ import annotations

from dataclasses import field, fields
from typing import Any

from texbake.errors import OptionError
from texbake.records import dataclass
from texbake.schema import CheckedOptions, Option, option

# Making this many takes about 6 GB: 4 million triangles of patches were measured to take 1.2 GB.
MAX_TRIANGLES = 20_000_000

_STRAIGHT = {"resolution": (64, 16), "radius": 1.0, "height": 2.0, "sides": None, "caps": False}
_RANGES = {"resolution": None, "image": None, "max_step": None}
# The shapes, and the options that each of them reads, with its default; None where there is none.
SHAPE_DEFAULTS: dict[str, dict[str, Any]] = {
    "plane": {"resolution": (1, 1), "width": 2.0, "height": 2.0},
    "cylinder": _STRAIGHT,
    "cone": _STRAIGHT,
    "sphere": {"resolution": (64, 32), "radius": 1.0},
    "torus": {"resolution": (96, 48), "radius": 1.0, "minor_radius": 0.4},
    "mobius": {"resolution": (128, 16), "radius": 1.0, "width": 0.8, "twists": 1},
    "revolution": {"resolution": (64, 1), "profile": None, "turns": 1.0, "crease": 30.0},
    "bezier": {"resolution": (16, 16), "patches": None},
    "height-field": {"resolution": None, "image": None, "width": 2.0, "height": 0.25},
    "cylindrical-range": {**_RANGES, "radius": 1.0, "height": 2.0},
    "depth-image": {**_RANGES, "distance": 1.0, "fov": 45.0},
}
SHAPES = tuple(SHAPE_DEFAULTS)
# The option that a shape cannot be made without.
_SOURCES = {"revolution": "profile", "bezier": "patches", "height-field": "image",
            "cylindrical-range": "image", "depth-image": "image"}  # fmt: skip
# Fewest squares along u and v, for shapes that close on themselves.
_LEAST_RESOLUTIONS = {
    "cylinder": (3, 1),
    "cone": (3, 1),
    "sphere": (3, 2),
    "torus": (3, 3),
    "mobius": (3, 1),
    "revolution": (3, 1),
}


def _option(name: str, text: str, **more: Any) -> Any:
    """Declare an option whose default names shapes, such as `1 (sphere, torus), 2 (plane)`."""
    readers: dict[str, list[str]] = {}
    for shape, defaults in SHAPE_DEFAULTS.items():
        if name in defaults:
            default = defaults[name]
            if isinstance(default, tuple):
                shown = "x".join(map(str, default))
            else:
                shown = f"{default:g}" if default else "none"
            readers.setdefault(shown, []).append(shape)
    by_shape = ", ".join(f"{shown} ({', '.join(shapes)})" for shown, shapes in readers.items())
    return option(None, text, **{"default": by_shape, **more})


def _length(name: str, text: str, **more: Any) -> Any:
    metavar = {"radius": "R", "minor_radius": "R", "height": "H", "width": "W"}.get(name, "D")
    return _option(name, text, metavar=metavar, above=0, unit="model units", **more)


def _file(text: str) -> dict[str, Option]:
    return {"option": Option(text, metavar="FILE")}


@dataclass(frozen=True, kw_only=True)
class MakeOptions(CheckedOptions):
    """The dimensions of a surface that `make` makes.

    None means the shape's own default, which `SHAPE_DEFAULTS` has. An option that the shape does
    not read must not be given. Flat `sides` have whole squares: the number along u is rounded up,
    and by default there is one per side. The straight pieces of a `profile` share the number along
    v by their lengths, and each has at least one. Bézier patches have so many squares each, and a
    height field has one vertex per pixel by default. An odd number of `twists` gives one side, an
    even number two, and a negative one turns the other way. From Python, `profile` and `patches`
    can be arrays of shapes (n, 2) and (n, 4, 4, 3), or (n, 4, 4, 5) with texture coordinates at the
    control points, and `image` is an array of heights, row 0 at the top.
    """

    resolution: int | tuple[int, int] | None = _option(
        "resolution",
        "Number of squares along u and v, each of two triangles.",
        metavar="N|NUxNV",
        low=1,
    )
    radius: float | None = _length(
        "radius",
        "Radius of the shape, for a torus or a Möbius strip of its center line, for a cylindrical "
        "range image that of white.",
    )
    height: float | None = _length(
        "height", "Height of the shape; for a height field, the height of white."
    )
    width: float | None = _length("width", "Width of the shape, for a Möbius strip across it.")
    minor_radius: float | None = _length("minor_radius", "Radius of the tube of a torus.")
    sides: int | None = _option(
        "sides",
        "Number of flat sides in place of a round one, for a prism or a pyramid.",
        metavar="N",
        low=3,
    )
    caps: bool | None = _option("caps", "Close the shape with flat ends.")
    twists: int | None = _option("twists", "Number of half turns of the strip.", metavar="N")
    turns: float | None = _option(
        "turns",
        "Fraction of a full turn by which the profile is swept.",
        metavar="T",
        above=0,
        high=1,
    )
    crease: float | None = _option(
        "crease",
        "Smallest angle at which an edge of the profile is hard.",
        metavar="DEG",
        low=0,
        high=90,
        unit="degrees",
    )
    distance: float | None = _length("distance", "Depth of white in a depth image.")
    fov: float | None = _option(
        "fov",
        "Vertical field of view of a depth image.",
        metavar="DEG",
        above=0,
        below=180,
        unit="degrees",
    )
    max_step: float | None = _length(
        "max_step",
        "Greatest step in depth within a triangle of a range image; holes stay where it is larger.",
        default="any",
    )
    profile: Any = field(
        default=None,
        compare=False,
        metadata=_file("File with a radius and a height per line, for a revolution."),
    )
    patches: Any = field(
        default=None,
        compare=False,
        metadata=_file("File with control points, 16 per patch, for Bézier patches."),
    )
    image: Any = field(
        default=None,
        compare=False,
        metadata=_file(
            "Image of heights from black to white, for a height field, or of distances, for a "
            "range image."
        ),
    )

    def settings(self, shape: str) -> dict[str, Any]:
        """Options that a shape reads, with its defaults filled in; `resolution` as two numbers.

        Raises
        ------
        OptionError
            There is no such shape, an option that it does not read was given, one that it needs
            is missing, or two do not fit together.
        """
        if shape not in SHAPE_DEFAULTS:
            raise OptionError(f"shape: {shape} is not one of {', '.join(SHAPES)}")
        defaults = SHAPE_DEFAULTS[shape]
        for item in fields(self):
            if item.name not in defaults and getattr(self, item.name) is not None:
                raise OptionError(f"{item.name}: the shape {shape} does not use it")
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
            f"minor_radius: {settings['minor_radius']} is not below the radius, "
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
