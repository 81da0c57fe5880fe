"""Surfaces known as a radius in every direction: where a ray meets them, and their normals.

Based on: the gradient of |p| - r(p / |p|) for the normal. Of r only values are known, so its slopes
are central differences, whose error, about h^2 = 1e-10 radians, is far below what any map holds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.mesh.mesh import FloatArray, IntArray, Mesh

_STEP = 1e-5  # radians
_ROUNDS = 12
# In radii: what counts as on the surface.
_ON_SURFACE = 1e-9


@dataclass(frozen=True, eq=False)
class RadialSurface:
    """A surface about the origin.

    Attributes
    ----------
    radii
        From (n, 3) unit vectors to (n,) distances from the origin, smooth.
    """

    radii: Callable[[FloatArray], FloatArray]

    def normals(self, points: FloatArray) -> FloatArray:
        """(n, 3) outward unit normals at points (n, 3) in whose directions they are wanted."""
        out = _unit(points)
        along, up = _across(out)
        r = self.radii(out)
        slopes = [
            (self._toward(out, axis, _STEP) - self._toward(out, axis, -_STEP)) / (2.0 * _STEP)
            for axis in (along, up)
        ]
        return _unit(out * r[:, None] - along * slopes[0][:, None] - up * slopes[1][:, None])

    def _toward(self, out: FloatArray, axis: FloatArray, angle: float) -> FloatArray:
        return self.radii(np.cos(angle) * out + np.sin(angle) * axis)

    def mesh(self, directions: FloatArray, faces: IntArray, name: str) -> Mesh:
        """Triangles between points of the surface, with its own normals there."""
        positions = directions * self.radii(directions)[:, None]
        return Mesh(
            positions=positions,
            faces=faces,
            normals=self.normals(positions),
            normal_faces=faces,
            name=name,
        )

    def hits(
        self, starts: FloatArray, directions: FloatArray
    ) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
        """Where lines meet the surface near points that lie close to it.

        Parameters
        ----------
        starts : (n, 3) float64
            Points near the surface.
        directions : (n, 3) float64
            Unit vectors of the lines through them.

        Returns
        -------
        points : (n, 3) float64
        found : (n,) bool
            Whether Newton's method came to rest on the surface; a line that only touches it, or
            passes it by, has no such point.
        """
        points = np.array(starts)
        for _ in range(_ROUNDS):
            slope = np.einsum("ij,ij->i", self.normals(points), directions)
            out = _unit(points)
            # Distance along the normal, by the height over the surface along the radius.
            off = self._height(points) * np.einsum("ij,ij->i", self.normals(points), out)
            step = np.where(np.abs(slope) > 1e-3, off / np.where(slope == 0.0, 1.0, slope), 0.0)
            points -= np.clip(step, -0.05, 0.05)[:, None] * directions
            if np.abs(off).max(initial=0.0) < 0.01 * _ON_SURFACE:
                break
        return points, np.abs(self._height(points)) < _ON_SURFACE

    def _height(self, points: FloatArray) -> FloatArray:
        lengths = np.sqrt(np.einsum("ij,ij->i", points, points))
        return np.asarray(lengths - self.radii(points / lengths[:, None]))


def orange_surface() -> RadialSurface:
    """Return the closed form of `texbake.mesh.shapes.orange`."""
    from texbake.mesh.peel import peel_radii

    return RadialSurface(peel_radii)


def rippled_surface() -> RadialSurface:
    """Return a sphere with smooth ripples, an order of magnitude larger than the orange's pores."""

    def radii(directions: FloatArray) -> FloatArray:
        x, y, z = 6.0 * directions.T
        return np.asarray(1.0 + 0.03 * (np.sin(x) * np.sin(y) + np.sin(y) * np.sin(z)))

    return RadialSurface(radii)


def _unit(vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors / np.sqrt(np.einsum("ij,ij->i", vectors, vectors))[:, None])


def _across(out: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Two unit vectors at right angles to each of (n, 3) unit vectors and to one another."""
    least = np.zeros_like(out)
    least[np.arange(len(out)), np.abs(out).argmin(axis=1)] = 1.0
    along = _unit(np.cross(least, out))
    return along, np.cross(out, along)
