"""Surfaces known in closed form: where a function is 0, by their radii, or as heights.

Normals are the gradient of the function, and where lines meet the surface is found by Newton's
method along them. Slopes are central differences, whose error of about h^2 = 1e-10 is far below
what any map holds.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable

import numpy as np

from texbake.core import portable_math as pm
from texbake.mesh.mesh import AnyArray, BoolArray, FloatArray, IntArray, Mesh
from texbake.records import dataclass

# In radians, or in the units of the surface, which is about one unit wide.
_STEP = 1e-5
_ROUNDS = 20
_MOST_STEP = 0.05
# Value that counts as on the surface.
_ON_SURFACE = 1e-9
# Steps along a ray, and halvings of the step in which it goes inside.
_STEPS, _HALVINGS = 48, 32


class Surface(ABC):
    """A surface whose normals and points are known exactly: `value` is 0 there."""

    # From (n, 3) points to (n,) values, smooth near the surface, with slopes of about 1.
    value: Callable[[FloatArray], FloatArray]

    @abstractmethod
    def normals(self, points: FloatArray) -> FloatArray:
        """(n, 3) outward unit normals at or near points (n, 3)."""

    @abstractmethod
    def slopes(self, points: FloatArray, directions: FloatArray) -> FloatArray:
        """(n,) slopes of the value at (n, 3) points along (n, 3) directions."""

    def hits(self, starts: FloatArray, directions: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Points (n, 3) where lines meet the surface near their starts, and (n,) whether."""
        points = np.array(starts)
        for _ in range(_ROUNDS):
            values, along = self.value(points), self.slopes(points, directions)
            step = np.where(np.abs(along) > 1e-3, values / np.where(along == 0.0, 1.0, along), 0.0)
            points -= np.clip(step, -_MOST_STEP, _MOST_STEP)[:, None] * directions
            if np.abs(values).max(initial=0.0) < 0.01 * _ON_SURFACE:
                break
        return points, np.abs(self.value(points)) < _ON_SURFACE

    def first_hits(
        self, starts: FloatArray, directions: FloatArray, length: float
    ) -> tuple[FloatArray, BoolArray]:
        """Distances (n,) where rays go inside, and (n,) whether; steps are 1/48 of the length."""
        steps = np.linspace(0.0, length, _STEPS + 1)
        before = np.full(len(starts), -1, dtype=np.int64)
        was_outside = self.value(starts) > 0.0
        for i, step in enumerate(steps[1:]):
            is_outside = self.value(starts + step * directions) > 0.0
            before[was_outside & ~is_outside & (before < 0)] = i
            was_outside = is_outside
        found = before >= 0
        outer, inner = steps[before], steps[np.minimum(before + 1, _STEPS)]
        for _ in range(_HALVINGS):
            middle = 0.5 * (outer + inner)
            is_outside = self.value(starts + middle[:, None] * directions) > 0.0
            outer, inner = np.where(is_outside, middle, outer), np.where(is_outside, inner, middle)
        return 0.5 * (outer + inner), found


@dataclass(frozen=True, eq=False)
class ImplicitSurface(Surface):
    """A surface given by its value alone."""

    value: Callable[[FloatArray], FloatArray]

    def normals(self, points: FloatArray) -> FloatArray:
        """(n, 3) outward unit normals at or near points (n, 3)."""
        gradients = np.stack([self.slopes(points, axis) for axis in np.eye(3)], axis=1)
        lengths = np.sqrt(pm.vecdot(gradients, gradients))
        return np.asarray(gradients / np.where(lengths > 0.0, lengths, 1.0)[:, None])

    def slopes(self, points: FloatArray, directions: FloatArray) -> FloatArray:
        """(n,) slopes of the value at (n, 3) points along (n, 3) directions."""
        step = _STEP * directions
        return np.asarray((self.value(points + step) - self.value(points - step)) / (2.0 * _STEP))


@dataclass(frozen=True, eq=False)
class RadialSurface(Surface):
    """A surface around the origin, given by its radii."""

    # From (n, 3) unit vectors to (n,) distances from the origin, smooth.
    radii: Callable[[FloatArray], FloatArray]

    def normals(self, points: FloatArray) -> FloatArray:
        """(n, 3) outward unit normals in the directions of points (n, 3)."""
        out = _unit(points)
        along, up = _across(out)
        r = self.radii(out)
        slopes = [
            (self._toward(out, axis, _STEP) - self._toward(out, axis, -_STEP)) / (2.0 * _STEP)
            for axis in (along, up)
        ]
        return _unit(out * r[:, None] - along * slopes[0][:, None] - up * slopes[1][:, None])

    def _toward(self, out: FloatArray, axis: FloatArray, angle: float) -> FloatArray:
        return self.radii(pm.cos(angle) * out + pm.sin(angle) * axis)

    def mesh(self, directions: FloatArray, faces: IntArray, name: str) -> Mesh:
        """Return triangles between points of the surface, with its exact normals there."""
        positions = directions * self.radii(directions)[:, None]
        return Mesh(
            positions=positions,
            faces=faces,
            normals=self.normals(positions),
            normal_faces=faces,
            name=name,
        )

    def slopes(self, points: FloatArray, directions: FloatArray) -> FloatArray:
        """Slopes of the height over the surface: 1 along the normal, more along the radius."""
        normals = self.normals(points)
        steepness = pm.vecdot(normals, _unit(points))
        return np.asarray(pm.vecdot(normals, directions) / steepness)

    def value(self, points: FloatArray) -> FloatArray:
        """(n,) heights of points over the surface, along their radii."""
        lengths = np.sqrt(pm.vecdot(points, points))
        return np.asarray(lengths - self.radii(points / lengths[:, None]))


def orange_surface() -> RadialSurface:
    """Return the closed form of `texbake.mesh.shapes.orange`."""
    from texbake.mesh.shapes import peel_radii

    return RadialSurface(peel_radii)


def rippled_surface() -> RadialSurface:
    """Return a sphere with smooth ripples, an order of magnitude larger than the orange's pores."""

    def radii(directions: FloatArray) -> FloatArray:
        x, y, z = 6.0 * directions.T
        return np.asarray(1.0 + 0.03 * (pm.sin(x) * pm.sin(y) + pm.sin(y) * pm.sin(z)))

    return RadialSurface(radii)


def _unit(vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors / np.sqrt(pm.vecdot(vectors, vectors))[:, None])


def _across(out: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return two unit vectors at right angles to each of (n, 3) unit vectors and to each other."""
    least = np.zeros_like(out)
    least[np.arange(len(out)), np.abs(out).argmin(axis=1)] = 1.0
    along = _unit(np.cross(least, out))
    return along, np.cross(out, along)


# Waves over the unit square: whole periods along x and y, so that they tile; phase; amplitude.
_WAVES = ((3, 2, 0.4, 0.012), (-5, 7, 1.3, 0.005), (11, -4, 2.1, 0.0025), (13, 17, 0.7, 0.001))
_TURN = 2.0 * np.pi


def wave_heights(x: AnyArray, y: AnyArray) -> AnyArray:
    """Return heights h(x, y) of a few waves, in the precision of the coordinates."""
    return sum((a * pm.sin(_angle(x, y, m, n, p)) for m, n, p, a in _WAVES), start=0 * x)


def wave_slopes(x: AnyArray, y: AnyArray) -> tuple[AnyArray, AnyArray]:
    """Return the slopes dh/dx and dh/dy of the waves."""
    turns = [(m, n, a * pm.cos(_angle(x, y, m, n, p))) for m, n, p, a in _WAVES]
    along = sum((x.dtype.type(_TURN * m) * c for m, _, c in turns), start=0 * x)
    up = sum((x.dtype.type(_TURN * n) * c for _, n, c in turns), start=0 * x)
    return along, up


def wave_normals(x: AnyArray, y: AnyArray) -> AnyArray:
    """(..., 3) unit normals of the waves, x to the right and y up."""
    along, up = wave_slopes(x, y)
    normals = np.stack([-along, -up, np.ones_like(along)], axis=-1)
    return np.asarray(normals / np.sqrt(np.square(normals).sum(axis=-1, keepdims=True)))


def texel_grid(size: int) -> tuple[FloatArray, FloatArray]:
    """Return x and y, (size, size) each, of the texels of an image; row 0 is the top."""
    middles = (np.arange(size) + 0.5) / size
    x, y = np.meshgrid(middles, middles[::-1])
    return x, y


def _angle(x: AnyArray, y: AnyArray, m: int, n: int, p: float) -> AnyArray:
    of = x.dtype.type
    return np.asarray(of(_TURN * m) * x + of(_TURN * n) * y + of(p))
