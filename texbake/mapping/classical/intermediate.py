"""The intermediate surfaces of a two-part mapping: where rays meet them, and their own (s, t).

Each stands around the mesh, about its center and axis, and is as large as the mesh needs. Points
and rays are given in its frame, as `LocalPoints` has them. The box is in `intermediate_box`.

The plane and the cylinder have no end in Bier and Sloan's paper. Here they reach four times the
size of the mesh beyond it on every side: seen from a sphere, a texture repeated that far out is
compressed eighty times, and a ray that almost misses would give coordinates without bound. A ray
that meets a surface nowhere, or too far away, leaves its point to the surface's own normal, which
is where the surface is nearest; so as not to tear a face, together with its other corners.

Based on: Bier, Sloan, "Two-part texture mappings", IEEE Computer Graphics and Applications 6(9),
1986 (the S mappings).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from texbake.mapping.classical.cylindrical import height_ends
from texbake.mapping.classical.frames import LocalPoints, wrap_angles
from texbake.mapping.classical.spherical import onto_sphere
from texbake.mapping.corner_uvs import Projected
from texbake.mapping.options import UnwrapOptions
from texbake.mesh.mesh import FloatArray, IntArray

BoolArray = npt.NDArray[np.bool_]

# How far the plane and the cylinder reach beyond the mesh, in lengths of the mesh.
_REACH = 4.0

# Of the radius: what is left of a point of the sphere that should lie on the axis.
_POLE_ROUNDING = 8.0 * 2.0**-53


class Surface(Protocol):
    """What a texture is put on first."""

    @property
    def name(self) -> str:
        """What reports call it."""

    def hits(self, points: FloatArray, directions: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Where rays meet the surface.

        Parameters
        ----------
        points : (N, 3) float64
            Where rays start: within the size that the surface was made for.
        directions : (N, 3) float64
            Of unit length, or (0, 0, 0), which meets nothing.

        Returns
        -------
        hits : (N, 3) float64
            The point where the ray leaves the inside of the surface, or passes the plane; where it
            does not, the start.
        missed : (N,) bool
        """

    def coordinates(self, points: FloatArray, faces: IntArray) -> Projected:
        """(s, t) of the points of the surface that are nearest to points: the S mapping.

        Parameters
        ----------
        points : (N, 3) float64
        faces : (F, 3) int
            Indices into the points.

        Returns
        -------
        Projected
            With what the surface has to tell of seams and poles.
        """


@dataclass(frozen=True, eq=False)
class Plane:
    """A plane across the axis, before the mesh: through the point that lies highest.

    Attributes
    ----------
    low : (2,) float64
        Least coordinates of the mesh along the first two directions of the frame: (0, 0) in
        texture space.
    extent : float
        The longer side of its bounding rectangle, 1 in texture space.
    height : float
        Of the plane along the axis.
    """

    low: FloatArray
    extent: float
    height: float
    name: str = "plane"

    def hits(self, points: FloatArray, directions: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Where rays meet the plane, as `Surface` says."""
        towards = directions[:, 2]
        with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
            met = points + ((self.height - points[:, 2]) / towards)[:, None] * directions
            middle = self.low + 0.5 * self.extent
            beyond = np.abs(met[:, :2] - middle).max(axis=1) - 0.5 * self.extent
            missed = ~((towards > 0.0) & (beyond <= _REACH * self.extent))
        met[missed] = points[missed]
        return met, missed

    def coordinates(self, points: FloatArray, faces: IntArray) -> Projected:
        """(s, t) of the feet of points, scaled alike; (0, 0) for a mesh without extent."""
        if self.extent == 0.0:
            return Projected(corners=np.zeros((len(faces), 3, 2)))
        return Projected(corners=((points[:, :2] - self.low) / self.extent)[faces])


@dataclass(frozen=True, eq=False)
class Cylinder:
    """A cylinder about the axis, through the points that lie furthest from it.

    Attributes
    ----------
    radius : float
    low, high : float
        Least and greatest height of the mesh.
    heights : (float, float)
        That become t = 0 and t = 1; t is 0 where they are equal.
    theta : (float, float)
        Angles in degrees that become s = 0 and s = 1.
    rounding : float
        Points no further from the axis are on it.
    """

    radius: float
    low: float
    high: float
    heights: tuple[float, float]
    theta: tuple[float, float]
    rounding: float
    name: str = "cylinder"

    def hits(self, points: FloatArray, directions: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Where rays leave the cylinder, as `Surface` says."""
        reach = _REACH * (self.high - self.low or self.radius)
        met, missed = _left_round(points, directions, self.radius, n_axes=2)
        missed |= ~((met[:, 2] >= self.low - reach) & (met[:, 2] <= self.high + reach))
        met[missed] = points[missed]
        return met, missed

    def coordinates(self, points: FloatArray, faces: IntArray) -> Projected:
        """Angles become s, heights t; points on the axis as `wrap_angles` says."""
        angles = wrap_angles(points, faces, theta=self.theta, rounding=self.rounding)
        first, last = self.heights
        t = (points[:, 2] - first) / (last - first) if first != last else np.zeros(len(points))
        return Projected(corners=np.stack([angles.s, t[faces]], axis=2), tallies=angles.tallies())


@dataclass(frozen=True, eq=False)
class Sphere:
    """A sphere about the center, through the points that lie furthest from it.

    Attributes
    ----------
    radius : float
    theta : (float, float)
        Longitudes in degrees that become s = 0 and s = 1.
    rounding : float
        Points no further from the axis are at a pole.
    """

    radius: float
    theta: tuple[float, float]
    rounding: float
    name: str = "sphere"

    def hits(self, points: FloatArray, directions: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Where rays leave the sphere, as `Surface` says; only (0, 0, 0) meets nothing."""
        met, missed = _left_round(points, directions, self.radius, n_axes=3)
        at_pole = np.hypot(met[:, 0], met[:, 1]) <= _POLE_ROUNDING * self.radius
        met[at_pole & ~missed, :2] = 0.0
        return met, missed

    def coordinates(self, points: FloatArray, faces: IntArray) -> Projected:
        """Longitudes become s, latitudes t; poles as `wrap_angles` says, the center t = 1/2."""
        return onto_sphere(points, faces, theta=self.theta, rounding=self.rounding)


def surface_around(local: LocalPoints, faces: IntArray, options: UnwrapOptions) -> Surface:
    """Surface that stands around a mesh.

    Parameters
    ----------
    local : LocalPoints
        Of the mesh, about the center and in the frame of the surface.
    faces : (F, 3) int32
    options : UnwrapOptions
        `surface` (any but the box), `theta` and `height` are read.

    Returns
    -------
    Surface
        A mesh that lies in the axis gets a cylinder as wide as the mesh is long, and one that lies
        in the center surfaces of radius 1; its rays have no direction, so that nothing of that is
        seen.
    """
    points = local.points[faces.ravel()]
    low, high = points.min(axis=0), points.max(axis=0)
    if options.surface == "plane":
        extent = float((high - low)[:2].max())
        return Plane(low[:2], extent, float(high[2]))
    radius = float(np.sqrt(np.einsum("ij,ij->i", points, points).max()))
    if not radius > local.rounding:
        radius = 1.0
    if options.surface == "sphere":
        return Sphere(radius, options.theta, local.rounding)
    from_axis = float(np.hypot(points[:, 0], points[:, 1]).max())
    return Cylinder(
        from_axis if from_axis > local.rounding else radius,
        float(low[2]),
        float(high[2]),
        height_ends(local, faces, options),
        options.theta,
        local.rounding,
    )


def mapped_by_rays(
    surface: Surface, points: FloatArray, directions: FloatArray, faces: IntArray
) -> Projected:
    """Map the corners of faces to where rays from them meet a surface.

    Parameters
    ----------
    surface : Surface
    points, directions : (V, 3) float64
        As `Surface.hits` takes them.
    faces : (F, 3) int32

    Returns
    -------
    Projected
        A face of which a ray misses is mapped by the nearest points of the surface to its corners.
        Tallied are those, and what the surface has to tell.
    """
    hits, missed = surface.hits(points, directions)
    lost = missed[faces].any(axis=1)
    if not lost.any():
        return surface.coordinates(hits, faces)
    chosen = faces + np.where(lost, len(points), 0)[:, None]
    mapped = surface.coordinates(np.concatenate([hits, points]), chosen)
    name = f"faces whose rays miss the {surface.name}, put at its nearest points"
    return Projected(corners=mapped.corners, tallies={name: int(lost.sum()), **mapped.tallies})


def _left_round(
    points: FloatArray, directions: FloatArray, radius: float, *, n_axes: int
) -> tuple[FloatArray, BoolArray]:
    """Where rays from inside leave what is round in the first two or three directions.

    Where they do not, the points may be anything, and the second array is True.
    """
    start, along = points[:, :n_axes], directions[:, :n_axes]
    a = np.einsum("ij,ij->i", along, along)
    b = np.einsum("ij,ij->i", start, along)
    # At most 0: the start is inside, to rounding.
    c = np.minimum(np.einsum("ij,ij->i", start, start) - radius * radius, 0.0)
    root = np.sqrt(b * b - a * c)
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        # The greater root of a k^2 + 2 b k + c, written without a difference of near equals.
        steps = np.where(b > 0.0, -c / (b + root), (root - b) / a)
        met = points + steps[:, None] * directions
        missed = ~np.isfinite(met).all(axis=1) | (a == 0.0)
    met[missed] = points[missed]
    return met, missed
