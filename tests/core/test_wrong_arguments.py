"""Every function of the core refuses arrays of the wrong kind or size, and does not run."""

import re

import numpy as np
import pytest

from texbake.core import core
from texbake.core.binding import bind
from texbake.core.declarations import read_prototype

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
    """An argument that is as declared."""
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
            with pytest.raises((TypeError, ValueError)):
                function(*arguments)
                pytest.fail(f"{array.name}: {what}")
