"""What the bench measured: JSON with everything, CSV with one line per setting."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from texbake.study.bench.tasks import BenchTask
from texbake.study.options import BenchOptions
from texbake.study.result import MEASURED, Measurement, ParetoRanking, pareto_front, settings_csv

SCHEMA = "texbake-bench-1"
OURS = "texbake"
# Errors that differ by less count as equal: points and rays are samples.
EQUAL = 1.02
CSV_COLUMNS = (
    *("task", "case", "program", "version", "setting", "subject", "truth"),
    *MEASURED,
    *("on_front", "on_memory_front"),
)


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
        """Compare each setting of another program that is on its curve with texbake's."""
        ours = [self.measurements[i] for i in self.curve(OURS)]
        found = []
        for program in self.programs:
            if program == OURS:
                continue
            for i in self.curve(program):
                theirs = self.measurements[i]
                equal = [item for item in ours if item.error <= EQUAL * theirs.error]
                found.append(Match(theirs, equal[0] if equal else None))
        return found

    def to_json(self) -> dict[str, Any]:
        """Return everything but the pictures."""
        front, memory_front = set(self.front), set(self.memory_front)
        return {
            "task": self.task.name,
            "case": self.case,
            "subject": self.subject,
            "truth": self.truth,
            "truth_text": self.truth_text,
            "error": self.task.error,
            "unit": self.task.unit,
            "settings": [
                {
                    "program": item.setting.series,
                    **{k: v for k, v in item.to_json().items() if k not in ("series", "problem")},
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

    def rows(self, versions: Mapping[str, str]) -> list[list[Any]]:
        """Return the lines of the CSV file, for `CSV_COLUMNS`."""
        front, memory_front = set(self.front), set(self.memory_front)
        return [
            [
                self.task.name, self.case, item.setting.series, versions[item.setting.series],
                item.setting.label, self.subject, self.truth, *item.columns(self.task.unit),
                int(i in front), int(i in memory_front),
            ]
            for i, item in enumerate(self.measurements)
        ]  # fmt: skip


def _memory(item: Measurement) -> float:
    return math.inf if item.peak_bytes is None else float(item.peak_bytes)


@dataclass(frozen=True, eq=False)
class BenchResult:
    """Everything that the bench measured."""

    options: BenchOptions
    machine: dict[str, Any]  # what it ran on
    versions: dict[str, str]  # versions of the programs, by title
    missing: dict[str, str]  # programs that are not installed, by title, and why they are not
    contests: tuple[Contest, ...]
    seconds: float = 0.0  # time of the whole bench
    inputs: dict[str, str] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """Return everything but the pictures."""
        return {
            "schema": SCHEMA,
            "inputs": self.inputs,
            "machine": self.machine,
            "versions": self.versions,
            "missing": self.missing,
            "repeats": self.options.repeats,
            "quick": self.options.quick,
            "seconds": self.seconds,
            "contests": [contest.to_json() for contest in self.contests],
        }

    def to_csv(self) -> str:
        """Return a table with one line per setting; see `settings_csv`."""
        settings = [item for contest in self.contests for item in contest.measurements]
        rows = [row for contest in self.contests for row in contest.rows(self.versions)]
        return settings_csv(CSV_COLUMNS, settings, rows)
