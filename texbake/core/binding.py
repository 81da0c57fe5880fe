"""Python functions that have their arguments checked against a declaration, then call the core.

The checks themselves run in C: for each function of the core that takes arrays, the library has a
second one, written by `checks.py`, which takes Python's objects, checks them and calls the first.
What it refuses is looked at again here, to say what is wrong with it, or to pass it after all: an
array of a class derived from NumPy's, for instance.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable
from typing import Any

import numpy as np

from texbake.core.declarations import DTYPES, Declaration, Parameter

OUT_OF_MEMORY = -(2**63)
REFUSED = OUT_OF_MEMORY + 1

_SCALARS = {
    "bool": ctypes.c_bool,
    "uint8": ctypes.c_uint8,
    "int8": ctypes.c_int8,
    "uint16": ctypes.c_uint16,
    "int16": ctypes.c_int16,
    "uint32": ctypes.c_uint32,
    "int32": ctypes.c_int32,
    "uint64": ctypes.c_uint64,
    "int64": ctypes.c_int64,
    "uintp": ctypes.c_size_t,
    "float32": ctypes.c_float,
    "float64": ctypes.c_double,
}
_RESULTS: dict[str, Any] = {
    "void": None,
    "bool": ctypes.c_bool,
    "int64_t": ctypes.c_int64,
    "double": ctypes.c_double,
}


class _ArrayLayout(ctypes.Structure):
    """As `struct layout` in `array_checks.h`."""

    _fields_ = (
        ("head", ctypes.c_int64),
        ("array_type", ctypes.c_void_p),
        ("none", ctypes.c_void_p),
        ("type_numbers", ctypes.c_int32 * len(DTYPES)),
    )


def tell_array_layout(library: ctypes.CDLL) -> bool:
    """Tell a library how arrays lie in memory; return whether its checks can rely on it."""
    if sys.implementation.name != "cpython":  # elsewhere, an object is not what lies at its id
        return False
    numbers = [np.dtype(dtype).num for dtype in DTYPES.values()]
    layout = _ArrayLayout(
        object.__basicsize__, id(np.ndarray), id(None), (ctypes.c_int32 * len(DTYPES))(*numbers)
    )
    probe = np.zeros(3)[1:]
    library.set_array_layout.restype = ctypes.c_bool
    library.set_array_layout.argtypes = [ctypes.c_void_p, ctypes.py_object, ctypes.c_void_p]
    return bool(library.set_array_layout(ctypes.byref(layout), probe, probe.ctypes.data))


def bind(declaration: Declaration, plain: Any, checked: Any = None) -> Callable[..., Any]:
    """Return a Python function that calls a function of the core once its arguments are checked.

    It takes the declared parameters in their order, without the sizes that shapes tell, and returns
    what the function of the core returns.
    """
    plain.restype = _RESULTS[declaration.result]
    plain.argtypes = [
        ctypes.c_void_p if parameter.dimensions else _SCALARS[parameter.dtype]
        for parameter in declaration.parameters
    ]

    def call_slowly(*arguments: Any) -> Any:
        result = plain(*_checked_arguments(declaration, arguments))
        if result == OUT_OF_MEMORY:
            raise MemoryError(f"{declaration.name}: not enough memory")
        return result

    if checked is None:
        return call_slowly
    checked.restype = ctypes.c_int64
    checked.argtypes = [
        ctypes.py_object if parameter.dimensions else _SCALARS[parameter.dtype]
        for parameter in declaration.given
    ]
    n_given, is_void = len(declaration.given), declaration.result == "void"

    def call(*arguments: Any) -> Any:
        result = checked(*arguments) if len(arguments) == n_given else REFUSED
        if result > REFUSED:
            return None if is_void else result
        if result == REFUSED:
            return call_slowly(*arguments)
        raise MemoryError(f"{declaration.name}: not enough memory")

    return call


def _checked_arguments(declaration: Declaration, arguments: tuple[Any, ...]) -> list[Any]:
    """Check the arguments of a call; return those of the function itself, or raise."""
    given = [parameter.name for parameter in declaration.given]
    if len(arguments) != len(given):
        raise TypeError(
            f"{declaration.name}: it takes {len(given)} arguments ({', '.join(given)}), "
            f"not {len(arguments)}"
        )
    values = dict(zip(given, arguments, strict=True))
    arrays = [
        parameter
        for parameter in declaration.parameters
        if parameter.dimensions and not (parameter.optional and values[parameter.name] is None)
    ]
    for array in arrays:
        _check_kind(declaration, array, values[array.name])
    for size, ((array, axis, offset), *_) in declaration.derived.items():
        values[size] = values[array.name].shape[axis] + offset if array in arrays else 0
    for array in arrays:
        _check_shape(declaration, array, values)
    return [
        values[each.name].ctypes.data if each in arrays else values[each.name]
        for each in declaration.parameters
    ]


def _check_kind(declaration: Declaration, parameter: Parameter, array: Any) -> None:
    """Raise unless an argument is an array of the declared type and rank, usable as it is."""
    wanted = f"{parameter.dtype} ({', '.join(parameter.dimensions)})"
    place = f"{declaration.name}: {parameter.name}:"
    if not isinstance(array, np.ndarray):
        raise TypeError(f"{place} it is a {type(array).__name__}; it must be an array, {wanted}")
    if array.dtype != parameter.dtype:
        raise TypeError(f"{place} it has the dtype {array.dtype}; it must be {wanted}")
    if array.ndim != len(parameter.dimensions):
        raise ValueError(f"{place} it has the shape {array.shape}; it must be {wanted}")
    if not array.flags.c_contiguous or not array.flags.aligned:
        raise ValueError(f"{place} it is not contiguous and aligned")
    if parameter.written and not array.flags.writeable:
        raise ValueError(f"{place} it is read-only, and the function writes to it")


def _check_shape(declaration: Declaration, parameter: Parameter, values: dict[str, Any]) -> None:
    """Raise if an array's shape does not go with the sizes."""
    shape = values[parameter.name].shape
    if shape != tuple(eval(each, {}, values) for each in parameter.dimensions):
        sizes = ", ".join(f"{size} = {values[size]}" for size in declaration.derived)
        raise ValueError(
            f"{declaration.name}: {parameter.name}: it has the shape {shape}; it must be "
            f"{parameter.dtype} ({', '.join(parameter.dimensions)})"
            + (f" with {sizes}" if sizes else "")
        )
