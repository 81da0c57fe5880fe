"""Evaluate procedural textures at points.

A procedure is evaluated at points of any space: x, y, z in object or world space, or (u, v). With
the width of a pixel, the result is the mean over the pixel: exact for checkers and stripes,
approximate for noise, whose octaves fade to their mean.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.mesh.mesh import Float32Array
from texbake.parallel import run_bands
from texbake.records import dataclass
from texbake.texture.procedures.noise import fractal, noise, turbulence, value_noise, worley
from texbake.texture.procedures.options import (
    COLORED_PROCEDURES,
    PROCEDURE_DEFAULTS,
    checked_parameters,
)
from texbake.texture.procedures.patterns import (
    checker,
    gradient,
    granite,
    marble,
    radial,
    stripes,
    wood,
)
from texbake.texture.procedures.points import (
    BAND,
    ProcedurePoints,
    Work,
    checked_points,
    checked_widths,
)


@dataclass(frozen=True)
class Procedure:
    """A procedural texture."""

    name: str
    defaults: Mapping[str, Any]  # defaults of its parameters
    n_channels: int  # 3 if the procedure has colors, else 1
    # Takes samples and all parameters, and returns a function that evaluates a band of them.
    work: Callable[[ProcedurePoints, dict[str, Any]], Work]


_WORKS = (
    checker,
    stripes,
    noise,
    value_noise,
    fractal,
    turbulence,
    marble,
    wood,
    granite,
    worley,
    gradient,
    radial,
)
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
) -> Float32Array:
    """Evaluate a procedure at points (n, 3) or (n, 2): (n, 1) or linear (n, 3) float32 in [0, 1].

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
