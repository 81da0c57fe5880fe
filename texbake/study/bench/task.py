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
    """A task prepared for a case."""

    subject: str  # what is worked on, in words
    truth: str  # one of `texbake.study.knob.TRUTHS`
    truth_text: str  # the same in a sentence
    job: Mapping[str, Any]  # what all programs are given: files and common settings
    judge: Callable[[Product], Judgment]  # from a product to how wrong it is


@dataclass(frozen=True, eq=False)
class BenchTask:
    """Something that several programs can do."""

    name: str
    title: str
    about: str  # what is done, in a sentence or two
    # error, unit: what its error is, for the axes of plots.
    error: str
    unit: str
    # Writes the files into a folder; None if the task cannot be done, or judged, on the case.
    prepare: Callable[[BenchCase, BenchOptions, Path], Prepared | None]
