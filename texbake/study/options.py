"""Every option of a study, with its default."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from texbake.baking.options import THREADS_OPTION
from texbake.errors import OptionError
from texbake.schema import CheckedOptions, Option, option

# In the order in which they are studied and shown, each with its module in `knobs`.
KNOB_MODULES = {
    "texture-size": "baked_maps",
    "samples": "baked_maps",
    "bit-depth": "baked_maps",
    "map-kind": "baked_maps",
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
    "environment": "lighting",
    "shadow-map": "lighting",
    "noise": "textures",
}
KNOB_NAMES = tuple(KNOB_MODULES)

REPEATS_OPTION = Option("Number of timed runs of each setting.", metavar="N", low=1)
SECONDS_OPTION = Option(
    "Seconds after which a setting is not run again, once it has been run twice.",
    metavar="S",
    low=0,
    unit="seconds",
)


@dataclass(frozen=True, kw_only=True)
class StudyOptions(CheckedOptions):
    """Which settings a study measures, and how often.

    Besides its timed runs each setting has a first one, which only counts where it alone takes
    longer than `seconds`.
    """

    knobs: tuple[str, ...] = option(
        KNOB_NAMES,
        "Setting to study; repeatable.",
        choices=KNOB_NAMES,
        metavar="NAME",
        default="all",
        flag="--knob",
        many=True,
    )
    repeats: int = option(5, REPEATS_OPTION)
    seconds: float = option(10.0, SECONDS_OPTION)
    quick: bool = option(False, "Study a small range of each setting on small meshes, in a minute.")
    threads: int | None = option(None, THREADS_OPTION)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.knobs:
            raise OptionError("knobs: none is named; name at least one, or leave it out for all")

    @property
    def ordered_knobs(self) -> tuple[str, ...]:
        """Knobs to study, each once, in the order of `KNOB_NAMES`."""
        return in_order(self.knobs, KNOB_NAMES)


def in_order(names: Collection[str], known: Sequence[str]) -> tuple[str, ...]:
    """Return names that a user gave, each once, in the order of all names."""
    return tuple(name for name in known if name in names)
