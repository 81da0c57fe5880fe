"""A knob: settings of one thing, how to try each, and how wrong it is.

A knob makes itself ready for a case and gives back a `Bench`. What a setting costs is the time of
`Bench.work` alone; `Bench.judge` then holds its product against the truth, untimed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from texbake.study.case import Case

TRUTHS = ("closed form", "exact values", "dense mesh", "rays", "converged")


@dataclass(frozen=True)
class Setting:
    """One value of a knob.

    Attributes
    ----------
    label : str
        What plots call it; unlike all others of its knob.
    value
        What `Bench.work` takes.
    series : str
        Settings of one series are one thing turned up step by step; plots join them.
    problem : str
        Settings compete only with those of the same problem; where a knob has several, each has a
        front of its own.
    """

    label: str
    value: Any
    series: str = ""
    problem: str = ""


@dataclass(frozen=True, eq=False)
class Outcome:
    """How good the product of a setting is.

    Attributes
    ----------
    error : float
        0 or more, in the unit of the knob.
    picture : (H, W, 3) float32, optional
        A crop that shows it, linear light.
    figures : mapping of str to float
        What else was measured; names carry their unit: `missed texels (%)`.
    """

    error: float
    picture: npt.NDArray[np.float32] | None = None
    figures: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Bench:
    """A knob made ready for a case.

    Attributes
    ----------
    subject : str
        What is worked on, in words.
    truth : str
        One of `TRUTHS`: a closed form; the values themselves before they were coded; the dense mesh
        that is approximated; rays of their own, cast into it with no texture between; or what the
        work converges to, the thing itself at a setting far beyond those that are tried.
    truth_text : str
        The same in a sentence.
    settings : tuple of Setting
        Quicker ones first.
    work
        From a value to a product; timed.
    judge
        From a value and its product to an outcome; not timed.
    close
        Clears away what was made to work in.
    """

    subject: str
    truth: str
    truth_text: str
    settings: tuple[Setting, ...]
    work: Callable[[Any], Any]
    judge: Callable[[Any, Any], Outcome]
    close: Callable[[], None] = lambda: None


@dataclass(frozen=True)
class Unfit:
    """Why a knob cannot be studied on a case: it is left out, and the others are studied.

    Attributes
    ----------
    reason : str
        Begins with the thing that does not fit, as an error message does.
    """

    reason: str


@dataclass(frozen=True)
class Knob:
    """Something that a user can turn up or down.

    Attributes
    ----------
    name, title : str
    about : str
        What it is and what to expect of it, in a sentence or two.
    error : str
        What its error is, in words, for the axis of its plot.
    unit : str
        Of the error: `°`, `%`, `texels` and the like.
    kind : str
        Errors of one kind are shown in one plot: `angle`, `length`, `picture`, ...
    needs : str
        What of a user's it can be studied on: `pair`, `scene` or `nothing`.
    prepare
        Makes it ready, or says why it cannot be studied.
    baseline : str
        Series that the others are held against: the page tells in what share of its time they reach
        its errors.
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
