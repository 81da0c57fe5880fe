"""Unwrap meshes, bake normal and displacement maps, and preview them.

>>> import texbake
>>> high = texbake.read_mesh("high.ply")  # doctest: +SKIP
>>> low = texbake.unwrap(texbake.simplify(high, 500))  # doctest: +SKIP
>>> texbake.bake(high, low).write("maps/")  # doctest: +SKIP

`__init__.pyi` lists the public names and the modules they come from. Each is loaded when it is
first used, so importing the package costs almost nothing.
"""

import re
from importlib import import_module
from pathlib import Path
from typing import Any

__version__ = "0.1.0"


def _public_names() -> dict[str, str]:
    """Return the module of each public name, from the only list of them."""
    found, module = {}, ""
    stub = Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8")
    for opened, name in re.findall(r"^from (\S+) import|\b(\w+) as \2\b", stub, re.MULTILINE):
        module = opened or module
        if name:
            found[name] = module
    return found


_MODULES = _public_names()
__all__ = list(_MODULES)


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    try:
        value = globals()[name] = getattr(import_module(_MODULES[name], __name__), name)
    except ModuleNotFoundError as error:
        from texbake.errors import require_library

        require_library(error.name or "", name)
        raise
    return value


def __dir__() -> list[str]:
    return __all__
