"""The option about meshes that face the wrong way, without loading anything heavy."""

from __future__ import annotations

from typing import Final

from texbake.schema import Option

ORIENTATIONS: Final = ("auto", "keep")
DEFAULT_ORIENTATION: Final = "auto"

ORIENTATION_OPTION = Option(
    "Turn over parts of the high-poly mesh that face inwards (auto), or leave all as they are "
    "(keep).",
    choices=ORIENTATIONS,
)
