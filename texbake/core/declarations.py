"""Declarations of the core's functions, read into what `binding` needs to check a call."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property

# Types of C in declarations, and the dtypes of numpy that they are. An address is a plain number.
DTYPES = {
    "bool": "bool",
    "uint8_t": "uint8",
    "int8_t": "int8",
    "uint16_t": "uint16",
    "int16_t": "int16",
    "uint32_t": "uint32",
    "int32_t": "int32",
    "uint64_t": "uint64",
    "int64_t": "int64",
    "uintptr_t": "uintp",
    "float": "float32",
    "double": "float64",
}

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
        """The sizes that come from shapes: for each, its arrays, dimensions and offsets.

        Arrays that cannot be left out come first.
        """
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
    if match is None or match["type"] not in DTYPES:
        raise ValueError(f"{function}: cannot read the parameter '{text}'")
    dimensions = tuple(re.findall(r"\[(?:restrict )?([^\]]*)\]", match["dimensions"]))
    return Parameter(
        name=match["name"],
        dtype=DTYPES[match["type"]],
        dimensions=dimensions,
        written=bool(dimensions) and match["const"] is None,
        optional=match["optional"] is not None,
    )
