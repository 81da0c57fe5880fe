"""Procedural textures, evaluated at points: `evaluate(name, points, footprint)`.

Names, parameters and their checks do not need numpy; everything else is imported when it is used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from texbake.texture.procedures.default_ramps import DEFAULT_RAMPS
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
