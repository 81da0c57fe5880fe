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

from texbake.core.builds import FOLDER, SUFFIX, BuildError, find_builds
from texbake.core.checks import checksum
from texbake.core.declarations import read_prototype, split_prototypes
from texbake.errors import DependencyError


class Core:
    """The functions of `core.h` as methods.

    Each is bound when it is first asked for, and its prototype is read.
    """

    def __getattr__(self, name: str) -> Callable[..., Any]:
        match = self._prototypes.get(name)
        if match is None:
            raise AttributeError(f"core.h declares no function '{name}'")
        from texbake.core.binding import bind  # with NumPy, which signals are watched without

        declaration = read_prototype(match)
        checked = None
        if declaration.has_check and self._has_checks:
            checked = getattr(self.library, f"checked_{name}")
        bound = bind(declaration, getattr(self.library, name), checked)
        setattr(self, name, bound)
        return bound

    @cached_property
    def library(self) -> ctypes.CDLL:
        """The library itself, for calls without arrays of NumPy."""
        library = load_library()
        check_header(library, self._header)
        return library

    @cached_property
    def _prototypes(self) -> dict[str, Any]:
        return split_prototypes(self._header)

    @cached_property
    def _header(self) -> str:
        return (FOLDER / "core.h").read_text(encoding="utf-8")

    @cached_property
    def _has_checks(self) -> bool:
        from texbake.core.binding import tell_array_layout

        return tell_array_layout(self.library)


def check_header(library: ctypes.CDLL, header: str) -> None:
    """Raise `DependencyError` if a library was not compiled with this `core.h`.

    Its functions could take other arguments than those that are checked here.
    """
    tell = getattr(library, "header_checksum", None)
    if tell is not None:
        tell.restype = ctypes.c_int64
    if tell is None or tell() != checksum(header):
        raise DependencyError(
            f"{library._name}: it was not compiled from these sources; install texbake again, or "
            "recompile the library that TEXBAKE_CORE names"
        )


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
