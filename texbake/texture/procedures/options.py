"""The procedures and their parameters, with defaults and ranges, without loading numpy."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from numbers import Integral, Real
from typing import Any

from texbake.errors import OptionError, quoted, require_known

WEIGHTS = ("cubic", "quintic")
INTERPOLATIONS = ("none", "linear", "cubic", "quintic")
PROFILES = ("hard", "sine")
FEATURES = ("f1", "f2-f1")

# Each octave is `lacunarity` times finer than the one before, with `gain` times its amplitude.
_OCTAVES = {"octaves": 6, "lacunarity": 2.0, "gain": 0.5}

# The procedures and their parameters; lengths in units of the points, angles in radians.
PROCEDURE_DEFAULTS: dict[str, dict[str, Any]] = {
    "checker": {"dimensions": None},
    "stripes": {"profile": "hard", "width": 0.5, "direction": (1.0, 0.0, 0.0)},
    "noise": {"weight": "cubic", "seed": 0},
    "value_noise": {"interpolation": "cubic", "seed": 0},
    "fractal": {**_OCTAVES, "weight": "cubic", "seed": 0},
    "turbulence": {**_OCTAVES, "weight": "cubic", "seed": 0},
    "marble": {
        "frequency": 6.0,
        "turbulence_frequency": 2.0,
        "amount": 8.0,
        "direction": (1.0, 0.0, 0.0),
        **_OCTAVES,
        "weight": "cubic",
        "seed": 0,
    },
    "wood": {
        "rings": 8.0,
        "wobble": 1.5,
        "grain": 0.25,
        "axis": (0.0, 1.0, 0.0),
        "weight": "cubic",
        "seed": 0,
    },
    "granite": {
        "frequency": 8.0,
        "octaves": 4,
        "lacunarity": 2.0,
        "gain": 0.7,
        "weight": "cubic",
        "seed": 0,
    },
    "worley": {"feature": "f1", "jitter": 1.0, "dimensions": None, "seed": 0},
    "gradient": {"direction": (0.0, 1.0, 0.0), "start": 0.0, "end": 1.0, "wrap": "clamp"},
    "radial": {"center": (0.0, 0.0, 0.0), "start": 0.0, "end": 1.0, "wrap": "clamp"},
}
PROCEDURE_NAMES = tuple(PROCEDURE_DEFAULTS)
# Procedures that measure: their points are not scaled unless a scale is given.
MEASURING_PROCEDURES = ("gradient", "radial")
# Procedures with colors; the others return a single value.
COLORED_PROCEDURES = ("marble", "wood", "granite")

Rgb = tuple[float, float, float]
_GRAY: tuple[Rgb, ...] = ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
_COLORS: dict[str, tuple[Rgb, ...]] = {
    # Narrow dark veins in white stone.
    "marble": (
        (0.10, 0.11, 0.13),
        (0.42, 0.43, 0.44),
        (0.66, 0.66, 0.65),
        (0.78, 0.77, 0.75),
        (0.84, 0.83, 0.80),
        (0.88, 0.87, 0.84),
        (0.90, 0.89, 0.87),
    ),
    # Light spring wood to dark autumn wood.
    "wood": (
        (0.60, 0.36, 0.16),
        (0.53, 0.30, 0.12),
        (0.44, 0.23, 0.085),
        (0.31, 0.14, 0.045),
        (0.20, 0.08, 0.025),
    ),
    # Mica, quartz, feldspar and white, in nearly flat steps.
    "granite": (
        (0.03, 0.03, 0.03),
        (0.04, 0.04, 0.04),
        (0.30, 0.29, 0.29),
        (0.34, 0.33, 0.32),
        (0.52, 0.36, 0.30),
        (0.55, 0.38, 0.31),
        (0.70, 0.66, 0.62),
        (0.76, 0.73, 0.69),
    ),
}
DEFAULT_RAMPS: dict[str, tuple[Rgb, ...]] = {
    name: _COLORS[name] if name in COLORED_PROCEDURES else _GRAY for name in PROCEDURE_NAMES
}

_CHOICES: dict[str, tuple[Any, ...]] = {
    "weight": WEIGHTS,
    "interpolation": INTERPOLATIONS,
    "profile": PROFILES,
    "feature": FEATURES,
    "dimensions": (2, 3, None),
    "wrap": ("clamp", "repeat", "mirror"),
}
# Least and greatest values. After 32 octaves of doubled frequency, float64 has no digits left even
# near the origin; the limits of the frequencies keep every product finite.
_WHOLE_RANGES = {"octaves": (1, 32)}
_RANGES = {
    "lacunarity": (1.0, 16.0),
    "gain": (0.0, 1.0),
    "jitter": (0.0, 1.0),
    "frequency": (0.0, 1e6),
    "turbulence_frequency": (0.0, 1e6),
    "rings": (0.0, 1e6),
    "amount": (0.0, 1e6),
    "wobble": (0.0, 1e6),
    "grain": (0.0, 1.0),
    "start": (-1e12, 1e12),
    "end": (-1e12, 1e12),
}
_INNER_RANGES = {"width": (0.0, 1.0)}
_VECTORS = ("direction", "axis", "center")


def checked_parameters(name: str, parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Check the given parameters of a procedure, and add the defaults of the others.

    >>> checked_parameters("noise", {"seed": 4})
    {'weight': 'cubic', 'seed': 4}
    """
    require_known("procedure", name, PROCEDURE_NAMES)
    defaults = PROCEDURE_DEFAULTS[name]
    full = dict(defaults)
    for key, value in parameters.items():
        if key not in defaults:
            raise OptionError(
                f"{name}.{key}: it is not a parameter of {name}; those are {', '.join(defaults)}"
            )
        full[key] = _checked(f"{name}.{key}", key, value)
    if "start" in full and full["start"] == full["end"]:
        raise OptionError(f"{name}.end: it is that of the start; give another number")
    return full


def parameter_schemas() -> dict[str, Any]:
    """Return the JSON Schema of each parameter; a name has the same meaning in all procedures."""
    names = dict.fromkeys(key for defaults in PROCEDURE_DEFAULTS.values() for key in defaults)
    return {
        name: {"description": f"Parameter of {_takers(name)}.", **_parameter_schema(name)}
        for name in names
    }


def _takers(name: str) -> str:
    return ", ".join(procedure for procedure, keys in PROCEDURE_DEFAULTS.items() if name in keys)


def _parameter_schema(name: str) -> dict[str, Any]:
    if name in _CHOICES:
        return {"enum": [choice for choice in _CHOICES[name] if choice is not None]}
    if name in _VECTORS:
        return {"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3}
    if name in _INNER_RANGES:
        low, high = _INNER_RANGES[name]
        return {"type": "number", "exclusiveMinimum": low, "exclusiveMaximum": high}
    if name in _RANGES:
        low, high = _RANGES[name]
        return {"type": "number", "minimum": low, "maximum": high}
    least, greatest = _WHOLE_RANGES.get(name, (None, None))
    ends = {} if least is None else {"minimum": least, "maximum": greatest}
    return {"type": "integer", **ends}


def _checked(where: str, key: str, value: Any) -> Any:
    """Check and return the value of a parameter, by its name."""
    if key in _CHOICES:
        choices = _CHOICES[key]
        # Compare the types as well: 2.0 and True equal whole numbers, and arrays equal nothing.
        if type(value) not in (str, int, type(None)) or value not in choices:
            words = ", ".join(str(choice) for choice in choices if choice is not None)
            raise OptionError(f"{where}: {quoted(value)} is not known; give one of {words}")
        return value
    if key == "seed":
        if isinstance(value, bool) or not isinstance(value, Integral):
            raise OptionError(f"{where}: {quoted(value)} is not a whole number; give one such as 7")
        return int(value)
    if key in _VECTORS:
        return _checked_vector(where, value, is_direction=key != "center")
    return _checked_number(where, key, value)


def _checked_number(where: str, key: str, value: Any) -> int | float:
    if key in _WHOLE_RANGES:
        least, greatest = _WHOLE_RANGES[key]
        whole = isinstance(value, Integral) and not isinstance(value, bool)
        if not (whole and least <= int(value) <= greatest):
            raise OptionError(
                f"{where}: {quoted(value)} is not right; give a whole number from {least} "
                f"to {greatest}"
            )
        return int(value)
    inner = key in _INNER_RANGES
    low, high = _INNER_RANGES[key] if inner else _RANGES[key]
    # Also False for NaN.
    if not _is_real(value) or not (low < value < high if inner else low <= value <= high):
        words = f"between {low:g} and {high:g}" if inner else f"from {low:g} to {high:g}"
        raise OptionError(f"{where}: {quoted(value)} is not right; give a number {words}")
    return float(value)


def _is_real(value: Any) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)


def _checked_vector(where: str, value: Any, *, is_direction: bool) -> tuple[float, ...]:
    if (
        isinstance(value, str)
        or not isinstance(value, Sequence)
        or len(value) != 3
        or not all(_is_real(number) and math.isfinite(number) for number in value)
        or not (1e-100 if is_direction else -1.0) < max(map(abs, value)) < 1e100
    ):
        raise OptionError(
            f"{where}: {quoted(value)} is not {'a direction' if is_direction else 'a point'}; "
            "give three numbers such as 1, 0, 0"
        )
    return tuple(float(number) for number in value)
