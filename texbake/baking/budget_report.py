"""What a bake with a time budget tells of it: what was looked at, what was taken, how it went."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from texbake.time_budgets import TimeBudget


@dataclass(frozen=True)
class Candidate:
    """One choice that the probe looked at.

    Attributes
    ----------
    max_error : str
    rays_per_texel : float
        On the rows of the probe.
    predicted_seconds : float
        Of the bake after the probe.
    """

    max_error: str
    rays_per_texel: float
    predicted_seconds: float


@dataclass(frozen=True)
class BudgetReport(TimeBudget[Candidate]):
    """Which settings the time of a bake was turned into; see `TimeBudget`."""

    work: ClassVar[str] = "the bake"
    first_part: ClassVar[str] = "for the probe"
