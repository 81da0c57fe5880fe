"""The closest bound on the error that is predicted to fit into a given time.

A small part of the map or picture is sampled for one bound of a ladder after another, from the
widest to the closest, each half as wide as the one before. From each the time of the whole is
predicted, and the closest bound that fits is chosen.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Generic, TypeVar

# Predictions must fit with this margin: timings on a shared machine differ by as much.
_MARGIN = 1.15
# Share of the time after which no closer bound is tried.
_PROBE_SHARE = 0.4

Bound = TypeVar("Bound")


@dataclass(frozen=True)
class Candidate:
    """One bound that was tried out.

    Attributes
    ----------
    max_error : str
    predicted_seconds : float
        Time of everything that follows the choice.
    rays_per_texel : float, optional
        Of a bake, in the rows that were tried.
    """

    max_error: str
    predicted_seconds: float
    rays_per_texel: float | None = None


@dataclass(frozen=True)
class TimeBudget:
    """What a time budget was turned into, and how it went; all times are wall-clock seconds.

    Attributes
    ----------
    work : str
        What takes the time, `the bake` or `the picture`.
    seconds : float
        The time budget.
    choice : str
        The settings chosen.
    why : str
        Why they are not finer.
    probe_seconds : float
        From the beginning to the choice. In pictures most of this is part of the work itself.
    predicted_seconds : float
        Of everything, `probe_seconds` included. It is chosen to be within the budget with a margin
        of 15 % on what follows the choice.
    actual_seconds : float
        Of everything, except reading and writing files.
    candidates : tuple of Candidate
        In the order in which they were tried.
    """

    work: str
    seconds: float
    choice: str
    why: str
    probe_seconds: float
    predicted_seconds: float
    actual_seconds: float = 0.0
    candidates: tuple[Candidate, ...] = ()

    @property
    def warnings(self) -> list[str]:
        """One, if the time was exceeded."""
        if self.actual_seconds <= self.seconds:
            return []
        return [
            f"{self.work} took {self.actual_seconds:.2f} s with {self.choice}, longer than its "
            f"time budget of {self.seconds:.4g} s; use a smaller size"
        ]

    def table(self) -> list[tuple[str, str]]:
        """Rows of a label and a figure, for a person."""
        return [
            ("time budget", f"{self.seconds:.4g} s: {self.choice}, {self.why}"),
            (
                "time predicted",
                f"{self.predicted_seconds:.2f} s, {self.probe_seconds:.2f} s of it before the "
                f"choice; took {self.actual_seconds:.2f} s",
            ),
        ]


@dataclass(frozen=True)
class Choice(Generic[Bound]):
    """The bound that a time was turned into.

    Attributes
    ----------
    bound : optional
        None where not even the widest fits.
    spent : float
        Seconds from the beginning to the choice.
    why : str
        Why it is not a closer one.
    candidates : tuple of Candidate
        All that were tried, the chosen one included.
    predicted : float, optional
        Seconds predicted for what follows; None without a bound.
    """

    bound: Bound | None
    spent: float
    why: str
    candidates: tuple[Candidate, ...]
    predicted: float | None


def choose_bound(
    ladder: Iterable[Bound],
    try_out: Callable[[Bound], Candidate],
    seconds: float,
    *,
    start: float,
    began: float,
    tries_first: bool,
) -> Choice[Bound]:
    """Try bounds until one does not fit any more, or the time for trying is spent.

    Parameters
    ----------
    ladder
        Bounds from the widest to the closest.
    try_out
        Samples a part for one bound, and predicts the time of the whole.
    seconds
        The time budget.
    start, began
        `time.perf_counter` when all of the work began, and when trying bounds did.
    tries_first
        Try the first bound however much time is spent.
    """
    candidates: list[Candidate] = []
    chosen: tuple[Bound, float] | None = None
    why = "the closest bound of the ladder"
    for bound in ladder:
        is_spent = time.perf_counter() - began > _PROBE_SHARE * (seconds - (began - start))
        if is_spent and (candidates or not tries_first):
            why = (
                "because trying closer bounds would take too much of the time"
                if candidates
                else "because what comes first left no time to try any bound"
            )
            break
        candidate = try_out(bound)
        candidates.append(candidate)
        reason = why_not(candidate, spent=time.perf_counter() - start, seconds=seconds)
        if reason is not None:
            why = reason
            break
        chosen = bound, candidate.predicted_seconds
    return Choice(
        bound=None if chosen is None else chosen[0],
        spent=time.perf_counter() - start,
        why=why,
        candidates=tuple(candidates),
        predicted=None if chosen is None else chosen[1],
    )


def why_not(candidate: Candidate, *, spent: float, seconds: float) -> str | None:
    """Return why a bound does not fit into a time, None if it does.

    Parameters
    ----------
    spent, seconds : float
        Seconds up to now, and those of the budget.

    Examples
    --------
    >>> why_not(Candidate("0.5deg", 9.0), spent=1.0, seconds=10.0)
    'because 0.5deg would take about 10.00 s in all, with a margin of 15 %'
    """
    predicted = candidate.predicted_seconds
    if spent + _MARGIN * predicted <= seconds:
        return None
    return (
        f"because {candidate.max_error} would take about {spent + predicted:.2f} s in all, with a "
        f"margin of {100.0 * (_MARGIN - 1.0):.0f} %"
    )
