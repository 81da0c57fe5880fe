"""Targets of the fuzzer for the core: what calls its functions, with arguments made from bytes.

Kernels trust what was validated, so they are called by the functions of Python that validate. Each
target is a format like any other: an input is a file of bytes, from which `drawn` makes arguments.
A target is loaded when it is first read, so that the fuzzer can count its branches.
"""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

HERE = Path(__file__).parent
for room in ("hard_cases", "rendering", "fuzzing"):
    if str(HERE.parent / room) not in sys.path:
        sys.path.insert(0, str(HERE.parent / room))

from fuzz_formats import FORMATS, Maker, Reader  # noqa: E402

# The functions of each module that are targets.
MODULES = {
    "mesh_targets": (
        "surface", "repair", "simplify", "pieces", "parts", "remesh", "distance", "check", "atlas",
        "mappings", "layout", "rays", "bake", "cage", "streamed", "paint",
    ),
    "picture_targets": (
        "image_lookup", "padding", "coding", "heights", "cubes", "procedures", "scenes", "preview",
        "numbers",
    ),
}  # fmt: skip
SEED_BYTES = 1024

# Functions of the core that no target and no format reaches, and why.
UNREACHED = {
    "take_over_samples": "bakes of a few texels do not divide a texel twice; its tests do",
    "has_x86_64_v3": "it takes nothing, and is called while the library is chosen",
}


def _seed(name: str) -> Maker:
    def make(path: Path) -> None:
        path.write_bytes(np.random.default_rng([*name.encode()]).bytes(SEED_BYTES))

    return make


def _reader(module: str, name: str) -> Reader:
    def read(path: Path) -> Any:
        from drawn import Drawn

        getattr(import_module(module), name)(Drawn(path.read_bytes()))

    return read


TARGETS: dict[str, tuple[str, Maker, Reader]] = {
    f"core {name}": (".bin", _seed(name), _reader(module, name))
    for module, names in MODULES.items()
    for name in names
}
READ = FORMATS | TARGETS


def unreached() -> set[str]:
    """Return the functions of the core that have not been called in this process."""
    from texbake.core import core

    return set(core._prototypes) - set(vars(core))
