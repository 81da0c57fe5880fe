"""The knobs, one module each, and the one list of them; to add a knob, add a module and its name.

A module has the knob's name with `_` for `-` and holds it as `KNOB`. It is imported when the knob
is studied.
"""

from __future__ import annotations

from importlib import import_module

from texbake.study.knob import Knob
from texbake.study.options import KNOB_NAMES

__all__ = ["KNOB_NAMES", "knob_named"]


def knob_named(name: str) -> Knob:
    """Return the knob of one of `KNOB_NAMES`."""
    knob: Knob = import_module(f"{__name__}.{name.replace('-', '_')}").KNOB
    return knob
