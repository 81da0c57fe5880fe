"""Single values of a scene file, such as numbers, colors and files, and the errors of all tables.

Colors given as lists are linear; "#rrggbb", as shown by color pickers, is sRGB-coded.

An error is one line: the place, the value and what was expected. Checks raise `validation_error`,
pydantic records the place, and `first_error` combines both to a message.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import field
from pathlib import Path, PurePath
from typing import Annotated, Any

from pydantic import (
    AfterValidator,
    Field,
    PlainValidator,
    Strict,
    ValidationError,
    ValidationInfo,
    WithJsonSchema,
)
from pydantic_core import PydanticCustomError

from texbake.errors import (
    FileError,
    FileFormatError,
    OptionError,
    TexbakeError,
    quoted,
    shortened,
    similar,
)
from texbake.files import PathLike, require_file
from texbake.limits import LONGEST_NAME
from texbake.records import dataclass
from texbake.schema import JsonSchema

# Kinds of errors to report first, since they may cause others: a misspelled key is also missing.
_FIRST = ("key", "fault")
_MOST_KNOWN = 400  # characters of a list of words, which a file can make as long as it likes
_EXPECTED = {
    "float_type": "not a number; give one such as 0.5",
    "finite_number": "not finite; give a number such as 0.5",
    "int_type": "not a whole number; give one such as 4",
    "bool_type": "neither true nor false",
    "string_type": "not text; put it in quotes",
    "list_type": "not a list; give one in brackets",
    "dict_type": "not a table",
}
# Message of an options class: an optional owner, the option, and what is wrong.
_OPTION = re.compile(r"(?:[^:]*\.)?([\w-]+): (.*)", re.DOTALL)


def validation_error(what: str) -> PydanticCustomError:
    """Error for a value; `what` says what is wrong and what was expected."""
    return PydanticCustomError("fault", "{what}", {"what": what})


def value_error(value: Any, what: str) -> PydanticCustomError:
    """Error that starts with the value; `what` goes on with `is not a number`."""
    return validation_error(f"{format_value(value)} {what}")


def key_error(key: str, what: str) -> PydanticCustomError:
    """Error for a key in a table."""
    return PydanticCustomError("key", "{what}", {"what": what, "key": key})


def format_value(value: Any) -> str:
    """Format a value of a file for a message: shortened, with text in quotes."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, PurePath):
        return quoted(str(value))
    return "a table" if isinstance(value, dict) else quoted(value)


def nearest(word: str, known: Iterable[str]) -> str:
    """Suggest a similar word (`did you mean 'x'?`), or list the known words."""
    words = list(known)
    return similar(word, words) or shortened(f"known: {', '.join(words)}", _MOST_KNOWN)


def place_of(steps: Sequence[int | str]) -> str:
    """Format a place as `objects[1].material.roughness`, without steps in angle brackets."""
    place = ""
    for step in steps:
        if isinstance(step, int):
            place += f"[{step}]"
        elif not step.startswith("<"):
            place += f".{shortened(step)}" if place else shortened(step)
    return place


def first_error(error: ValidationError) -> str:
    """Format the first error with its place: `camera.fov: 'wide' is not a number`."""
    errors = error.errors(include_url=False)
    order = {kind: rank for rank, kind in enumerate(_FIRST)}
    worst = min(errors, key=lambda item: order.get(item["type"], len(order)))
    steps, kind = list(worst["loc"]), worst["type"]
    context = worst.get("ctx", {})
    if kind == "key":
        return f"{place_of([*steps, context['key']])}: {context['what']}"
    if kind == "fault":
        what = str(context["what"])
    elif kind == "value_error":
        return option_error(steps, context["error"])
    elif kind == "missing":
        what = "it is missing"
    else:
        what = f"{format_value(worst['input'])} is {_EXPECTED.get(kind, worst['msg'])}"
    return _line(steps, what)


def option_error(steps: Sequence[int | str], error: Exception) -> str:
    """Format an error raised while building the object at a place; it may start with an option."""
    message = str(error)
    named = _OPTION.fullmatch(message) if isinstance(error, OptionError) else None
    if named is None:
        return _line(steps, message)
    key, what = named[1].replace("-", "_"), named[2]
    return _line(steps if steps and steps[-1] == key else [*steps, key], what)


@contextmanager
def at(path: PathLike, *steps: int | str) -> Iterator[None]:
    """Add the place in the file to errors raised in this context."""
    try:
        yield
    except TexbakeError as error:
        raise FileFormatError(f"{path}: {option_error(steps, error)}") from error


def _line(steps: Sequence[int | str], what: str) -> str:
    place = place_of(steps)
    return f"{place}: {what}" if place else what


def value_type(check: Callable[..., Any], schema: JsonSchema) -> Any:
    """Type of a value that a function checks and converts, with its JSON Schema."""
    return Annotated[Any, PlainValidator(check), WithJsonSchema(schema)]


Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Whole = Annotated[int, Strict()]
Switch = Annotated[bool, Strict()]
Text = Annotated[str, Strict()]
_HEX = re.compile(r"#(?:[0-9a-fA-F]{3}|[0-9a-fA-F]{6})")
_COUNTS = {2: "two", 3: "three", 4: "four", 16: "sixteen"}


@dataclass(frozen=True)
class Place:
    """Context of validation: the folder of relative file names, and the files that were found."""

    folder: Path
    files: list[Path] = field(default_factory=list)


def is_number(value: object) -> bool:
    """Whether a value is a finite number."""
    if not isinstance(value, int | float) or isinstance(value, bool):
        return False
    return abs(value) <= sys.float_info.max  # integers of TOML have any length


def _is_list(value: object, n: int | None) -> bool:
    return (
        isinstance(value, list | tuple)
        and all(map(is_number, value))
        and (len(value) == n if n is not None else len(value) > 0)
    )


def numbers(n: int | None, *, or_one: bool = False) -> Any:
    """Type of a list of n finite numbers (None: one or more); `or_one` also takes one for all."""
    ends = {} if n is None else {"minItems": n, "maxItems": n}
    schema = {"type": "array", "items": {"type": "number"}, **(ends or {"minItems": 1})}
    wanted = f"a list of {_COUNTS.get(n, n)} numbers" if n is not None else "a list of numbers"

    def check(value: Any) -> tuple[float, ...]:
        if or_one and is_number(value):
            return (float(value),) * (n or 1)
        if not _is_list(value, n):
            raise value_error(value, f"is not {'a number or ' if or_one else ''}{wanted}")
        return tuple(map(float, value))

    if or_one:
        schema = {"anyOf": [{"type": "number"}, schema]}
    return value_type(check, schema)


def linear(value: str) -> tuple[float, float, float]:
    """Linear color of an sRGB-coded "#rrggbb" or "#rgb"; raises for other text."""
    if not _HEX.fullmatch(value):
        raise validation_error(
            f"{quoted(value)} is not a color; write '#rrggbb', or a list of three linear numbers"
        )
    from texbake.texture.encoding import decode_srgb

    digits = value[1:] if len(value) == 7 else "".join(2 * digit for digit in value[1:])
    codes = [int(digits[i : i + 2], 16) / 255.0 for i in (0, 2, 4)]
    red, green, blue = decode_srgb(codes).tolist()
    return red, green, blue


def color_of(value: Any) -> tuple[float, ...]:
    """Linear color from three linear numbers or from "#rrggbb"."""
    if isinstance(value, str):
        return linear(value)
    if not _is_list(value, 3):
        raise value_error(value, "is not a color; give three linear numbers or '#rrggbb'")
    if min(value) < 0:
        raise value_error(value, "is not a color; its numbers must be 0 or more")
    return tuple(map(float, value))


def _factor(value: Any) -> float | tuple[float, ...]:
    return float(value) if is_number(value) else color_of(value)


HEX_COLOR = {"type": "string", "pattern": f"^{_HEX.pattern}$"}
COLOR = {
    "anyOf": [
        HEX_COLOR,
        {"type": "array", "items": {"type": "number", "minimum": 0}, "minItems": 3, "maxItems": 3},
    ]
}
Vector = numbers(3)
Color = value_type(color_of, COLOR)
# A number or a color that a texture is multiplied by.
Factor = value_type(_factor, {"anyOf": [{"type": "number"}, *COLOR["anyOf"]]})


def _check_word(value: Any, words: Sequence[str]) -> None:
    if not isinstance(value, str) or value not in words:
        advice = nearest(value, words) if isinstance(value, str) else ""
        advice = f"; {advice}" if advice.startswith("did") else ""
        raise value_error(value, f"is not one of {', '.join(words)}{advice}")


def choice(words: Sequence[str]) -> Any:
    """Type of a word from a list."""

    def check(value: Any) -> Any:
        _check_word(value, words)
        return value

    return value_type(check, {"enum": list(words)})


def one_or_two(words: Sequence[str]) -> Any:
    """Type of a word from a list, or of two: for u and for v."""

    def check(value: Any) -> Any:
        if not isinstance(value, list):
            _check_word(value, words)
            return value
        for word in value:
            _check_word(word, words)
        if len(value) != 2:
            raise value_error(value, "is not one word, or two: for u and for v")
        return tuple(value)

    word: JsonSchema = {"enum": list(words)}
    pair = {"type": "array", "items": word, "minItems": 2, "maxItems": 2}
    return value_type(check, {"anyOf": [word, pair]})


def existing_file(value: Any, info: ValidationInfo) -> Path:
    """Path of an existing file, given relative to the scene file."""
    if not isinstance(value, str) or not value:
        raise value_error(value, "is not a file name")
    assert isinstance(info.context, Place)
    if len(value) > LONGEST_NAME:
        raise value_error(value, "is too long for a file name")
    path = info.context.folder / value
    try:
        require_file(path)
    except FileError as error:
        raise validation_error(str(error)) from error
    info.context.files.append(path)
    return path


FILE = {"type": "string", "minLength": 1}
File = value_type(existing_file, FILE)


def _existing_files(value: Any, info: ValidationInfo) -> Path | tuple[Path, ...]:
    if isinstance(value, list) and value:
        return tuple(existing_file(item, info) for item in value)
    return existing_file(value, info)


# A file, or several.
Files = value_type(
    _existing_files, {"anyOf": [FILE, {"type": "array", "items": FILE, "minItems": 1}]}
)


def _channel(value: Any) -> int:
    if isinstance(value, str) and len(value) == 1 and value in "rgba":
        return "rgba".index(value)
    if isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= 3:
        return value
    raise value_error(value, "is not a channel; give 'r', 'g', 'b', 'a' or 0 to 3")


Channel = value_type(_channel, {"enum": ["r", "g", "b", "a", 0, 1, 2, 3]})


def _to_tuples(value: Any) -> Any:
    return tuple(map(_to_tuples, value)) if isinstance(value, list) else value


# A value that its options class validates; lists become tuples.
Plain = Annotated[Any, AfterValidator(_to_tuples)]


def _colors(value: Any, info: ValidationInfo) -> tuple[tuple[float, ...], ...]:
    """Colors of a ramp: a list, or the first row of an image."""
    if isinstance(value, str) and not value.startswith("#"):
        return _row_of(existing_file(value, info))
    if not isinstance(value, list) or len(value) < 2:
        raise value_error(value, "is not a list of two or more colors, nor an image of them")
    return tuple(map(color_of, value))


def _row_of(path: Path) -> tuple[tuple[float, ...], ...]:
    from texbake.rendering.maps import colors_from

    try:
        row = colors_from(path)[0].astype(float)
    except TexbakeError as error:
        raise validation_error(str(error)) from error
    if len(row) < 2:
        raise validation_error(f"{path}: it is one pixel wide; a ramp needs two colors or more")
    return tuple(tuple(color) for color in row.tolist())


Colors = value_type(_colors, {"anyOf": [{"type": "array", "items": COLOR, "minItems": 2}, FILE]})
