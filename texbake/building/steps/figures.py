"""Figures of a step, apart from what differs from run to run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from texbake.progress import StageRecord

# What the machine and the moment decide.
_UNSTEADY = frozenset({"stages", "seconds", "threads", "max_memory", "budget"})


def steady(report: Any) -> Any:
    """A report without times and threads, so that the same inputs give the same bytes."""
    if isinstance(report, Mapping):
        return {key: steady(value) for key, value in report.items() if key not in _UNSTEADY}
    if isinstance(report, list | tuple):
        return [steady(value) for value in report]
    return report


def stage_seconds(stages: list[StageRecord]) -> dict[str, float]:
    """Seconds of each stage, by its name."""
    return {stage.name: stage.seconds for stage in stages}
