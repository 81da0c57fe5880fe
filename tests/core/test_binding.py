"""The checks of every call, on a function of the test."""

import ctypes

import numpy as np
import pytest

from texbake.core import core
from texbake.core.binding import OUT_OF_MEMORY, bind
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
