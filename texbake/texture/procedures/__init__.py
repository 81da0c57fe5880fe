"""Procedural textures, evaluated at points: `evaluate(name, points, footprint)`.

Names, parameters and their checks do not need numpy; everything else is imported when it is used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from texbake.texture.procedures.options import (
    COLORED_PROCEDURES,
    PROCEDURE_DEFAULTS,
    PROCEDURE_NAMES,
    checked_parameters,
)

if TYPE_CHECKING:
    from texbake.texture.procedures.evaluation import PROCEDURES, Procedure, evaluate
    from texbake.texture.procedures.noise import fractal_sum, signed_noise, turbulence_sum


_HOMES = {
    "PROCEDURES": "evaluation",
    "Procedure": "evaluation",
    "evaluate": "evaluation",
    "fractal_sum": "noise",
    "signed_noise": "noise",
    "turbulence_sum": "noise",
}

__all__ = [
    "COLORED_PROCEDURES",
    "DEFAULT_RAMPS",
    "PROCEDURES",
    "PROCEDURE_DEFAULTS",
    "PROCEDURE_NAMES",
    "Procedure",
    "checked_parameters",
    "evaluate",
    "fractal_sum",
    "signed_noise",
    "turbulence_sum",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)


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
