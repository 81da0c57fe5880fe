"""Python functions that have their arguments checked against a declaration, then call the core.

An array must have the declared type and shape, be contiguous and aligned, and writable where the
function writes to it.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any

import numpy as np

from texbake.core.declarations import Declaration, Parameter

OUT_OF_MEMORY = -(2**63)

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


def bind(declaration: Declaration, function: Any) -> Callable[..., Any]:
    """Return a Python function that calls a function of the core once its arguments are checked.

    It takes the declared parameters in their order, without the sizes that shapes tell, and returns
    what the function of the core returns.
    """
    function.restype = _RESULTS[declaration.result]
    function.argtypes = [
        ctypes.c_void_p if parameter.dimensions else _SCALARS[parameter.dtype]
        for parameter in declaration.parameters
    ]
    order = [parameter.name for parameter in declaration.parameters]
    names = [parameter.name for parameter in declaration.given]
    arrays = {
        array.name: _Array(declaration, array)
        for array in declaration.parameters
        if array.dimensions
    }
    sizes = [(size, *sources[0]) for size, sources in declaration.derived.items()]

    def call(*arguments: Any) -> Any:
        if len(arguments) != len(names):
            raise TypeError(
                f"{declaration.name}: it takes {len(names)} arguments ({', '.join(names)}), "
                f"not {len(arguments)}"
            )
        values = dict(zip(names, arguments, strict=True))
        for name, array in arrays.items():
            array.check_kind(values[name])
        for size, source, axis, offset in sizes:
            told_by = values[source.name]
            values[size] = 0 if told_by is None else told_by.shape[axis] + offset
        passed = [
            arrays[each].address(values) if each in arrays else values[each] for each in order
        ]
        result = function(*passed)
        if result == OUT_OF_MEMORY:
            raise MemoryError(f"{declaration.name}: not enough memory")
        return result

    return call


class _Array:
    """An array among the parameters of a function, and the checks of what is passed for it."""

    def __init__(self, declaration: Declaration, parameter: Parameter) -> None:
        self._parameter, self._place = parameter, f"{declaration.name}: {parameter.name}:"
        self._wanted = f"{parameter.dtype} ({', '.join(parameter.dimensions)})"
        self._dtype = np.dtype(parameter.dtype)
        self._sizes = list(declaration.derived)
        self._dimensions = [_compiled(each) for each in parameter.dimensions]

    def check_kind(self, array: Any) -> None:
        """Raise unless an argument is an array of the declared type and rank, usable as it is."""
        parameter, place = self._parameter, self._place
        if array is None and parameter.optional:
            return
        if not isinstance(array, np.ndarray):
            kind = type(array).__name__
            raise TypeError(f"{place} it is a {kind}; it must be an array, {self._wanted}")
        if array.dtype != self._dtype:
            raise TypeError(f"{place} it has the dtype {array.dtype}; it must be {self._wanted}")
        if array.ndim != len(self._dimensions):
            raise ValueError(f"{place} it has the shape {array.shape}; it must be {self._wanted}")
        flags = array.flags
        if not flags.c_contiguous or not flags.aligned:
            raise ValueError(f"{place} it is not contiguous and aligned")
        if parameter.written and not flags.writeable:
            raise ValueError(f"{place} it is read-only, and the function writes to it")

    def address(self, values: dict[str, Any]) -> int | None:
        """Return the address of an array; raise if its shape does not match the sizes."""
        array = values[self._parameter.name]
        if array is None:
            return None
        shape = tuple(
            [
                values[each]
                if type(each) is str
                else each
                if type(each) is int
                else eval(each, {}, values)
                for each in self._dimensions
            ]
        )
        if array.shape != shape:
            sizes = ", ".join(f"{size} = {values[size]}" for size in self._sizes)
            raise ValueError(
                f"{self._place} it has the shape {array.shape}; it must be {self._wanted}"
                + (f" with {sizes}" if sizes else "")
            )
        address: int = array.ctypes.data
        return address


def _compiled(dimension: str) -> Any:
    """Return a dimension as a number, the name of a size, or an expression of sizes."""
    if dimension.isdigit():
        return int(dimension)
    return dimension if dimension.isidentifier() else compile(dimension, "declaration", "eval")
