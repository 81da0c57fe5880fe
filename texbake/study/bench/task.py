"""A task of the bench: the same job for every program, and how wrong its products are."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from texbake.study.bench.cases import BenchCase
from texbake.study.bench.options import BenchOptions
from texbake.study.bench.programs import Product
from texbake.study.knob import Judgment


@dataclass(frozen=True, eq=False)
class Prepared:
    """A task prepared for a case.

    Attributes
    ----------
    subject : str
        What is worked on, in words.
    truth : str
        One of `texbake.study.knob.TRUTHS`.
    truth_text : str
        The same in a sentence.
    job : mapping
        What all programs are given: files and common settings.
    judge
        From a product to how wrong it is.
    """

    subject: str
    truth: str
    truth_text: str
    job: Mapping[str, Any]
    judge: Callable[[Product], Judgment]


@dataclass(frozen=True, eq=False)
class BenchTask:
    """Something that several programs can do.

    Attributes
    ----------
    about : str
        What is done, in a sentence or two.
    error, unit : str
        What its error is, for the axes of plots.
    prepare
        Writes the files into a folder; None if the task cannot be done, or judged, on the case.
    """

    name: str
    title: str
    about: str
    error: str
    unit: str
    prepare: Callable[[BenchCase, BenchOptions, Path], Prepared | None]
