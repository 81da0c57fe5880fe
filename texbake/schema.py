"""Options, each declared once: type, default, help, range and choices.

An option is a field of a frozen dataclass, with an `Option`: one sentence of help, a unit, a range,
choices. `option` declares one with its default; a field without a default, or a parameter of a
function, is annotated with its `Option`. Everything else is derived from it: the check of its
values, the flag of the command line, the keys of pipeline and scene files, their JSON Schema, and
the reference pages. This module imports nothing heavy, so that `--help` answers at once.
"""

from __future__ import annotations

import ast
import math
import sys
import types
from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, MISSING, Field, field, fields, replace
from functools import cache
from inspect import cleandoc, get_annotations
from numbers import Integral, Real
from typing import Annotated, Any, TypeVar, Union, get_args, get_origin

from texbake.errors import OptionError
from texbake.records import dataclass

JsonSchema = dict[str, Any]
Value = TypeVar("Value")

_JSON_TYPES = {bool: "boolean", int: "integer", float: "number", str: "string"}


@dataclass(frozen=True)
class Option:
    """Description of an option, in addition to its type and default."""

    help: str  # one sentence
    _: KW_ONLY
    # Placeholder for the value in help texts: `N`, `PX`, `X,Y,Z`. Parts in brackets are optional.
    metavar: str | None = None
    unit: str = ""  # unit of a number, in the plural
    choices: tuple[Any, ...] = ()  # all values, or all words that are allowed besides other values
    low: float | None = None  # least and greatest value, inclusive
    high: float | None = None
    above: float | None = None  # exclusive bounds
    below: float | None = None
    default: str = ""  # meaning of None, in words
    # flag on the command line, if it differs from the name: `--faces`, `--color/--data`
    flag: str = ""
    many: bool = False  # whether the flag of a tuple is repeated, with one value each

    @property
    def sentence(self) -> str:
        """Help, with the unit added unless the help mentions it."""
        if not self.unit or self.unit.split()[0] in self.help.lower():
            return self.help
        return f"{self.help.removesuffix('.')}, in {self.unit}."

    @property
    def range(self) -> str:
        """Range in words: `1 to 16384`, `above 0 and below 180`; "" if there is none."""
        if self.low is not None and self.high is not None:
            return f"{_shown(self.low)} to {_shown(self.high)}"
        words = [
            (self.low, "{} or more"),
            (self.above, "above {}"),
            (self.high, "at most {}"),
            (self.below, "below {}"),
        ]
        return " and ".join(word.format(_shown(end)) for end, word in words if end is not None)

    def holds(self, value: float) -> bool:
        """Whether a number lies in the range."""
        return (
            (self.low is None or value >= self.low)
            and (self.high is None or value <= self.high)
            and (self.above is None or value > self.above)
            and (self.below is None or value < self.below)
        )


@dataclass(frozen=True)
class OptionField:
    """A field of an option class."""

    name: str
    kinds: tuple[Any, ...]  # types of its values, without None
    optional: bool  # whether the value can be None
    # Its description. For a field without an `Option`, the help is taken from the docstring of the
    # class.
    option: Option
    default: Any  # `dataclasses.MISSING` if the option is required
    checked: bool  # whether the field is annotated with an `Option`

    @property
    def required(self) -> bool:
        """Whether the option has no default."""
        return self.default is MISSING

    def check(self, value: Any) -> None:
        """Raise `OptionError` unless a value is a choice, or has the right type and range."""
        words = self.option.choices
        if (value is None and self.optional) or self._chooses(value):
            return
        numeric = [
            kind
            for kind in self.kinds
            if _is_numeric(kind) and not (kind is int and any(isinstance(w, int) for w in words))
        ]
        if any(_fits(kind, value) for kind in numeric):
            self._check_range(value)
        elif all(kind in numeric or self._is_chosen(kind) for kind in self.kinds):
            wanted = [f"one of {', '.join(map(str, words))}"] if words else []
            wanted += map(_kind_words, numeric)
            neither = "neither" if len(wanted) > 1 else "not"
            if isinstance(value, tuple) and any(map(_is_several_words, self.kinds)):
                value = next(item for item in value if not _is_word(item, words))
            shown = value if words and isinstance(value, str) else repr(value)
            raise OptionError(f"{self.name}: {shown} is {neither} {' nor '.join(wanted)}")

    def _chooses(self, value: Any) -> bool:
        """Whether a value is one of the choices, or a tuple of choices if the type allows it."""
        words = self.option.choices
        if isinstance(value, tuple) and any(map(_is_several_words, self.kinds)):
            return bool(words) and all(_is_word(item, words) for item in value)
        return _is_word(value, words)

    def _is_chosen(self, kind: Any) -> bool:
        """Whether the choices are the only values of a type."""
        words = self.option.choices
        return bool(words) and (_is_several_words(kind) or kind in {type(word) for word in words})

    def _check_range(self, value: Any) -> None:
        option = self.option
        for number in value if isinstance(value, Sequence) else (value,):
            if number is not None and not option.holds(number):
                unit = f" {option.unit}" if option.unit else ""
                raise OptionError(
                    f"{self.name}: {number} is out of range; it must be {option.range}{unit}"
                )

    def json_schema(self) -> JsonSchema:
        """Return the JSON Schema of the values in a file: no None, and tuples as arrays."""
        kinds = [kind for kind in self.kinds if get_origin(kind) is not Callable]
        schema = _any_of([_json_type(kind, self.option) for kind in kinds])
        schema |= {"description": self.help}
        if not self.required and self.default is not None:
            schema["default"] = _plain(self.default)
        return schema

    @property
    def help(self) -> str:
        """Help with the unit and the default."""
        words = self.option.default
        return f"{self.option.sentence} Default: {words}." if words else self.option.sentence


def option(default: Value, help_or_option: str | Option, /, **attributes: Any) -> Value:
    """Declare a field of a dataclass: its default, its help, and other attributes of `Option`."""
    declared = help_or_option
    if isinstance(declared, str):
        declared = Option(declared, **attributes)
    return field(default=default, metadata={"option": declared})


Size = int | tuple[int, int]  # in pixels or texels: of both sides, or width and height
THREADS_OPTION = Option("Number of threads.", metavar="N", low=1, default="one per processor")


class CheckedOptions:
    """Base of option classes, whose values are checked when they are created."""

    def __post_init__(self) -> None:
        """Check every value, made a number of Python, against its type, range and choices."""
        kind: Any = type(self)
        for item in option_fields(kind):
            if item.checked:
                value = getattr(self, item.name)
                item.check(value)
                object.__setattr__(self, item.name, _of_python(value))


def _of_python(value: Any) -> Any:
    """Return a number, or a tuple of numbers, without the types of NumPy."""
    if isinstance(value, tuple):
        return tuple(map(_of_python, value))
    if isinstance(value, int | float | str):
        return value
    if isinstance(value, Integral):
        return int(value)
    return float(value) if isinstance(value, Real) else value


def check_fields(instance: Any, prefix: str = "") -> None:
    """Check words and numbers of a dataclass, named with a `prefix`; tuples check themselves."""
    kind: Any = type(instance)
    for item in option_fields(kind):
        if item.checked and not any(get_origin(each) is tuple for each in item.kinds):
            named = replace(item, name=prefix + item.name) if prefix else item
            named.check(getattr(instance, item.name))


@cache
def option_fields(kind: Any) -> tuple[OptionField, ...]:
    """Return the options of a dataclass, in their order."""
    return tuple(_option_field(kind, item) for item in fields(kind))


def option_field(kind: type, name: str) -> OptionField:
    """Return one option of a dataclass."""
    return next(item for item in option_fields(kind) if item.name == name)


def option_of(kind: type, name: str) -> Option:
    """Return the description of an option, to use it in another class as well."""
    return option_field(kind, name).option


def _option_field(kind: type, item: Field[Any]) -> OptionField:
    hint, described = _hint_of(kind, item), item.metadata.get("option")
    if get_origin(hint) is Annotated:
        hint, *annotations = get_args(hint)
        described = next((each for each in annotations if isinstance(each, Option)), None)
    parts = get_args(hint) if get_origin(hint) in (Union, types.UnionType) else (hint,)
    default = item.default
    if default is MISSING and item.default_factory is not MISSING:
        default = item.default_factory()
    return OptionField(
        name=item.name,
        kinds=tuple(part for part in parts if part is not type(None)),
        # The class chooses a value where the default is None and the type has none.
        optional=type(None) in parts or default is None,
        option=described or Option(_described(kind).get(item.name, "")),
        default=default,
        checked=described is not None,
    )


def _hint_of(kind: type, item: Field[Any]) -> Any:
    """Return the type of a field; `Any` if its name is imported only for type checking."""
    if not isinstance(item.type, str):
        return item.type
    owner = next(base for base in kind.__mro__ if item.name in get_annotations(base))
    names = vars(sys.modules[owner.__module__])
    try:
        return eval(item.type, names)
    except NameError:
        parts = ast.parse(item.type, mode="eval").body
        if not (isinstance(parts, ast.Subscript) and isinstance(parts.slice, ast.Tuple)):
            return Any
        said = eval(ast.unparse(parts.slice.elts[1]), names)
        return Annotated[Any, said] if isinstance(said, Option) else Any


@cache
def _described(kind: type) -> dict[str, str]:
    """Return the first sentence on each attribute in the docstrings of a class and its bases."""
    found: dict[str, str] = {}
    for base in reversed(kind.__mro__[:-1]):
        # Python 3.13 and newer take the indentation away themselves.
        doc = cleandoc(vars(base).get("__doc__") or "")
        _, _, listed = doc.partition("Attributes\n")
        names: list[str] = []
        for line in listed.splitlines()[1:]:
            if line.startswith("    "):
                for name in names:
                    found[name] = f"{found.get(name, '')} {line.strip()}".strip()
            elif line.strip():
                names = [name.strip() for name in line.partition(" : ")[0].split(",")]
                found |= dict.fromkeys(names, "")
    return found


def _shown(number: float) -> str:
    return str(number) if isinstance(number, int) else f"{number:g}"


def _is_word(value: Any, words: tuple[Any, ...]) -> bool:
    """Whether a value is a choice; 4.0 and True do not count as 4 and 1, though they are equal."""
    exact: bool = type(value) is not bool and isinstance(value, str | Integral)
    return exact and any(value == word for word in words)


def _is_several_words(kind: Any) -> bool:
    return bool(kind == tuple[str, ...])


def _is_numeric(kind: Any) -> bool:
    """Whether values are numbers or tuples of numbers."""
    if get_origin(kind) is tuple:
        return all(_is_numeric(part) or part is ... or _is_maybe(part) for part in get_args(kind))
    return kind in (int, float)


def _is_maybe(part: Any) -> bool:
    """Whether a part of a tuple is a number or None."""
    return get_origin(part) in (Union, types.UnionType) and all(
        each in (int, float, type(None)) for each in get_args(part)
    )


def _fits(kind: Any, value: Any) -> bool:
    if get_origin(kind) is not tuple:
        whole = isinstance(value, Integral)
        number = whole if kind is int else isinstance(value, Real) and math.isfinite(value)
        return number and not isinstance(value, bool)
    parts = get_args(kind)
    if isinstance(value, str) or not isinstance(value, Sequence):
        return False
    if ... in parts:
        return len(value) > 0 and all(_fits(parts[0], each) for each in value)
    return len(value) == len(parts) and all(
        (each is None and _is_maybe(part)) or _fits(float if _is_maybe(part) else part, each)
        for part, each in zip(parts, value, strict=True)
    )


def _kind_words(kind: Any) -> str:
    if get_origin(kind) is not tuple:
        return "a whole number" if kind is int else "a finite number"
    parts = get_args(kind)
    what = "whole numbers" if parts[0] is int else "finite numbers"
    return what if ... in parts else f"{len(parts)} {what}"


def _json_type(kind: Any, option: Option) -> JsonSchema:
    if kind in (int, float):
        bounds = {
            "minimum": option.low,
            "maximum": option.high,
            "exclusiveMinimum": option.above,
            "exclusiveMaximum": option.below,
        }
        found = {key: bound for key, bound in bounds.items() if bound is not None}
        numbers = [word for word in option.choices if isinstance(word, int)]
        return {"enum": numbers} if numbers else {"type": _JSON_TYPES[kind], **found}
    if kind is str:
        words = [word for word in option.choices if isinstance(word, str)]
        return {"enum": words} if words else {"type": "string"}
    if kind is bool:
        return {"type": "boolean"}
    if get_origin(kind) is tuple:
        parts = get_args(kind)
        if ... in parts:
            return {"type": "array", "items": _json_type(parts[0], option)}
        item, *others = [_json_type(part, option) for part in parts if not _is_maybe(part)]
        ends = {"minItems": 1 + len(others), "maxItems": len(parts)}
        if all(other == item for other in others):
            return {"type": "array", "items": item, **ends}
        return {"type": "array", "prefixItems": [item, *others], **ends}
    if get_origin(kind) in (dict, Mapping):
        return {"type": "object"}
    return {}


def _any_of(schemas: list[JsonSchema]) -> JsonSchema:
    """Return one schema for values that match any of several schemas."""
    different = [schema for i, schema in enumerate(schemas) if schema not in schemas[:i]]
    if {} in different or not different:
        return {}
    return different[0] if len(different) == 1 else {"anyOf": different}


def _plain(value: Any) -> Any:
    return [_plain(item) for item in value] if isinstance(value, tuple) else value
