"""A hard case: an input made by code, and a sentence on what goes wrong in naive code."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
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


def only(cases: tuple[Case[T], ...], trait: str) -> tuple[Case[T], ...]:
    """Cases that have a trait."""
    return tuple(case for case in cases if trait in case.traits)
