"""The checks of every call: in Python on a function of the test, and in C on the core's own."""

import ctypes

import numpy as np
import pytest

from texbake.core import core
from texbake.core.binding import OUT_OF_MEMORY, REFUSED, bind, tell_array_layout
from texbake.core.declarations import read_prototype, split_prototypes

CALLBACK = ctypes.CFUNCTYPE(
    ctypes.c_int64,
    ctypes.c_int64,
    ctypes.c_void_p,
    ctypes.c_void_p,
    ctypes.c_void_p,
    ctypes.c_double,
)
PROTOTYPE = """int64_t add(
    int64_t n, const double values[n][2], OPTIONAL const bool mask[n], double sums[n + 1],
    double scale);"""


@pytest.fixture
def seen():
    """What the compiled function was called with."""
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


def wrong_arguments():
    values, mask, sums = arrays()
    read_only = sums.copy()
    read_only.flags.writeable = False
    unaligned = np.zeros(8 * 5 + 1, dtype=np.uint8)[1:].view(np.float64)
    return {
        "a list": ((values.tolist(), mask, sums), TypeError, "values: it is a list"),
        "another dtype": ((values.astype("f4"), mask, sums), TypeError, "dtype float32"),
        "another byte order": ((values.astype(">f8"), mask, sums), TypeError, "dtype >f8"),
        "too few": ((values, mask[1:], sums), ValueError, r"mask: .*shape \(3,\)"),
        "too many": ((values, mask, np.zeros(9)), ValueError, r"sums: .*\(n \+ 1\) with n = 4"),
        "a fixed size": ((np.zeros((4, 3)), mask, sums), ValueError, r"values: .*\(4, 3\)"),
        "another rank": ((values.ravel(), mask, sums), ValueError, r"values: .*shape \(8,\)"),
        "not contiguous": ((values, np.ones(8, bool)[::2], sums), ValueError, "not contiguous"),
        "columns first": ((np.asfortranarray(values), mask, sums), ValueError, "not contiguous"),
        "not aligned": ((values, mask, unaligned), ValueError, "not contiguous and aligned"),
        "read-only": ((values, mask, read_only), ValueError, "sums: it is read-only"),
        "missing": ((None, mask, sums), TypeError, "values: it is a NoneType"),
    }


@pytest.mark.parametrize("name", wrong_arguments())
def test_a_wrong_array_is_an_error_before_the_call(add, seen, name):
    given, error, message = wrong_arguments()[name]
    with pytest.raises(error, match=f"add: .*{message}|add: {message}"):
        add(*given, 1.0)
    assert seen == []


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


# In C. `bin_faces` has a size that is a product, `add_fragments` arrays that may be left out.


def fragments(n=4):
    return {
        "pixels": np.zeros(n, np.int32),
        "counts": np.ones(n, np.float32),
        "light": np.ones((n, 3), np.float32),
        "normals": None,
        "color": np.zeros((2, 4), np.float32),
        "coverage": np.zeros(2, np.float32),
        "normal_sums": None,
    }


def bound_in_c(name, seen):
    """A function of the core that is checked in C, and calls `seen.append` if Python must look."""
    result = CALLBACK(lambda *arguments: seen.append(arguments))
    return bind(
        read_prototype(core._prototypes[name]), result, getattr(core.library, f"checked_{name}")
    )


def test_right_arguments_need_no_second_look(seen):
    assert core._has_checks
    add_fragments = bound_in_c("add_fragments", seen)
    given = fragments()
    assert add_fragments(*given.values()) is None
    assert given["coverage"].tolist() == [4.0, 0.0]
    given |= {"normals": given["light"], "normal_sums": np.zeros((2, 3), np.float32)}
    add_fragments(*given.values())
    assert given["normal_sums"].tolist() == [[4.0] * 3, [0.0] * 3]
    assert seen == []


def wrong_fragments():
    n = 4
    read_only = np.zeros(2, np.float32)
    read_only.flags.writeable = False
    unaligned = np.zeros(4 * 2 + 1, dtype=np.uint8)[1:].view(np.float32)
    return {
        "a list": ("counts", [1.0] * n, TypeError),
        "a number": ("counts", 1.0, TypeError),
        "missing": ("counts", None, TypeError),
        "another dtype": ("counts", np.ones(n), TypeError),
        "another number of the same size": ("pixels", np.zeros(n, np.uint32), TypeError),
        "another byte order": ("counts", np.ones(n, ">f4"), TypeError),
        "another rank": ("light", np.ones(n, np.float32), ValueError),
        "too few": ("counts", np.ones(n - 1, np.float32), ValueError),
        "too many": ("light", np.ones((n + 1, 3), np.float32), ValueError),
        "a fixed size": ("light", np.ones((n, 4), np.float32), ValueError),
        "not contiguous": ("counts", np.ones(2 * n, np.float32)[::2], ValueError),
        "columns first": ("light", np.ones((3, n), np.float32).T, ValueError),
        "not aligned": ("coverage", unaligned, ValueError),
        "read-only": ("coverage", read_only, ValueError),
        "optional, another dtype": ("normals", np.ones((n, 3)), TypeError),
        "optional, too few": ("normals", np.ones((n - 1, 3), np.float32), ValueError),
    }


@pytest.mark.parametrize("case", wrong_fragments())
def test_what_is_wrong_is_refused_in_c(seen, case):
    name, value, error = wrong_fragments()[case]
    given = list((fragments() | {name: value}).values())
    bound_in_c("add_fragments", seen)
    assert core.library.checked_add_fragments(*given) == REFUSED
    with pytest.raises(error, match=f"add_fragments: {name}: it "):
        core.add_fragments(*given)


def test_a_size_that_is_a_product_is_refused_in_c_where_it_overflows():
    corners = np.zeros((0, 3, 2), np.int64)
    with pytest.raises(ValueError, match=r"firsts: .*shape \(1,\)"):
        core.bin_faces(corners, 1 << 62, 4, np.zeros(1, np.int64), None)
    core.bin_faces(corners, 1, 1, np.zeros(2, np.int64), None)


def test_an_array_of_a_derived_class_is_passed_after_all():
    class Derived(np.ndarray):
        pass

    given = fragments()
    core.add_fragments(*(given | {"counts": given["counts"].view(Derived)}).values())
    assert given["coverage"].tolist() == [4.0, 0.0]


def test_another_python_checks_in_python(monkeypatch):
    monkeypatch.setattr("sys.implementation.name", "another")
    assert not tell_array_layout(core.library)
