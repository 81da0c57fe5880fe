"""A knob: the settings of one thing, how to try each, and how wrong each is.

A knob prepares a `Bench` for a case. A setting costs the time of `Bench.work` alone; `Bench.judge`
then compares its product with the truth, untimed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from texbake.study.case import Case

TRUTHS = ("closed form", "exact values", "high-poly mesh", "rays", "converged")


@dataclass(frozen=True)
class Setting:
    """One value of a knob.

    Attributes
    ----------
    label : str
        Its name in plots, unique within the knob.
    value
        The argument of `Bench.work`.
    series : str
        Settings of one series turn one thing up step by step; plots join them.
    problem : str
        Settings compete only with others of the same problem; each problem has a front of its own.
    """

    label: str
    value: Any
    series: str = ""
    problem: str = ""


@dataclass(frozen=True, eq=False)
class Judgment:
    """How good the product of a setting is.

    Attributes
    ----------
    error : float
        0 or more, in the unit of the knob.
    picture : (H, W, 3) float32, optional
        A crop that shows it, in linear light.
    figures : mapping of str to float
        What else was measured, by names that include the unit: `missed texels (%)`.
    """

    error: float
    picture: npt.NDArray[np.float32] | None = None
    figures: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Bench:
    """A knob prepared for a case.

    Attributes
    ----------
    subject : str
        What is worked on, in words.
    truth : str
        One of `TRUTHS`: a closed form; the values before they were encoded; the high-poly mesh that
        is approximated; separate rays cast into it, without a texture between; or what the work
        converges to, at a setting far beyond those that are tried.
    truth_text : str
        The same in a sentence.
    settings : tuple of Setting
        Faster ones first.
    work
        From a value to a product; timed.
    judge
        From a value and its product to a judgment; not timed.
    close
        Removes temporary files.
    """

    subject: str
    truth: str
    truth_text: str
    settings: tuple[Setting, ...]
    work: Callable[[Any], Any]
    judge: Callable[[Any, Any], Judgment]
    close: Callable[[], None] = lambda: None


@dataclass(frozen=True)
class Unfit:
    """Why a knob cannot be studied on a case; it is then left out of the study.

    Attributes
    ----------
    reason : str
        Begins with what does not fit, as an error message does.
    """

    reason: str


@dataclass(frozen=True)
class Knob:
    """Something that a user can turn up or down.

    Attributes
    ----------
    about : str
        What it is and what to expect of it, in a sentence or two.
    error : str
        What its error is, in words, for the axis of its plot.
    unit : str
        Of the error: `°`, `%`, `texels` and the like.
    kind : str
        Errors of one kind are shown in one plot: `angle`, `length`, `picture`, ...
    needs : str
        What of the user it can be studied on: `pair`, `scene` or `nothing`.
    prepare
        Prepares it, or says why it cannot be studied.
    baseline : str
        Series that the others are compared with: the page says in what share of its time they reach
        the same errors.
    """

    name: str
    title: str
    about: str
    error: str
    unit: str
    kind: str
    needs: str
    prepare: Callable[[Case], Bench | Unfit]
    baseline: str = ""
