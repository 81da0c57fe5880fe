"""Options as they are declared: their checks, and the JSON Schemas made of them."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
import pytest

from texbake import OptionError
from texbake.schema import CheckedOptions, Option, option_field, option_fields


@dataclass(frozen=True, kw_only=True)
class Choices(CheckedOptions):
    count: Annotated[int, Option("A count.", low=1, high=8, unit="texels")] = 4
    angle: Annotated[float | None, Option("An angle.", above=0, below=180)] = None
    word: Annotated[str, Option("A word.", choices=("a", "b"))] = "a"
    samples: Annotated[int | str, Option("Samples.", choices=(1, 4, "many"))] = 1
    words: Annotated[tuple[str, ...], Option("Words.", choices=("a", "b"))] = ("a",)
    axis: Annotated[str | tuple[float, float, float], Option("An axis.", choices=("x",))] = "x"
    size: Annotated[int | tuple[int, int], Option("A size.", low=1)] = 8
    view: Annotated[tuple[float, float] | tuple[float, float, float | None], Option("A view.")] = (
        0.0,
        0.0,
    )


@pytest.mark.parametrize("values", [
    {},
    {"count": 8, "angle": 0.5, "word": "b", "samples": "many", "words": ("a", "b")},
    {"axis": (0, 1.0, 0), "size": (2, 1), "view": (1, 2, None), "samples": 4},
    {"angle": 90},
])  # fmt: skip
def test_values_that_can_be(values):
    options = Choices(**values)
    assert {name: getattr(options, name) for name in values} == values


@pytest.mark.parametrize(("values", "message"), [
    ({"count": 9}, "count: 9 is out of range; it must be 1 to 8 texels"),
    ({"count": 1.0}, "count: 1.0 is not a whole number"),
    ({"count": True}, "count: True is not a whole number"),
    ({"count": None}, "count: None is not a whole number"),
    ({"angle": 0}, "angle: 0 is out of range; it must be above 0 and below 180"),
    ({"angle": float("nan")}, "angle: nan is not a finite number"),
    ({"word": "c"}, "word: c is not one of a, b"),
    ({"samples": 2}, "samples: 2 is not one of 1, 4, many"),
    ({"samples": 4.0}, "samples: 4.0 is not one of 1, 4, many"),  # though it equals 4
    ({"samples": True}, "samples: True is not one of 1, 4, many"),
    ({"words": ("a", "c")}, "words: c is not one of a, b"),
    ({"axis": "y"}, "axis: y is neither one of x nor 3 finite numbers"),
    ({"axis": (1, 2)}, "axis: (1, 2) is neither one of x nor 3 finite numbers"),
    ({"size": (4, 4, 4)}, "size: (4, 4, 4) is neither a whole number nor 2 whole numbers"),
    ({"size": (4, 0)}, "size: 0 is out of range; it must be 1 or more"),
    ({"view": (1,)}, "view: (1,) is neither 2 finite numbers nor 3 finite numbers"),
])  # fmt: skip
def test_values_that_cannot_be(values, message):
    with pytest.raises(OptionError) as caught:
        Choices(**values)
    assert str(caught.value) == message
    assert caught.value.parameters == tuple(values)


def test_numbers_of_numpy_become_those_of_python():
    options = Choices(
        count=np.int64(8), size=(np.int32(2), np.uint8(1)), axis=(np.float32(0.5), 1, np.int8(0)),
        angle=np.float64(0.1),
    )  # fmt: skip
    assert options == Choices(count=8, size=(2, 1), axis=(0.5, 1, 0), angle=0.1)
    assert type(options.count) is int
    assert type(options.size) is tuple and {*map(type, options.size)} == {int}
    assert [*map(type, options.axis)] == [float, int, int]


def test_a_field_becomes_json_schema():
    assert option_field(Choices, "count").json_schema() == {
        "type": "integer", "minimum": 1, "maximum": 8, "description": "A count, in texels.",
        "default": 4,
    }  # fmt: skip
    three = {"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3}
    assert option_field(Choices, "axis").json_schema()["anyOf"] == [{"enum": ["x"]}, three]


def test_a_class_without_options_is_described_by_its_docstring():
    @dataclass
    class Plain:
        """Values.

        Attributes
        ----------
        width, height : int
            In pixels.
        """

        width: int = 1
        height: int = 2

    assert [field.option.help for field in option_fields(Plain)] == ["In pixels."] * 2
