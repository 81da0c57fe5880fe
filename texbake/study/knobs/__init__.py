"""The knobs, by subject: to add one, write it in a module of its subject and list it here.

A knob is the constant of its module that has its name, in capitals and with `_KNOB` behind it. Its
module is imported when it is studied.
"""

from __future__ import annotations

from importlib import import_module

from texbake.study.knob import Knob
from texbake.study.options import KNOB_NAMES

__all__ = ["KNOB_NAMES", "MODULES", "knob_named"]

MODULES = {
    "texture-size": "baked_maps",
    "samples": "baked_maps",
    "bit-depth": "baked_maps",
    "map-kind": "map_kinds",
    "ray-direction": "low_poly_mesh",
    "low-poly": "low_poly_mesh",
    "atlas-quality": "low_poly_mesh",
    "bump-gradient": "bumps",
    "bump-form": "bumps",
    "bump-light": "bumps",
    "surface-detail": "displacement",
    "tessellation": "displacement",
    "texture-lookup": "textures",
    "interpolation": "textures",
    "noise": "textures",
    "environment": "lighting",
    "shadow-map": "lighting",
}


def knob_named(name: str) -> Knob:
    """Return the knob of one of `KNOB_NAMES`."""
    module = import_module(f"{__name__}.{MODULES[name]}")
    knob: Knob = getattr(module, f"{name.replace('-', '_').upper()}_KNOB")
    return knob
