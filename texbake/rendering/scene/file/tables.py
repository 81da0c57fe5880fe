"""Tables of a scene file, derived from the classes that they become.

A key is a field of its class and has its default, so that what a class can hold can be written in a
file, and no default is written twice. pydantic checks; the class itself is made in the same pass,
so that what it raises gets its place in the file.
"""

from __future__ import annotations

import sys
import types
from collections.abc import Callable, Mapping
from dataclasses import MISSING, Field as DataField, fields
from inspect import get_annotations
from typing import Annotated, Any, ClassVar, Union, get_args, get_origin

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, create_model, model_validator

from texbake.rendering.scene.file.faults import (
    fault,
    key_fault,
    nearest,
    shown,
)
from texbake.rendering.scene.file.values import (
    Color,
    Colors,
    Number,
    Plain,
    Switch,
    Text,
    Whole,
    numbers,
)

# Types of keys by their names, where the type of the field does not tell enough.
_BY_NAME: dict[str, Any] = {
    "color": Color,
    "ground": Color,
    "colors": Colors,
}
_BY_HINT: dict[Any, Any] = {float: Number, int: Whole, bool: Switch, str: Text}


class Table(BaseModel):
    """A table whose keys are checked one by one.

    Attributes
    ----------
    source
        The class whose fields its keys are.
    short
        Key that a value stands for which is no table; None where it must be one.
    switchable
        Whether `true` stands for a table with nothing in it.
    takes_more
        Whether keys that are not known are kept.
    """

    model_config = ConfigDict(extra="ignore", arbitrary_types_allowed=True)
    source: ClassVar[type | None] = None
    short: ClassVar[str | None] = None
    switchable: ClassVar[bool] = False
    takes_more: ClassVar[bool] = False

    @model_validator(mode="before")
    @classmethod
    def _check_keys(cls, value: Any) -> Any:
        if value is True and cls.switchable:
            value = {}
        if not isinstance(value, dict):
            if cls.short is None:
                raise fault(f"{shown(value)} is no table; its keys are {', '.join(cls.keys())}")
            value = {cls.short: value}
        if not cls.takes_more:
            for key in value:
                if key not in cls.model_fields:
                    raise key_fault(key, f"unknown key; {nearest(key, cls.keys())}")
        for key, field in cls.model_fields.items():
            if field.is_required() and key not in value:
                raise key_fault(key, "it is missing; it must be given")
        return value

    @classmethod
    def keys(cls) -> list[str]:
        """Keys that it knows."""
        return list(cls.model_fields)

    def given(self) -> dict[str, Any]:
        """Known keys that the file has, with their values, in the order of the class."""
        given = self.model_fields_set
        return {key: getattr(self, key) for key in type(self).model_fields if key in given}


class OpenTable(Table):
    """A table that keeps keys that are not known, for something else to check."""

    model_config = ConfigDict(extra="allow")
    takes_more: ClassVar[bool] = True


def table(
    kind: type,
    types_of: Mapping[str, Any] | None = None,
    *,
    name: str | None = None,
    without: tuple[str, ...] = (),
    required: tuple[str, ...] = (),
    short: str | None = None,
    switchable: bool = False,
    takes_more: bool = False,
    more: Mapping[str, Any] | None = None,
) -> type[Table]:
    """Model of the table that holds the fields of a dataclass.

    Parameters
    ----------
    kind
        The dataclass.
    types_of
        Types of keys whose field does not tell them.
    name
        Of the model; None: that of the class.
    without
        Fields that are no keys.
    required
        Keys that must be given though the field has a default.
    short, switchable, takes_more
        As of `Table`.
    more
        Types of further keys, which the class does not have.
    """
    checks = {**types_of_fields(kind), **(types_of or {})}
    keys: dict[str, Any] = {}
    for item in fields(kind):
        if item.name not in without:
            default = ... if item.name in required or _has_no_default(item) else None
            keys[item.name] = (checks[item.name], Field(default=default))
    for key, kind_of_key in (more or {}).items():
        keys[key] = (kind_of_key, Field(default=... if key in required else None))
    base = OpenTable if takes_more else Table
    model: type[Table] = create_model(name or kind.__name__, __base__=base, **keys)
    model.source, model.short, model.switchable = kind, short, switchable
    return model


def types_of_fields(kind: type) -> dict[str, Any]:
    """How keys named as the fields of a dataclass are checked, by the types of these."""
    return {
        item.name: _BY_NAME.get(item.name) or _type_of(_hint_of(kind, item))
        for item in fields(kind)
    }


def made(model: type[Table], make: Callable[..., Any]) -> Any:
    """Type of a table of which something is made: `make(**keys that are given)`."""
    return converted(model, lambda found: make(**found.given()))


def converted(kind: Any, convert: Callable[[Any], Any]) -> Any:
    """Type of a value of which a function makes another once it has been checked."""
    return Annotated[kind, AfterValidator(convert)]


def list_of(kind: Any, convert: Callable[[list[Any]], Any] = tuple) -> Any:
    """Type of a list of values of one type, of which a function makes something."""
    return converted(list[kind], convert)


def _has_no_default(item: DataField[Any]) -> bool:
    return item.default is MISSING and item.default_factory is MISSING


def _hint_of(kind: type, item: DataField[Any]) -> Any:
    """Type of a field; `Any` where only type checkers import its name."""
    owner = next(base for base in kind.__mro__ if item.name in get_annotations(base))
    try:
        return eval(str(item.type), vars(sys.modules[owner.__module__]))
    except NameError:
        return Any


def _type_of(hint: Any) -> Any:
    """How a key is checked, by the type of its field."""
    options = _options_of(hint)
    if len(options) != 1:
        return Plain
    (only,) = options
    if get_origin(only) is tuple:
        parts = get_args(only)
        if all(part in (float, int, ...) for part in parts):
            return numbers(None if ... in parts else len(parts))
        return Plain
    return _BY_HINT.get(only, Plain)


def _options_of(hint: Any) -> tuple[Any, ...]:
    """What a type can be, but None, which a file cannot hold."""
    if get_origin(hint) in (Union, types.UnionType):
        return tuple(part for part in get_args(hint) if part is not type(None))
    return (hint,)
