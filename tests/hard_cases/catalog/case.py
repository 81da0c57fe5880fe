"""A hard case: an input made by code, and a sentence on what goes wrong in naive code."""

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import combinations, product
from typing import Generic, TypeVar

T = TypeVar("T")


@dataclass(frozen=True, kw_only=True, eq=False)
class Case(Generic[T]):
    """One hard case.

    Attributes
    ----------
    name : str
        What the tests and the documentation call it.
    wrong : str
        What goes wrong with it in a naive implementation.
    make : function
        Makes it; the same on every call.
    refused : dict of str to str
        Stages that refuse it with one clear error, and a part of what that says. A stage that is
        not named here must take it.
    traits : set of str
        What tests of a special property pick it by.
    """

    name: str
    wrong: str
    make: Callable[[], T]
    refused: dict[str, str] = field(default_factory=dict)
    traits: frozenset[str] = frozenset()


def only(cases, trait):
    return tuple(case for case in cases if trait in case.traits)


def pairwise(*axes):
    """Rows of one value from each axis, in which every two values of two axes meet."""
    sides = [range(len(axis)) for axis in axes]
    left = {
        ((i, x), (j, y))
        for i, j in combinations(range(len(axes)), 2)
        for x in sides[i]
        for y in sides[j]
    }
    rows = []
    for least in range(len(axes) * (len(axes) - 1) // 2, 0, -1):
        for row in product(*sides):
            found = left.intersection(combinations(enumerate(row), 2))
            if len(found) >= least:
                rows.append(tuple(axis[x] for axis, x in zip(axes, row, strict=True)))
                left -= found
    return rows
