"""All procedures, and their values at points.

A procedure is evaluated at points of any space: x, y, z of an object or of the world, or (u, v).
Given the width of a pixel, it gives the mean over the pixel as well as it is known: edges of
checkers and stripes exactly, octaves of noise by fading to their mean.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.parallel import run_bands
from texbake.texture.procedures.noise import fractal, noise, turbulence, worley
from texbake.texture.procedures.options import (
    COLORED_PROCEDURES,
    PROCEDURE_DEFAULTS,
    checked_parameters,
)
from texbake.texture.procedures.patterns import checker, granite, marble, stripes, wood
from texbake.texture.procedures.points import (
    BAND,
    ProcedurePoints,
    Work,
    checked_points,
    checked_widths,
)


@dataclass(frozen=True)
class Procedure:
    """A texture by formula.

    Attributes
    ----------
    name : str
    defaults : mapping
        Its parameters.
    n_channels : int
        3 where it has colors of its own, else 1.
    work : callable
        From samples and all parameters to the work on a band of them.
    """

    name: str
    defaults: Mapping[str, Any]
    n_channels: int
    work: Callable[[ProcedurePoints, dict[str, Any]], Work]


_WORKS = (checker, stripes, noise, fractal, turbulence, marble, wood, granite, worley)
PROCEDURES: Mapping[str, Procedure] = MappingProxyType(
    {
        work.__name__: Procedure(
            work.__name__,
            MappingProxyType(PROCEDURE_DEFAULTS[work.__name__]),
            3 if work.__name__ in COLORED_PROCEDURES else 1,
            work,
        )
        for work in _WORKS
    }
)


def evaluate(
    name: str,
    points: npt.ArrayLike,
    footprint: npt.ArrayLike | None = None,
    *,
    parameters: Mapping[str, Any] = MappingProxyType({}),
    scalar: bool = False,
    threads: int | None = None,
) -> npt.NDArray[np.float32]:
    """Values of a procedure at points.

    Parameters
    ----------
    name
        One of `PROCEDURES`.
    points : (n, 3) or (n, 2) float64
        Two coordinates: z = 0, and checker and cells are plane ones. A coordinate that is not
        finite, or larger than 2^50, where neighboring numbers lie too far apart for a pattern,
        counts as 0.
    footprint : (n,), (n, 3) or (n, 2) float, optional
        Width of the pixel at each point in the units of the points, along all axes or along each.
        With a width along each axis a face within the plane between two layers of a checker shows
        one of them, with one width for all the gray between both. None, and widths that are
        negative or not a number: the value at the point itself.
    parameters
        What differs from the defaults, `seed` among it.
    scalar
        The value from 0 to 1 also of a procedure with colors; the place in its ramp
        (`default_ramps`).
    threads
        None for every processor.

    Returns
    -------
    (n, 1) or (n, 3) float32
        In [0, 1]; three channels are linear RGB.

    Raises
    ------
    OptionError
        The procedure or a parameter is not known, or an array has another shape.

    Examples
    --------
    >>> evaluate("checker", [[0.5, 0.5], [1.5, 0.5]]).ravel().tolist()
    [1.0, 0.0]
    >>> evaluate("checker", [[0.75, 0.5]], [0.5]).ravel().tolist()
    [1.0]
    """
    full = checked_parameters(name, parameters)
    procedure = PROCEDURES[name]
    rows = checked_points(points)
    widths = checked_widths(footprint, rows)
    out = np.empty((len(rows), 1 if scalar else procedure.n_channels), np.float32)
    run_bands(
        procedure.work(ProcedurePoints(rows, widths, out), full),
        len(rows),
        band=BAND,
        threads=threads,
    )
    return out
