"""Legends: how far a point lies between two marks, along a direction or from a center.

The value is 0 at `start`, 1 at `end` and linear between them; `wrap` says what comes beyond. With
a ramp of colors that is a scale of heights, of depths or of temperatures. In a wide pixel it is the
mean over the pixel, from the antiderivative of the wrapped value, which is exact for a gradient.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.core import portable_math as pm
from texbake.texture.procedures.points import ProcedurePoints, Work, unit_vector

_Floats = npt.NDArray[np.float64]
# Shares of the legend; a narrower pixel shows the value at its point.
_NARROW = 1e-4


def gradient(samples: ProcedurePoints, parameters: dict[str, Any]) -> Work:
    """Position along `direction`, from `start` to `end`."""
    direction = unit_vector(parameters["direction"])[: samples.n_dimensions]

    def work(start: int, stop: int) -> None:
        points = _finite(samples.points[start:stop])
        widths = pm.matmul(_widths(samples, start, stop), np.abs(direction))
        samples.out[start:stop, 0] = legend_values(pm.matmul(points, direction), widths, parameters)

    return work


def radial(samples: ProcedurePoints, parameters: dict[str, Any]) -> Work:
    """Distance from `center`, from `start` to `end`."""
    center = np.array(parameters["center"])[: samples.n_dimensions]

    def work(start: int, stop: int) -> None:
        away = _finite(samples.points[start:stop]) - center
        lengths = pm.norm(away, axis=1)
        units = away / np.where(lengths > 0.0, lengths, 1.0)[:, None]
        widths = pm.vecdot(np.abs(units), _widths(samples, start, stop))
        samples.out[start:stop, 0] = legend_values(lengths, widths, parameters)

    return work


def legend_values(positions: _Floats, widths: _Floats, parameters: dict[str, Any]) -> _Floats:
    """(n,) mean value of a legend over intervals of these widths around positions."""
    start, end, wrap = (parameters[key] for key in ("start", "end", "wrap"))
    at, widths = (positions - start) / (end - start), np.abs(widths / (end - start))
    if wrap == "clamp":
        at = np.clip(at, -1.0 - widths, 2.0 + widths)
    else:
        period = 1.0 if wrap == "repeat" else 2.0
        at = at - period * np.floor(at / period)
    wide = np.maximum(widths, _NARROW)
    means = (_integral(at + 0.5 * wide, wrap) - _integral(at - 0.5 * wide, wrap)) / wide
    return np.clip(np.where(widths > _NARROW, means, _wrapped(at, wrap)), 0.0, 1.0)


def _wrapped(at: _Floats, wrap: str) -> _Floats:
    if wrap == "clamp":
        return np.clip(at, 0.0, 1.0)
    return at - np.floor(at) if wrap == "repeat" else 1.0 - np.abs(1.0 - at % 2.0)


def _integral(at: _Floats, wrap: str) -> _Floats:
    """Integral of the wrapped value from 0."""
    if wrap == "clamp":
        return 0.5 * np.clip(at, 0.0, 1.0) ** 2 + np.maximum(at - 1.0, 0.0)
    if wrap == "repeat":
        whole = np.floor(at)
        return 0.5 * whole + 0.5 * (at - whole) ** 2
    whole = np.floor(0.5 * at)
    rest = at - 2.0 * whole
    return whole + np.where(rest <= 1.0, 0.5 * rest**2, 1.0 - 0.5 * (2.0 - rest) ** 2)


def _finite(points: _Floats) -> _Floats:
    """Points as the other procedures take them: what is no number, or too far away, counts as 0."""
    return np.where(np.abs(points) <= 2.0**50, points, 0.0)


def _widths(samples: ProcedurePoints, start: int, stop: int) -> _Floats:
    """(n, D) widths of the pixels along each axis; 0 for a point."""
    shape = (min(stop, len(samples.points)) - start, samples.n_dimensions)
    if samples.widths is None:
        return np.zeros(shape)
    widths = np.broadcast_to(samples.widths[start:stop], shape).astype(np.float64)
    return np.where((widths > 0.0) & (widths < 2.0**50), widths, 0.0)
