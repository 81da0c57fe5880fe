"""Declarations of the core, and the checks of every call by them."""

import ctypes
import re
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from texbake.core import core
from texbake.core.binding import OUT_OF_MEMORY, bind, read_prototype, split_prototypes

CALLBACK = ctypes.CFUNCTYPE(
    ctypes.c_int64, ctypes.c_int64, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p,
    ctypes.c_double,
)  # fmt: skip
PROTOTYPE = """int64_t add(
    int64_t n, const double values[n][2], OPTIONAL const bool mask[n], double sums[n + 1],
    double scale);"""


@pytest.fixture
def seen():
    return []


@pytest.fixture
def add(seen):
    def native(*arguments):
        seen.append(arguments)
        return OUT_OF_MEMORY if arguments[-1] < 0.0 else 7

    kept = CALLBACK(native)
    return bind(read_prototype(split_prototypes(PROTOTYPE)["add"]), kept)


def arrays(n=4):
    return np.zeros((n, 2)), np.ones(n, dtype=bool), np.zeros(n + 1)


def test_the_call_gets_the_sizes_and_the_addresses(add, seen):
    values, mask, sums = arrays()
    assert add(values, mask, sums, 2.5) == 7
    assert seen == [(4, values.ctypes.data, mask.ctypes.data, sums.ctypes.data, 2.5)]


def test_an_array_left_out_is_a_null_pointer(add, seen):
    values, _, sums = arrays()
    add(values, None, sums, 1.0)
    assert seen[0][2] is None


def test_a_view_is_passed_by_its_own_address(add, seen):
    values, mask, sums = arrays(6)
    add(values[2:], mask[2:], sums[2:], 1.0)
    assert seen[0][:2] == (4, values.ctypes.data + 2 * 16)


def test_empty_arrays_are_arrays(add, seen):
    assert add(*arrays(0), 1.0) == 7
    assert seen[0][0] == 0


@pytest.mark.parametrize("scale", ["1", None, [1.0]])
def test_a_wrong_number_is_an_error_before_the_call(add, seen, scale):
    with pytest.raises(ctypes.ArgumentError):
        add(*arrays(), scale)
    assert seen == []


def test_a_function_without_memory_raises(add):
    with pytest.raises(MemoryError, match="add: not enough memory"):
        add(*arrays(), -1.0)


@pytest.mark.parametrize("arguments", [(), (1,), (1, 2, 3, 4, 5)])
def test_a_wrong_number_of_arguments_is_an_error(add, seen, arguments):
    with pytest.raises(TypeError, match=r"4 arguments \(values, mask, sums, scale\), not"):
        add(*arguments)
    assert seen == []


def test_an_array_of_a_derived_class_is_passed(add, seen):
    class Derived(np.ndarray):
        pass

    values, mask, sums = arrays()
    assert add(values.view(Derived), mask, sums, 1.0) == 7


def test_a_size_that_is_a_product_does_not_overflow():
    corners = np.zeros((0, 3, 2), np.int64)
    with pytest.raises(ValueError, match=r"firsts: .*shape \(1,\)"):
        core.bin_faces(corners, 1 << 62, 4, np.zeros(1, np.int64), None)
    core.bin_faces(corners, 1, 1, np.zeros(2, np.int64), None)


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
    assert set(split_prototypes(HEADER)) == {"smooth", "nothing"}
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


SIZE = 5  # of every dimension that the caller states
DECLARATIONS = {name: read_prototype(text) for name, text in core._prototypes.items()}
WITH_ARRAYS = [
    name
    for name, declaration in DECLARATIONS.items()
    if any(parameter.dimensions for parameter in declaration.parameters)
]


class NeverCalled:
    """In the place of a function of the core."""

    def __call__(self, *arguments):
        raise AssertionError("the function was called")


def right_value(parameter, sizes):
    if parameter.dimensions:
        shape = tuple(max(0, eval(size, {}, sizes)) for size in parameter.dimensions)
        return np.zeros(shape, parameter.dtype)
    return {"bool": False, "double": 1.0, "float": 1.0}.get(parameter.dtype, SIZE)


def words(expression):
    return set(re.findall(r"[A-Za-z_]\w*", expression))


def size_is_free(declaration, array, axis):
    """Whether only this axis tells a size, so that any length of it is right."""
    tells = any(
        sources[0][0] is array and sources[0][1] == axis for sources in declaration.derived.values()
    )
    mine = words(array.dimensions[axis])
    others = [
        size
        for parameter in declaration.parameters
        for k, size in enumerate(parameter.dimensions)
        if parameter is not array or k != axis
    ]
    return tells and not any(mine & words(size) for size in others)


def wrong_values(declaration, array, right):
    """Wrong arguments in the place of one array, by what is wrong with them."""
    yield "a list", right.tolist()
    yield "dtype", right.astype(np.float64 if right.dtype == np.float32 else np.float32)
    yield "rank", right[None]
    if right.dtype.itemsize > 1:
        yield "byte order", right.astype(right.dtype.newbyteorder(">"))
        if right.size:
            shifted = np.zeros(right.nbytes + 1, np.uint8)[1:]
            yield "alignment", shifted.view(right.dtype).reshape(right.shape)
    if right.size > 1:
        wide = np.zeros((*right.shape[:-1], 2 * right.shape[-1]), right.dtype)
        yield "strides", wide[..., ::2]
    if not array.optional:
        yield "None", None
    if array.written:
        fixed = right.copy()
        fixed.flags.writeable = False
        yield "read-only", fixed
    for axis in range(right.ndim):
        if not size_is_free(declaration, array, axis):
            longer = list(right.shape)
            longer[axis] += 1
            yield f"length of axis {axis}", np.zeros(longer, right.dtype)


@pytest.mark.parametrize("name", WITH_ARRAYS)
def test_wrong_arrays_are_refused(name):
    declaration = DECLARATIONS[name]
    function = bind(declaration, NeverCalled())
    sizes = {each.name: SIZE for each in declaration.parameters if not each.dimensions}
    for array in declaration.parameters:
        if not array.dimensions:
            continue
        for what, wrong in wrong_values(declaration, array, right_value(array, sizes)):
            arguments = [
                wrong if each is array else right_value(each, sizes) for each in declaration.given
            ]
            with pytest.raises((TypeError, ValueError), match=f"^{name}: "):
                function(*arguments)
                pytest.fail(f"{array.name}: {what}")


def test_kernels_run_without_the_gil():
    """Another thread runs while a kernel works for about half a second."""
    side = 1400
    charts = np.full((side, side), -1, np.int32)
    nearest, other = np.zeros((2, side, side), np.int16)
    indices, meeting = np.zeros((side, side), np.int32), np.zeros(side, np.int64)
    core.search_columns(charts, side, nearest, other, indices, 0, side)
    begun = threading.Event()

    def work():
        begun.set()
        core.search_rows(charts, side, nearest, other, indices, meeting, 0, side)

    thread = threading.Thread(target=work)
    thread.start()
    begun.wait()
    n = 0
    while thread.is_alive():
        time.sleep(0.001)
        n += 1
    thread.join()
    assert n > 20  # with the GIL, it would be a few
