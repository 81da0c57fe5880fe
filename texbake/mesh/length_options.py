"""Lengths that an option gives in model units or as a share of a mesh's diagonal."""

from __future__ import annotations

import math

from texbake.errors import OptionError, quoted


def length_of(name: str, what: str, value: str | float, diagonal: float) -> float:
    """Return the length that an option gives, in the units of the diagonal.

    Parameters
    ----------
    name
        Of the option, for the error.
    what
        What its value is, such as "a width".
    value
        Such as `0.02`, or `1%` of the diagonal.
    diagonal
        Of the bounding box.

    Raises
    ------
    OptionError
        The value is neither, or negative.

    Examples
    --------
    >>> length_of("close", "a width", "2%", 50.0)
    1.0
    """
    word = str(value).strip()
    try:
        number = float(word.removesuffix("%"))
    except ValueError:
        number = math.nan
    if not 0.0 <= number < math.inf:
        raise OptionError(
            f"{name}: {quoted(value)} is not {what}; give a length such as 0.02, or a share of the "
            "diagonal such as 1%"
        )
    return 0.01 * number * diagonal if word.endswith("%") else number
