"""What becomes of a time that is to be spent on the least error, for bakes and for pictures."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar, Generic, TypeVar

# Predictions are told to be met by this much: timings of a shared machine differ by as much.
_MARGIN = 1.15
# Of the time that is there for it: once it is spent, no closer bound is looked at.
PROBE_SHARE = 0.4

Candidate = TypeVar("Candidate")


def why_not(name: str, *, spent: float, predicted: float, seconds: float) -> str | None:
    """Why a choice does not fit into a time, None where it does.

    Parameters
    ----------
    name : str
        The choice.
    spent, predicted, seconds : float
        Seconds up to now, those that the rest is predicted to take, and those of the budget.

    Examples
    --------
    >>> why_not("0.5deg", spent=1.0, predicted=9.0, seconds=10.0)
    'because 0.5deg would take about 10.00 s in all, and a margin of 15 % is kept'
    """
    if spent + _MARGIN * predicted <= seconds:
        return None
    margin = 100.0 * (_MARGIN - 1.0)
    return (
        f"because {name} would take about {spent + predicted:.2f} s in all, and a margin of "
        f"{margin:.0f} % is kept"
    )


@dataclass(frozen=True)
class TimeBudget(Generic[Candidate]):
    """Which settings a time was turned into, and how it went; all times are wall-clock seconds.

    Attributes
    ----------
    seconds : float
        As asked for.
    choice : str
        The settings taken.
    why : str
    probe_seconds : float
        From the beginning to the choice.
    predicted_seconds : float
        Of everything, the probe as well, by the prediction; it is chosen to be within the budget
        with a margin of 15 %.
    actual_seconds : float
        Of everything; reading and writing files is no part of it.
    candidates : list
        In the order in which they were looked at.
    """

    seconds: float
    choice: str
    why: str
    probe_seconds: float
    predicted_seconds: float
    actual_seconds: float = 0.0
    candidates: list[Candidate] = field(default_factory=list)

    # What takes the time, and what part of it comes before the choice, in words.
    work: ClassVar[str]
    first_part: ClassVar[str]

    @property
    def warnings(self) -> list[str]:
        """Says so where the time was not kept."""
        if self.actual_seconds <= self.seconds:
            return []
        return [
            f"the time budget of {self.seconds:.4g} s was not kept, {self.work} took "
            f"{self.actual_seconds:.2f} s with {self.choice}; use a smaller --size"
        ]

    def table(self) -> list[tuple[str, str]]:
        """Rows of a label and a figure, for a person."""
        return [
            ("time budget", f"{self.seconds:.4g} s: {self.choice}, {self.why}"),
            (
                "time predicted",
                f"{self.predicted_seconds:.2f} s, {self.probe_seconds:.2f} s of it "
                f"{self.first_part}; took {self.actual_seconds:.2f} s",
            ),
        ]
