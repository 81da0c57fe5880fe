"""How far a picture may be off, as a user asks for it: in steps of the sRGB-coded picture.

Colors are coded as a file holds them, from 0 to 1, and what lies outside is clipped, so that light
brighter than white is no error. The error of a pixel is that of its worst channel. Without a
background the color counts as over black, and the opacity is a channel of its own.
"""

from __future__ import annotations

from texbake.errors import OptionError

CODES = 255  # steps from black to white that errors are told in


def parse_max_error(value: str | float) -> float:
    """Error, from black to white 1, of a fraction such as `2/255` or a number such as `0.01`.

    Raises
    ------
    OptionError
        It is not above 0 and below 1.

    Examples
    --------
    >>> parse_max_error("51/255"), parse_max_error(0.01)
    (0.2, 0.01)
    """
    above, slash, below = str(value).partition("/")
    try:
        error = float(above) / (float(below) if slash else 1.0)
    except (ValueError, ZeroDivisionError):
        error = 0.0
    if not 0.0 < error < 1.0:
        raise OptionError(
            f"max-error: {value!r} is no error of a picture; give a share of white such as 2/255 "
            "or 0.01"
        )
    return error


def in_codes(error: float) -> str:
    """Say an error as a fraction of 255 steps.

    >>> in_codes(0.01), in_codes(1 / 255)
    ('2.55/255', '1/255')
    """
    return f"{CODES * error:.3g}/{CODES}"
