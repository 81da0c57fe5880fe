"""C source of the functions that check their arrays, then call the core.

`compile_core.py` has one written for each function of `core.h` that takes arrays, and compiles them
into the library; `binding.py` calls them. They take arrays as Python's objects and read their
memory (`array_checks.h`): all checks of a call then take less time than Python needs to look up one
attribute of an array.

Nothing is imported, since this runs before anything is installed.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from texbake.core.declarations import Declaration, Parameter

_HEAD = """\
/* Written by texbake/core/checks.py. */

#include "array_checks.h"
#include "core.h"

#pragma GCC visibility push(default)

int64_t header_checksum(void)
{
    return CHECKSUM;
}

bool set_array_layout(const struct layout *given, const void *probe, const void *data)
{
    layout = *given;
    return IS_ARRAY(probe, FLOAT64, 1, true) && LENGTH(probe, 0) == 2 && DATA(probe) == data;
}
"""


def checksum(header: str) -> int:
    """Return a number that distinguishes one text of `core.h` from another."""
    return zlib.crc32(header.encode())


def checked_source(declarations: Iterable[Declaration], header: str) -> str:
    """Return the source of the checked functions, and of the one that identifies their `core.h`."""
    head = _HEAD.replace("CHECKSUM", str(checksum(header)))
    functions = (
        "\n".join(_function(declaration)) for declaration in declarations if declaration.has_check
    )
    return "\n".join([head, *functions])


def _function(declaration: Declaration) -> Iterator[str]:
    """Lines of one function: `checked_<name>`, which returns REFUSED or what the kernel returns."""
    name = declaration.name
    arrays = [parameter for parameter in declaration.parameters if parameter.dimensions]
    given = ", ".join(
        f"const void *{parameter.name}" if parameter.dimensions else _scalar(parameter)
        for parameter in declaration.given
    )
    yield ""
    yield f"int64_t checked_{name}({given})"
    yield "{"
    for array in arrays:
        kind = f"{array.dtype.upper()}, {len(array.dimensions)}, {str(array.written).lower()}"
        yield f"    if ({_given(array)}!IS_ARRAY({array.name}, {kind}))"
        yield "        return REFUSED;"
    for size, ((array, axis, offset), *_) in declaration.derived.items():
        missing = f"IS_NONE({array.name}) ? 0 : " if array.optional else ""
        yield f"    const int64_t {size} = {missing}{_length(array, axis)} + {offset};"
    for array in arrays:
        for axis, dimension in enumerate(array.dimensions):
            exact = re.sub(r"[A-Za-z_]\w*", r"WIDE \g<0>", dimension)
            yield f"    if ({_given(array)}{_length(array, axis)} != {exact})"
            yield "        return REFUSED;"
    call = f"{name}({', '.join(_argument(parameter) for parameter in declaration.parameters)});"
    if declaration.result == "void":
        yield f"    {call}"
        yield "    return 0;"
    else:
        yield f"    return {call}"
    yield "}"


def _scalar(parameter: Parameter) -> str:
    """Declaration of a number: the C type, found by its numpy name."""
    types = {"bool": "bool", "float32": "float", "float64": "double", "uintp": "uintptr_t"}
    return f"{types.get(parameter.dtype, f'{parameter.dtype}_t')} {parameter.name}"


def _given(array: Parameter) -> str:
    return f"!IS_NONE({array.name}) && " if array.optional else ""


def _length(array: Parameter, axis: int) -> str:
    return f"LENGTH({array.name}, {axis})"


def _argument(parameter: Parameter) -> str:
    if not parameter.dimensions:
        return parameter.name
    missing = f"IS_NONE({parameter.name}) ? NULL : " if parameter.optional else ""
    return f"{missing}DATA({parameter.name})"
