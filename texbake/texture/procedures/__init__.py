"""Procedural textures, evaluated at points: `evaluate(name, points, footprint)`.

Names, parameters and their checks do not need numpy; everything else is imported when it is used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from texbake.texture.procedures.evaluation import evaluate as evaluate


def __getattr__(name: str) -> Any:
    if name != "evaluate":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from texbake.texture.procedures import evaluation

    return evaluation.evaluate
