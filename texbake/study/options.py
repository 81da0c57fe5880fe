"""Every choice of a study, with its default, written once for the API and the command line."""

from __future__ import annotations

import math
from dataclasses import dataclass

from texbake.errors import OptionError

# In the order in which they are studied and shown.
KNOB_NAMES = (
    "texture-size",
    "samples",
    "bit-depth",
    "ray-direction",
    "light-mesh",
    "atlas-quality",
    "bump-gradient",
    "bump-form",
    "surface-detail",
    "tessellation",
    "texture-lookup",
    "interpolation",
    "environment",
    "shadow-map",
    "noise",
)


@dataclass(frozen=True, kw_only=True)
class StudyOptions:
    """What `study` does where the caller does not say otherwise.

    Attributes
    ----------
    knobs : tuple of str
        Which to study; the names are those of `KNOB_NAMES`.
    repeats : int
        Timed runs of each setting, beside a first one, which is counted only where it alone takes
        longer than `seconds`.
    seconds : float
        Once its timed runs have taken as long together, a setting is run no more, but each is
        timed at least twice.
    quick : bool
        A small range of each knob on small meshes and pictures: what a study looks like, in a
        minute.
    threads : int, optional
        None: every processor.
    """

    knobs: tuple[str, ...] = KNOB_NAMES
    repeats: int = 5
    seconds: float = 10.0
    quick: bool = False
    threads: int | None = None

    def __post_init__(self) -> None:
        unknown = [name for name in self.knobs if name not in KNOB_NAMES]
        if unknown:
            raise OptionError(
                f"knob: {unknown[0]!r} is not known; it is one of {', '.join(KNOB_NAMES)}"
            )
        if not self.knobs:
            raise OptionError("knob: none is named; name at least one, or leave it out for all")
        if not isinstance(self.repeats, int) or self.repeats < 1:
            raise OptionError(f"repeats: {self.repeats} runs tell no time; it must be 1 or more")
        if not 0.0 <= self.seconds < math.inf:
            raise OptionError(f"seconds: {self.seconds} is no length of time; it must be 0 or more")
        if self.threads is not None and self.threads < 1:
            raise OptionError(f"threads: {self.threads} is too few; it must be at least 1")

    @property
    def ordered_knobs(self) -> tuple[str, ...]:
        """Knobs to study, each once, in the order of `KNOB_NAMES`."""
        return tuple(name for name in KNOB_NAMES if name in self.knobs)
