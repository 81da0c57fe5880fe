"""Unwrap meshes, bake normal and displacement maps, and preview them.

>>> import texbake
>>> high = texbake.read_mesh("high.ply")  # doctest: +SKIP
>>> low = texbake.unwrap(texbake.simplify(high, 500))  # doctest: +SKIP
>>> texbake.bake(high, low).write("maps/")  # doctest: +SKIP

Names are loaded when they are first used, so that importing the package costs next to nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from texbake.errors import (
        CageError,
        DependencyError,
        FileError,
        FileFormatError,
        MeshError,
        MissError,
        OptionError,
        TexbakeError,
        UnwrapError,
        UvError,
    )
    from texbake.mesh.mesh import Mesh

_ERRORS = (
    "CageError",
    "DependencyError",
    "FileError",
    "FileFormatError",
    "MeshError",
    "MissError",
    "OptionError",
    "TexbakeError",
    "UnwrapError",
    "UvError",
)

# The module that each public name comes from.
_HOMES = {
    **dict.fromkeys(_ERRORS, "texbake.errors"),
    "Mesh": "texbake.mesh.mesh",
}

__all__ = [
    "CageError",
    "DependencyError",
    "FileError",
    "FileFormatError",
    "Mesh",
    "MeshError",
    "MissError",
    "OptionError",
    "TexbakeError",
    "UnwrapError",
    "UvError",
    "__version__",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'texbake' has no attribute {name!r}")
    value = getattr(import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
