"""The declarations of the core, as Python reads them."""

import re
from pathlib import Path

import pytest

from texbake.core import core
from texbake.core.declarations import read_prototype, split_prototypes

SOURCES = Path(__file__).parents[2] / "texbake" / "core"

HEADER = """
int64_t smooth(
    int64_t n, int64_t width,
    const float image[n][width][3], OPTIONAL const bool mask[n * width],
    double result[restrict n + 1], double weight);
void nothing(void);
"""


def declaration(name, header=HEADER):
    return read_prototype(split_prototypes(header)[name])


def test_declarations_are_found_by_name():
    assert set(split_prototypes(HEADER)) == {"smooth", "nothing"}


def test_a_prototype_is_read_whole():
    smooth = declaration("smooth")
    rows = [
        (each.name, each.dtype, each.dimensions, each.written, each.optional)
        for each in smooth.parameters
    ]
    assert smooth.result == "int64_t"
    assert rows == [
        ("n", "int64", (), False, False),
        ("width", "int64", (), False, False),
        ("image", "float32", ("n", "width", "3"), False, False),
        ("mask", "bool", ("n * width",), False, True),
        ("result", "float64", ("n + 1",), True, False),
        ("weight", "float64", (), False, False),
    ]


def test_sizes_come_from_the_shapes_that_tell_them():
    told = {
        size: [(array.name, axis, offset) for array, axis, offset in sources]
        for size, sources in declaration("smooth").derived.items()
    }
    assert told == {"n": [("image", 0, 0), ("result", 0, -1)], "width": [("image", 1, 0)]}


def test_a_size_that_no_dimension_is_alone_stays_an_argument():
    header = "void fill(int64_t rows, int64_t columns, float image[rows * columns]);"
    assert declaration("fill", header).derived == {}


def test_a_function_without_parameters():
    assert declaration("nothing").parameters == ()


@pytest.mark.parametrize("parameter", ["float *image", "struct arena arena", "unsigned n"])
def test_what_the_table_cannot_say_is_an_error(parameter):
    with pytest.raises(ValueError, match="cannot read the parameter"):
        declaration("wrong", f"void wrong({parameter});")


def test_every_file_of_the_core_names_who_calls_it():
    modules = [path.as_posix() for path in SOURCES.parent.rglob("*.*")]
    wrong = []
    for path in SOURCES.glob("*.c"):
        callers = re.search(r"Called from (.*?)\*/", path.read_text("utf-8"), re.S)
        names = re.findall(r"[\w/]+\.(?:py|[ch])\b", callers[1]) if callers else []
        known = [name for name in names if any(file.endswith(f"/{name}") for file in modules)]
        if path.name != "arena.c" and (callers is None or known != names):
            wrong.append((path.name, names))
    assert wrong == []


def test_the_library_knows_every_function_that_is_marked():
    marks = [
        re.findall("^EXPORT .*?(\\w+)\\(", path.read_text("utf-8"), re.M)
        for path in SOURCES.glob("*.c")
    ]
    assert set(core._prototypes) == {name for names in marks for name in names}
