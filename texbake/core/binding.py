"""Python functions that have their arguments checked against a declaration, then call the core.

The declarations are those of C, which the library contains as text.

An array must have the declared type and shape, be contiguous and aligned, and writable where the
function writes to it.
"""

from __future__ import annotations

import ctypes
import re
import sys
from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np

from texbake.records import dataclass

# Types of C in declarations: dtypes of numpy, and types of arguments. An address is a plain number.
TYPES: dict[str, tuple[str, Any]] = {
    "bool": ("bool", ctypes.c_bool),
    "uint8_t": ("uint8", ctypes.c_uint8),
    "int8_t": ("int8", ctypes.c_int8),
    "uint16_t": ("uint16", ctypes.c_uint16),
    "int16_t": ("int16", ctypes.c_int16),
    "uint32_t": ("uint32", ctypes.c_uint32),
    "int32_t": ("int32", ctypes.c_int32),
    "uint64_t": ("uint64", ctypes.c_uint64),
    "int64_t": ("int64", ctypes.c_int64),
    "uintptr_t": ("uintp", ctypes.c_size_t),
    "float": ("float32", ctypes.c_float),
    "double": ("float64", ctypes.c_double),
}
_SCALARS = dict(TYPES.values())
OUT_OF_MEMORY = -(2**63)

# `array.ctypes.data` takes microseconds, for several arrays of thousands of calls. In CPython, the
# address of the data follows the head of an array, where all compiled extensions read it.
_HEAD, _address_at = object.__basicsize__, ctypes.c_void_p.from_address


def _address_of(array: Any) -> int | None:
    if sys.implementation.name == "cpython":
        return _address_at(id(array) + _HEAD).value
    address: int = array.ctypes.data
    return address


_PROTOTYPE = re.compile(r"^(void|\w+) (\w+)\(([^;{}]*)\);", re.MULTILINE)
_PARAMETER = re.compile(
    r"(?P<optional>OPTIONAL )?(?P<const>const )?(?P<type>\w+) "
    r"(?P<name>\w+)(?P<dimensions>(\[[^\]]*\])*)"
)
_SIZE = re.compile(r"([A-Za-z_]\w*)(?: ([+-]) (\d+))?")


@dataclass(frozen=True)
class Parameter:
    """One parameter of a function of the core."""

    name: str
    dtype: str  # name of the numpy dtype of a scalar or of an array's items
    # Expressions over the sizes, in C and in Python alike; empty for a scalar.
    dimensions: tuple[str, ...]
    written: bool  # whether the function may write to the array
    optional: bool  # whether the array may be left out

    def sizes(self) -> dict[str, tuple[int, int]]:
        """Return each size that the array's shape gives: the dimension, and what to add to it."""
        found = {}
        for axis, dimension in enumerate(self.dimensions):
            match = _SIZE.fullmatch(dimension)
            if match:
                name, sign, offset = match.groups()
                found[name] = (axis, -int(offset) if sign == "+" else int(offset or 0))
        return found


@dataclass(frozen=True)
class Declaration:
    """A function of the core: its name, what it returns, and its parameters in the order of C."""

    name: str
    result: str
    parameters: tuple[Parameter, ...]

    @cached_property
    def given(self) -> list[Parameter]:
        """The parameters that Python passes: all but the sizes that come from shapes."""
        return [parameter for parameter in self.parameters if parameter.name not in self.derived]

    @cached_property
    def derived(self) -> dict[str, list[tuple[Parameter, int, int]]]:
        """Arrays, required ones first, and dimensions of each size that comes from shapes."""
        scalars = {parameter.name for parameter in self.parameters if not parameter.dimensions}
        sources: dict[str, list[tuple[Parameter, int, int]]] = {}
        for array in sorted(self.parameters, key=lambda parameter: parameter.optional):
            for name, (axis, offset) in array.sizes().items():
                if name in scalars:
                    sources.setdefault(name, []).append((array, axis, offset))
        return sources


def split_prototypes(header: str) -> dict[str, re.Match[str]]:
    """Return the prototype of each function by its name, unread."""
    return {match.group(2): match for match in _PROTOTYPE.finditer(header)}


def read_prototype(match: re.Match[str]) -> Declaration:
    """Read one prototype."""
    result, name, parameters = match.groups()
    listed = " ".join(parameters.split())
    texts = [] if listed == "void" else re.split(r", (?![^\[]*\])", listed)
    return Declaration(name, result, tuple(_read_parameter(name, text) for text in texts))


def _read_parameter(function: str, text: str) -> Parameter:
    match = _PARAMETER.fullmatch(text)
    if match is None or match["type"] not in TYPES:
        raise ValueError(f"{function}: cannot read the parameter '{text}'")
    dimensions = tuple(re.findall(r"\[(?:restrict )?([^\]]*)\]", match["dimensions"]))
    return Parameter(
        name=match["name"],
        dtype=TYPES[match["type"]][0],
        dimensions=dimensions,
        written=bool(dimensions) and match["const"] is None,
        optional=match["optional"] is not None,
    )


def bind(declaration: Declaration, function: Any) -> Callable[..., Any]:
    """Return a checked Python function for one of the core, without sizes that shapes tell."""
    result = declaration.result
    function.restype = None if result == "void" else TYPES[result][1]
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
        self._n_dimensions = len(parameter.dimensions)
        self._shape = compile(f"({', '.join(parameter.dimensions)},)", "declaration", "eval")

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
        if array.ndim != self._n_dimensions:
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
        shape = eval(self._shape, {}, values)
        if array.shape != shape:
            sizes = ", ".join(f"{size} = {values[size]}" for size in self._sizes)
            raise ValueError(
                f"{self._place} it has the shape {array.shape}; it must be {self._wanted}"
                + (f" with {sizes}" if sizes else "")
            )
        return _address_of(array)
