"""What a bake with a time budget tells of it: what was looked at, what was taken, how it went."""

from __future__ import annotations

from dataclasses import dataclass, field


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
class BudgetReport:
    """Which settings a time was turned into, and how it went; all times are wall-clock seconds.

    Attributes
    ----------
    seconds : float
        As asked for.
    choice : str
        The settings taken.
    why : str
    probe_seconds : float
    predicted_seconds : float
        Of everything, the probe as well, by the prediction; it is chosen to be within the budget
        with a margin of 15 %.
    actual_seconds : float
        Of everything; reading and writing files is not part of a bake.
    candidates : list of Candidate
        In the order in which they were looked at.
    """

    seconds: float
    choice: str
    why: str
    probe_seconds: float
    predicted_seconds: float
    actual_seconds: float = 0.0
    candidates: list[Candidate] = field(default_factory=list)

    @property
    def warnings(self) -> list[str]:
        """Says so where the time was not kept."""
        if self.actual_seconds <= self.seconds:
            return []
        return [
            f"the time budget of {self.seconds:.4g} s was not kept, the bake took "
            f"{self.actual_seconds:.2f} s with {self.choice}; use a smaller --size"
        ]

    def table(self) -> list[tuple[str, str]]:
        """Rows of a label and a figure, for a person."""
        return [
            ("time budget", f"{self.seconds:.4g} s: {self.choice}, {self.why}"),
            (
                "time predicted",
                f"{self.predicted_seconds:.2f} s, {self.probe_seconds:.2f} s of it for the probe; "
                f"took {self.actual_seconds:.2f} s",
            ),
        ]
