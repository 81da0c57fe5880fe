"""Procedural textures, evaluated at points: `evaluate(name, points, footprint)`.

Names, parameters and their checks do not need numpy; everything else is imported when it is used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from texbake.texture.procedures.evaluation import evaluate as evaluate

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__, submod_attrs={"evaluation": ["evaluate"]}
)
