"""Curves of FBX animations: keys with constant, linear or cubic values between them.

Based on: B. Raiskila, "ufbx", 2020, for the flags and the data of keys.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from texbake.mesh.files.fbx_nodes import Node
from texbake.mesh.mesh import FloatArray
from texbake.records import dataclass

_TICKS = 46_186_158_000.0  # of a second
_CONSTANT, _LINEAR, _CUBIC = 2, 4, 8  # bits of the flags of a key
_NEXT = 0x100  # a constant key has the value of the next one
# The tangent after a key, and the one before the next, have a length of their own.
_WEIGHTED = np.array([0x1000000, 0x2000000])
_WEIGHT, _UNITS = 1.0 / 3.0, 9999.0  # usual length as a share of the time, and units of others


@dataclass(frozen=True, eq=False)
class Curve:
    """A number over time."""

    times: FloatArray  # (n,) float64; in seconds, ascending
    values: FloatArray  # (n,) float64
    flags: npt.NDArray[np.int64]  # (n,)
    slopes: FloatArray  # (n, 2) float64; per second, after each key and before the next
    weights: FloatArray | None = None  # (n, 2) float64; lengths of those tangents, if they differ

    def at(self, times: FloatArray) -> FloatArray:
        """(m,) values at some times."""
        last = len(self.times) - 1
        before = np.clip(np.searchsorted(self.times, times, side="right") - 1, 0, last)
        after = np.minimum(before + 1, last)
        spans = self.times[after] - self.times[before]
        share = np.divide(
            times - self.times[before], spans, out=np.zeros_like(times), where=spans > 0.0
        )
        share = np.clip(share, 0.0, 1.0)
        a, b = self.values[before], self.values[after]
        flags = self.flags[before]
        left, right = (self.slopes[before, side] * spans for side in range(2))
        if self.weights is not None:
            weights = self.weights[before]
            is_weighted = (weights != _WEIGHT).any(axis=1) & (flags & _CUBIC != 0)
            along = np.where(is_weighted, _parameters(share, weights), share)
            left, right = 3.0 * left * weights[:, 0], 3.0 * right * weights[:, 1]
            share = np.where(flags & _CUBIC != 0, along, share)
        u = share * share * (3.0 - 2.0 * share)
        bent = share * (1.0 - share)
        cubic = a + u * (b - a) + bent * ((1.0 - share) * left - share * right)
        linear = a + share * (b - a)
        constant = np.where((flags & _NEXT != 0) & (share > 0.0), b, a)
        values = np.where(flags & _CUBIC != 0, cubic, linear)
        return np.where(flags & _CONSTANT != 0, constant, values)


@np.errstate(over="ignore", invalid="ignore")
def read_curve(node: Node) -> Curve | None:
    """Read an `AnimationCurve`; None without keys, or if they are damaged.

    Numbers that are too large for their kind become others.
    """
    times = node.numbers("KeyTime").astype(np.float64) / _TICKS
    values = node.numbers("KeyValueFloat").astype(np.float64)
    n = min(len(times), len(values))
    times, values = times[:n], values[:n]
    if n == 0 or not np.isfinite(values).all() or (np.diff(times) < 0.0).any():
        return None
    counts = np.clip(node.numbers("KeyAttrRefCount").astype(np.int64), 0, n)
    flags = node.numbers("KeyAttrFlags").astype(np.int64)
    data = node.numbers("KeyAttrDataFloat")
    if data.dtype.kind in "iu":  # text files have the bits of the numbers
        data = data.astype(np.int64).astype(np.uint32).view(np.float32)
    slopes = data.astype(np.float64)[: len(data) // 4 * 4].reshape(-1, 4)[:, :2]
    packed = np.ascontiguousarray(data[: len(data) // 4 * 4].astype(np.float32)[2::4])
    m = min(len(counts), len(flags), len(slopes))
    ends = np.minimum(np.cumsum(counts[:m]), n)  # files can count more keys than they have
    which = np.repeat(np.arange(m), np.diff(ends, prepend=0))
    of_keys, of_slopes = np.full(n, _LINEAR), np.zeros((n, 2))
    of_keys[: len(which)] = flags[which]
    of_slopes[: len(which)] = np.nan_to_num(slopes[which], posinf=0.0, neginf=0.0)
    is_weighted = of_keys[:, None] & _WEIGHTED != 0
    if not is_weighted.any():
        return Curve(times, values, of_keys, of_slopes)
    lengths = np.full((n, 2), _WEIGHT)  # each two numbers of 16 bits
    lengths[: len(which)] = (packed.view(np.uint16).reshape(-1, 2) / _UNITS)[which]
    weights = np.where(is_weighted, np.clip(lengths, 1e-4, 1.0), _WEIGHT)
    return Curve(times, values, of_keys, of_slopes, weights)


def _parameters(shares: FloatArray, weights: FloatArray) -> FloatArray:
    """(n,) parameters of Bézier curves at (n,) shares of the time between two keys."""
    first, second = weights[:, 0], 1.0 - weights[:, 1]
    low, high = np.zeros_like(shares), np.ones_like(shares)
    for _ in range(48):
        s = 0.5 * (low + high)
        rest = 1.0 - s
        is_before = 3.0 * rest * s * (rest * first + s * second) + s * s * s < shares
        low, high = np.where(is_before, s, low), np.where(is_before, high, s)
    return np.where((shares > 0.0) & (shares < 1.0), 0.5 * (low + high), shares)
