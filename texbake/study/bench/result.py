"""What the bench measured: settings, fronts, comparisons at equal error, and all as JSON."""

from __future__ import annotations

import math
from dataclasses import field
from typing import Any

from texbake.records import dataclass
from texbake.study.bench.map_tasks import BenchTask
from texbake.study.options import BenchOptions
from texbake.study.result import Measurement, ParetoRanking, pareto_front

FORMAT, VERSION = "texbake-bench", 2
OURS = "texbake"
_KEPT = ("setting", "error", "figures", "seconds", "peak_bytes")
# Errors that differ by less count as equal: points and rays are samples.
EQUAL = 1.02


@dataclass(frozen=True)
class Failure:
    """A setting that is left out, and why."""

    program: str
    label: str
    reason: str


@dataclass(frozen=True, eq=False)
class Match:
    """A setting of a program, and the fastest of texbake that is as accurate."""

    theirs: Measurement
    ours: Measurement | None  # None if no setting of texbake is as accurate

    @property
    def times_as_fast(self) -> float | None:
        """Their time over ours."""
        return None if self.ours is None else self.theirs.median / self.ours.median


@dataclass(frozen=True, eq=False)
class Standing:
    """A program among the others of a contest."""

    program: str
    equal: Measurement | None  # its fastest setting at the error that all reach
    measurements: list[Measurement]
    n_failures: int  # settings that failed

    def worst(self, figure: str) -> float | None:
        """Return the greatest value of a figure over all settings; None if there is none."""
        values = [item.outcome.figures.get(figure) for item in self.measurements]
        return max((value for value in values if value is not None), default=None)


@dataclass(frozen=True, eq=False)
class Contest(ParetoRanking):
    """One task on one case: all programs, all settings."""

    task: BenchTask
    # case, subject, truth, truth_text: as in `BenchCase` and `Prepared`.
    case: str
    subject: str
    truth: str
    truth_text: str
    measurements: tuple[Measurement, ...]  # settings of one program have its title as their series
    failures: tuple[Failure, ...] = ()
    triangles: int = 0  # that a generated case was made with; 0 for a user's meshes
    stated: tuple[str, ...] = ()  # programs whose errors are as their file states them

    @property
    def name(self) -> str:
        """A name for files and links."""
        return f"{self.task.name}-{self.case}".replace(" ", "-").lower()

    @property
    def programs(self) -> list[str]:
        """Titles of the programs, in their order."""
        return list(dict.fromkeys(item.setting.series for item in self.measurements))

    @property
    def memory_front(self) -> list[int]:
        """Settings that no other beats in memory and error."""
        return pareto_front([(_memory(item), item.error) for item in self.measurements])

    def curve(self, program: str, *, memory: bool = False) -> list[int]:
        """Settings of a program that no other setting of its own beats, fastest (least) first."""
        own = [i for i, item in enumerate(self.measurements) if item.setting.series == program]
        items = [self.measurements[i] for i in own]
        points = [(_memory(item) if memory else item.median, item.error) for item in items]
        return [own[i] for i in pareto_front(points)]

    def matches(self) -> list[Match]:
        """Compare each setting of another program that is on its curve with texbake's, if any."""
        if OURS not in self.programs:
            return []
        others = [program for program in self.programs if program != OURS]
        return [self.match(self.measurements[i]) for program in others for i in self.curve(program)]

    def match(self, theirs: Measurement) -> Match:
        """Compare a setting with texbake's of the same name, or else its fastest, as accurate."""
        ours = [self.measurements[i] for i in self.curve(OURS)]
        ours = [
            *(
                item
                for item in self.measurements
                if item.setting.series == OURS and item.setting.label == theirs.setting.label
            ),
            *ours,
        ]
        equal = [item for item in ours if item.error <= EQUAL * theirs.error]
        return Match(theirs, equal[0] if equal else None)

    def standings(self) -> list[Standing]:
        """Compare all programs at the least error that each of them reaches."""
        reached = {
            program: min(item.error for item in self.measurements if item.setting.series == program)
            for program in self.programs
        }
        error = max(reached.values(), default=0.0)
        names = dict.fromkeys([*self.programs, *(failure.program for failure in self.failures)])
        found = []
        for program in names:
            own = [item for item in self.measurements if item.setting.series == program]
            equal = [item for item in own if item.error <= EQUAL * error]
            found.append(
                Standing(
                    program,
                    min(equal, key=lambda item: item.median, default=None),
                    own,
                    sum(failure.program == program for failure in self.failures),
                )
            )
        return found

    def to_json(self) -> dict[str, Any]:
        """Return everything but the pictures."""
        front, memory_front = set(self.front), set(self.memory_front)
        return {
            "task": self.task.name,
            "case": self.case,
            "triangles": self.triangles,
            "subject": self.subject,
            "truth": self.truth,
            "truth_text": self.truth_text,
            "error": self.task.error,
            "unit": self.task.unit,
            "settings": [
                {
                    "program": item.setting.series,
                    **{k: v for k, v in item.to_json().items() if k in _KEPT},
                    "on_front": i in front,
                    "on_memory_front": i in memory_front,
                }
                for i, item in enumerate(self.measurements)
            ],
            "left_out": [
                {"program": item.program, "setting": item.label, "reason": item.reason}
                for item in self.failures
            ],
        }


def _memory(item: Measurement) -> float:
    return math.inf if item.peak_bytes is None else float(item.peak_bytes)


@dataclass(frozen=True, eq=False)
class BenchResult:
    """Everything that the bench measured."""

    options: BenchOptions
    # machines, versions: what each program ran on, and its version, by title.
    machines: dict[str, dict[str, Any]]
    versions: dict[str, str]
    missing: dict[str, str]  # programs that are not installed, by title, and why they are not
    contests: tuple[Contest, ...]
    seconds: float = 0.0  # time of the whole bench
    inputs: dict[str, str] = field(default_factory=dict)
    date: str = ""  # such as 2026-11-27

    def to_json(self) -> dict[str, Any]:
        """Return everything but the pictures."""
        return {
            "format": FORMAT,
            "version": VERSION,
            "date": self.date,
            "inputs": self.inputs,
            "programs": {
                title: {"version": version, "machine": self.machines[title]}
                for title, version in self.versions.items()
            },
            "missing": self.missing,
            "repeats": self.options.repeats,
            "quick": self.options.quick,
            "seconds": self.seconds,
            "contests": [contest.to_json() for contest in self.contests],
        }
