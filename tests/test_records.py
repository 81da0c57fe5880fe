"""Dataclasses that get their methods at first use behave like those of the standard library."""

import copy
import dataclasses
import inspect
import pickle
from dataclasses import KW_ONLY, FrozenInstanceError, field, fields, is_dataclass
from typing import Any

import pytest

from texbake import records


def classes(decorate: Any) -> dict[str, Any]:
    """Classes with all that texbake uses of dataclasses."""

    @decorate(frozen=True)
    class Point:
        x: float
        y: float = 2.0
        names: list[str] = field(default_factory=list, compare=False)
        hidden: int = field(default=3, repr=False)

    @decorate(frozen=True, kw_only=True)
    class Named(Point):
        name: str

        def __post_init__(self) -> None:
            object.__setattr__(self, "name", self.name.upper())

    @decorate(frozen=True, eq=False, repr=False)
    class Identity:
        a: int
        _: KW_ONLY
        b: int = 1

        def __repr__(self) -> str:
            return "own"

    @decorate
    class Open:
        a: int = 0

    @decorate(frozen=True)
    class Empty:
        pass

    return {kind.__name__: kind for kind in (Point, Named, Identity, Open, Empty)}


CALLS: list[tuple[str, tuple[Any, ...], dict[str, Any]]] = [
    ("Point", (1.0,), {}),
    ("Point", (1.0, 5.0, ["a"]), {"hidden": 4}),
    ("Point", (), {}),
    ("Point", (1.0,), {"unknown": 1}),
    ("Named", (1.0,), {"name": "n"}),
    ("Named", (1.0,), {}),
    ("Identity", (1,), {"b": 2}),
    ("Identity", (1, 2), {}),
    ("Open", (), {}),
    ("Open", (3,), {}),
    ("Empty", (), {}),
]


def outcome(function: Any) -> Any:
    try:
        return function()
    except (TypeError, AttributeError) as error:
        return type(error), str(error)


def observed(kind: Any, arguments: tuple[Any, ...], more: dict[str, Any]) -> list[Any]:
    """What can be seen of a class and of an instance that is made of these arguments."""
    seen: list[Any] = [is_dataclass(kind), str(inspect.signature(kind)), kind.__match_args__]
    seen.append([(f.name, f.type, f.default, f.kw_only) for f in fields(kind)])
    made = outcome(lambda: kind(*arguments, **more))
    if isinstance(made, tuple):
        return [*seen, made]
    twin = kind(*arguments, **more)
    seen += [repr(made), vars(made), made == twin, made == 1, made != twin]
    seen.append(outcome(lambda: hash(made) == hash(twin)))
    seen.append(outcome(lambda: setattr(made, "x", 7)))
    seen.append(outcome(lambda: delattr(made, "hidden")))
    seen.append(outcome(lambda: repr(dataclasses.replace(twin))))
    seen.append(repr(copy.copy(twin)))
    return seen


@pytest.mark.parametrize(("name", "arguments", "more"), CALLS)
def test_classes_behave_as_those_of_the_standard_library(
    name: str, arguments: tuple[Any, ...], more: dict[str, Any]
) -> None:
    late, standard = (
        observed(classes(decorate)[name], arguments, more)
        for decorate in (records.dataclass, dataclasses.dataclass)
    )
    assert late == standard


@records.dataclass(frozen=True)
class Pickled:
    a: int


def test_instances_are_pickled_and_frozen() -> None:
    assert pickle.loads(pickle.dumps(Pickled(1))) == Pickled(1) != Pickled(2)
    with pytest.raises(FrozenInstanceError, match="cannot assign to field 'a'"):
        Pickled(1).a = 2


def test_an_initializer_is_written_for_the_first_instance_alone() -> None:
    kind = classes(records.dataclass)["Open"]
    assert not inspect.isfunction(vars(kind)["__init__"])
    kind(1)
    assert inspect.isfunction(vars(kind)["__init__"])
