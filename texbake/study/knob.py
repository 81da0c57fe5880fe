"""A knob: the settings of one thing, how to try each, and how wrong each is.

A knob prepares an `Experiment` for a case. A setting costs the time of `Experiment.work` alone;
`Experiment.judge` then compares its product with the truth, untimed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from typing import TYPE_CHECKING, Any

from texbake.study.options import KNOB_MODULES

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from texbake.study.case import Case

TRUTHS = ("closed form", "exact values", "high-poly mesh", "rays", "converged")


@dataclass(frozen=True)
class Setting:
    """One value of a knob."""

    label: str  # its name in plots, unique within the knob
    value: Any  # the argument of `Experiment.work`
    series: str = ""  # settings of one series turn one thing up step by step; plots join them
    # Settings compete only with others of the same problem; each problem has a front of its own.
    problem: str = ""


@dataclass(frozen=True, eq=False)
class Evaluation:
    """How good the product of a setting is."""

    error: float  # 0 or more, in the unit of the knob
    # (H, W, 3) float32; a crop that shows it, in linear light.
    picture: npt.NDArray[np.float32] | None = None
    # What else was measured, by names that include the unit: `missed texels (%)`.
    figures: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Experiment:
    """A knob prepared for a case."""

    subject: str  # what is worked on, in words
    # One of `TRUTHS`: a closed form; the values before they were encoded; the high-poly mesh that
    # is approximated; separate rays cast into it, without a texture between; or what the work
    # converges to, at a setting far beyond those that are tried.
    truth: str
    truth_text: str  # the same in a sentence
    settings: tuple[Setting, ...]  # faster ones first
    work: Callable[[Any], Any]  # from a value to a product; timed
    judge: Callable[[Any, Any], Evaluation]  # from a value and its product to a judgment; not timed
    close: Callable[[], None] = lambda: None  # removes temporary files


@dataclass(frozen=True)
class NotApplicable:
    """Why a knob cannot be studied on a case; it is then left out of the study."""

    reason: str  # begins with what does not fit, as an error message does


@dataclass(frozen=True)
class Knob:
    """Something that a user can turn up or down."""

    name: str
    title: str
    about: str  # what it is and what to expect of it, in a sentence or two
    error: str  # what its error is, in words, for the axis of its plot
    unit: str  # of the error: `°`, `%`, `texels` and the like
    kind: str  # errors of one kind, such as `angle` or `picture`, are shown in one plot
    # Prepares it, or says why it cannot be studied.
    prepare: Callable[[Case], Experiment | NotApplicable]
    # Series that the others are compared with: the page says in what share of its time they reach
    # the same errors.
    baseline: str = ""


def knob_named(name: str) -> Knob:
    """Return the knob of one of `KNOB_NAMES`, importing its module.

    The constant of `map-kind`, for instance, is `MAP_KIND_KNOB`.
    """
    module = import_module(f"texbake.study.knobs.{KNOB_MODULES[name]}")
    knob: Knob = getattr(module, f"{name.replace('-', '_').upper()}_KNOB")
    return knob
