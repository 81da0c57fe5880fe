"""Python functions that check their arguments against a declaration, then call the core.

The check of each function is written out as Python source when the function is first called: a
general loop over a description would take several times as long as many of the kernels.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable, Iterator
from typing import Any, NoReturn

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
    "int32_t": ctypes.c_int32,
    "int64_t": ctypes.c_int64,
    "double": ctypes.c_double,
}


def bind(declaration: Declaration, function: Any) -> Callable[..., Any]:
    """Return a Python function with the checks of a declaration around a function of ctypes.

    It takes the declared parameters in their order, without the sizes that shapes tell, by position
    or by name, and returns what the function returns.

    Raises
    ------
    TypeError
        From a call: an argument is no array, or an array of another dtype.
    ValueError
        From a call: an array has another shape, is not contiguous or aligned, or is read-only and
        would be written to.
    MemoryError
        From a call: the function found no memory.
    """
    function.restype = _RESULTS[declaration.result]
    function.argtypes = [
        ctypes.c_void_p if parameter.dimensions else _SCALARS[parameter.dtype]
        for parameter in declaration.parameters
    ]
    names: dict[str, Any] = {
        "_function": function,
        "_array": np.ndarray,
        "_address": _address_of_data,
        "_explain": lambda name, values: _explain(declaration, name, values),
        "_OUT_OF_MEMORY": OUT_OF_MEMORY,
    }
    names |= {f"_{dtype}": np.dtype(dtype) for dtype in _SCALARS}
    exec("\n".join(_source(declaration)), names)
    bound: Callable[..., Any] = names[declaration.name]
    return bound


def _source(declaration: Declaration) -> Iterator[str]:
    """Lines of a Python function that checks its arguments and makes the call."""
    derived = declaration.derived
    parameters = declaration.parameters
    arrays = [parameter for parameter in parameters if parameter.dimensions]
    given = [parameter.name for parameter in parameters if parameter.name not in derived]
    yield f"def {declaration.name}({', '.join(given)}):"
    for array in arrays:
        yield from _type_check(array)
    for size, ((array, axis, offset), *_) in derived.items():
        missing = f"0 if {array.name} is None else " if array.optional else ""
        yield f"    {size} = {missing}{array.name}.shape[{axis}] + {offset}"
    for array in arrays:
        missing = f"{array.name} is not None and " if array.optional else ""
        yield f"    if {missing}{array.name}.shape != ({', '.join(array.dimensions)},):"
        yield f"        _explain('{array.name}', locals())"
    call = f"_function({', '.join(_argument(parameter) for parameter in parameters)})"
    if declaration.result == "int64_t":
        yield f"    result = {call}"
        yield "    if result == _OUT_OF_MEMORY:"
        yield f"        raise MemoryError('{declaration.name}: not enough memory')"
        yield "    return result"
    else:
        yield f"    return {call}"


def _type_check(array: Parameter) -> Iterator[str]:
    name = array.name
    flags = "flags.carray" if array.written else f"flags.c_contiguous and {name}.flags.aligned"
    wrong = (
        f"not isinstance({name}, _array) or {name}.dtype != _{array.dtype}"
        f" or {name}.ndim != {len(array.dimensions)} or not ({name}.{flags})"
    )
    yield f"    if {f'{name} is not None and ({wrong})' if array.optional else wrong}:"
    yield f"        _explain('{name}', locals())"


def _argument(parameter: Parameter) -> str:
    if not parameter.dimensions:
        return parameter.name
    if parameter.optional:
        return f"None if {parameter.name} is None else _address({parameter.name})"
    return f"_address({parameter.name})"


def _explain(declaration: Declaration, name: str, values: dict[str, Any]) -> NoReturn:
    """Raise the error that says what is wrong with an argument."""
    array = values[name]
    parameter = next(each for each in declaration.parameters if each.name == name)
    wanted = f"{parameter.dtype} ({', '.join(parameter.dimensions)})"
    place = f"{declaration.name}: {name}:"
    if not isinstance(array, np.ndarray):
        raise TypeError(f"{place} it is a {type(array).__name__}; it must be an array, {wanted}")
    if array.dtype != parameter.dtype:
        raise TypeError(f"{place} it has the dtype {array.dtype}; it must be {wanted}")
    sizes = {size: values[size] for size in declaration.derived if size in values}
    if array.ndim != len(parameter.dimensions) or sizes:
        where = ", ".join(f"{size} = {value}" for size, value in sizes.items())
        raise ValueError(
            f"{place} it has the shape {array.shape}; it must be {wanted}"
            + (f" with {where}" if where else "")
        )
    if not array.flags.c_contiguous or not array.flags.aligned:
        raise ValueError(f"{place} it is not contiguous and aligned")
    raise ValueError(f"{place} it is read-only, and the function writes to it")


# `array.ctypes.data` costs more than all checks together. In CPython, the address of the data is
# the first field of an array after the head that all objects have (NumPy's C API, ndarraytypes.h).
_HEAD = object.__basicsize__
_read_address = ctypes.c_size_t.from_address


def _field_address(array: np.ndarray[Any, Any]) -> int:
    return _read_address(id(array) + _HEAD).value


def _public_address(array: np.ndarray[Any, Any]) -> int:
    return array.ctypes.data


def _choose_address() -> Callable[[np.ndarray[Any, Any]], int]:
    probe = np.zeros(3)[1:]
    if sys.implementation.name == "cpython" and _field_address(probe) == probe.ctypes.data:
        return _field_address
    return _public_address


_address_of_data = _choose_address()
