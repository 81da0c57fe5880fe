"""Every option of packing channels, with its default."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

from texbake.baking.options import BITS_OPTION
from texbake.schema import CheckedOptions


@dataclass(frozen=True, kw_only=True)
class PackChannelsOptions(CheckedOptions):
    """How `pack_channel_files` writes its image."""

    bits: Annotated[int | None, replace(BITS_OPTION, default="those of the images")] = None
