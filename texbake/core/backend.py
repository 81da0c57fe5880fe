"""The build backend: setuptools, with the core compiled into the wheel.

pip calls it (PEP 517). Where no compiler is installed it asks for the one of the package `ziglang`,
which pip puts into the build's own environment and removes afterwards. The wheel is for one
platform and every Python, since the library has no Python in it.

`TEXBAKE_TARGET` cross-compiles: the tag of a wheel from the list in `compile_core.py`, such as
`win_amd64`.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import compile_core
from setuptools import build_meta
from setuptools.build_meta import (
    build_editable,
    build_sdist,
    build_wheel,
    get_requires_for_build_sdist,
    prepare_metadata_for_build_editable,
    prepare_metadata_for_build_wheel,
)
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.build_py import build_py

__all__ = [
    "build_editable",
    "build_sdist",
    "build_wheel",
    "get_requires_for_build_editable",
    "get_requires_for_build_sdist",
    "get_requires_for_build_wheel",
    "prepare_metadata_for_build_editable",
    "prepare_metadata_for_build_wheel",
]

ZIG = "ziglang>=0.13"


def get_requires_for_build_wheel(settings: Mapping[str, Any] | None = None) -> list[str]:
    """Return what must be installed to build a wheel: a compiler, where there is none."""
    needed: list[str] = build_meta.get_requires_for_build_wheel(settings)
    return [*needed, ZIG] if _target() or compile_core.find_compiler() is None else needed


def get_requires_for_build_editable(settings: Mapping[str, Any] | None = None) -> list[str]:
    """Return what must be installed to build in place."""
    return get_requires_for_build_wheel(settings)


def _target() -> compile_core.Target | None:
    """Return the machine to cross-compile for, or None for this one."""
    tag = os.environ.get("TEXBAKE_TARGET")
    if not tag:
        return None
    for target in compile_core.TARGETS:
        if target.wheel_tag == tag:
            return target
    known = ", ".join(target.wheel_tag for target in compile_core.TARGETS)
    raise SystemExit(f"TEXBAKE_TARGET: '{tag}' is not one of {known}")


class BuildWithCore(build_py):  # type: ignore[misc]  # setuptools has no types here
    """Copies the modules, and compiles the core beside them; in place for an editable install."""

    def run(self) -> None:
        """Copy and compile."""
        super().run()
        if self.editable_mode:
            compile_core.remove_others(compile_core.build(compile_core.FOLDER))
            return
        folder = Path(self.build_lib) / "texbake" / "core"
        compile_core.remove_others(compile_core.build(folder, _target()))


class PlatformWheel(bdist_wheel):  # type: ignore[misc]
    """A wheel for every Python 3, on one platform."""

    def finalize_options(self) -> None:
        """Mark the wheel as one with machine code."""
        self.distribution.has_ext_modules = lambda: True
        super().finalize_options()

    def get_tag(self) -> tuple[str, str, str]:
        """Return the tags of the wheel's name."""
        _, _, platform = super().get_tag()
        target = _target()
        return "py3", "none", target.wheel_tag if target else platform
