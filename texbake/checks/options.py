"""Every option of a check, with its default."""

from __future__ import annotations

from dataclasses import dataclass
from difflib import get_close_matches
from typing import Annotated

from texbake.baking.options import PADDING_OPTION, THREADS_OPTION, BakeOptions
from texbake.checks.kinds import KINDS
from texbake.errors import OptionError, quoted
from texbake.mapping.options.shared import TextureOptions
from texbake.schema import Option

# The worst first.
SEVERITIES = ("error", "warning", "note")


@dataclass(frozen=True, kw_only=True)
class CheckOptions(TextureOptions):
    """The bake that a check is made for."""

    padding: Annotated[int, PADDING_OPTION] = BakeOptions.padding
    min_texel_density: Annotated[
        float | None,
        Option(
            "Texels per model unit that every face must have in its most stretched direction.",
            metavar="D",
            above=0,
            unit="texels per model unit",
            default="a quarter of the mesh's mean",
        ),
    ] = None
    allow: Annotated[
        tuple[str, ...],
        Option(
            "Accept findings of this kind, such as mirrored-coordinates; they are listed, but do "
            "not fail the check; repeatable.",
            metavar="KIND",
            many=True,
        ),
    ] = ()
    threads: Annotated[int | None, THREADS_OPTION] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in self.allow:
            if name not in KINDS:
                near = get_close_matches(name, KINDS, n=1)
                known = f"did you mean {near[0]}?" if near else f"it is one of {', '.join(KINDS)}"
                raise OptionError(f"allow: {quoted(name)} is not a kind of finding; {known}")
