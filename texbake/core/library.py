"""The compiled library: found, chosen for this processor, and loaded when it is first used.

The core is built once for each level of instructions that matters (x86-64-v2 and v3; NEON is part
of every arm64). All builds give the same bytes. `TEXBAKE_CORE` names a level, or the path of a
library, such as one built with sanitizers.
"""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import Any

from texbake.core.binding import bind, read_prototype, split_prototypes
from texbake.core.builds import FOLDER, SUFFIX, BuildError, find_builds
from texbake.errors import DependencyError


class Core:
    """The functions of the library as methods, bound when they are first asked for."""

    def __getattr__(self, name: str) -> Callable[..., Any]:
        match = self._prototypes.get(name)
        if match is None:
            raise AttributeError(f"the core has no function '{name}'")
        bound = bind(read_prototype(match), getattr(self.library, name))
        setattr(self, name, bound)
        return bound

    @cached_property
    def library(self) -> ctypes.CDLL:
        """The library itself."""
        return load_library()

    @cached_property
    def _prototypes(self) -> dict[str, Any]:
        text = ctypes.c_char.in_dll(self.library, "declarations")
        return split_prototypes(ctypes.string_at(ctypes.addressof(text)).decode())


def load_library() -> ctypes.CDLL:
    """Load the fastest build of the core that this processor runs."""
    wanted = os.environ.get("TEXBAKE_CORE", "")
    if wanted and Path(wanted).suffix == SUFFIX:
        return _load(Path(wanted))
    try:
        built = find_builds()
    except BuildError as error:
        checkout = FOLDER.parents[1]
        raise DependencyError(
            f"there is no compiled core for the sources in {checkout}: {error}; "
            f"run: pip install {checkout}"
        ) from error
    if not built:
        raise DependencyError(
            f"the compiled core is not in {FOLDER}; install texbake again with: "
            "pip install --force-reinstall --no-deps texbake"
        )
    if wanted:
        if wanted not in built:
            there_is = ", ".join(sorted(built))
            raise DependencyError(
                f"TEXBAKE_CORE: there is no build '{wanted}'; there is {there_is}"
            )
        return _load(built[wanted])
    levels = sorted(built)  # from the least to the most
    library = _load(built[levels[0]])
    if levels[-1] == "x86-64-v3":
        library.has_x86_64_v3.restype = ctypes.c_bool
        if library.has_x86_64_v3():
            return _load(built[levels[-1]])
    return library


def _load(path: Path) -> ctypes.CDLL:
    try:
        return ctypes.CDLL(str(path))
    except OSError as error:
        raise DependencyError(f"{path}: the compiled core does not load: {error}") from error


core = Core()
