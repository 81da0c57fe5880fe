"""Two-part mapping: the texture goes onto a simple surface, and from there onto the object.

docs/explanation/mappings.md says which point of which surface belongs to a point x of the object.
With `reflection` it is where the ray x + k (2 (n . v) n - v) leaves it, v from x to the eye. Each
surface encloses the mesh, about its center and axis, and is as large as the mesh requires: a plane
on the side that the axis points to, a cylinder or sphere through the farthest points, or a box. A
sphere by its own normals and a sphere by the centroid are the same.

Points and rays are given in the frame of the surface, as in `LocalPoints`. Plane and cylinder,
infinite in Bier and Sloan's paper, extend beyond the mesh by four times its size: a texture
repeated that far out is compressed eighty times, and a ray that almost misses would give unbounded
coordinates. Each side of the box has its own cell of the texture, so that a face cannot lie on two
of them.

Based on: Bier, Sloan, "Two-part texture mappings", IEEE Computer Graphics and Applications 6(9),
1986, which does not say how to treat a face across an edge of the box. It departs in that rays
start at the object and only go outward.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from texbake.core import portable_math as pm
from texbake.mapping.classical.box import side_pictures
from texbake.mapping.classical.cylindrical import center_about_axis, height_ends, onto_sphere
from texbake.mapping.classical.frames import (
    LocalPoints,
    center_of,
    frame_about,
    in_frame,
    points_about,
    upright_frame,
    wrap_angles,
)
from texbake.mapping.corner_uvs import Projected
from texbake.mapping.options import UnwrapOptions
from texbake.mapping.options.projection import AXES
from texbake.mesh.mesh import BoolArray, FloatArray, Int64Array, IntArray, Mesh
from texbake.mesh.normals import smooth_normals
from texbake.records import dataclass

# How far the plane and the cylinder extend beyond the mesh, in lengths of the mesh.
_EXTENT = 4.0

# As a share of the radius: how far rounding leaves a point of the sphere from the axis it is on.
_POLE_ROUNDING = 8.0 * 2.0**-53


@dataclass(frozen=True, eq=False)
class Plane:
    """A plane perpendicular to the axis, through the highest point of the mesh."""

    # (2,) float64; least coordinates of the mesh along the first two directions of the frame; (0,
    # 0) in texture space.
    low: FloatArray
    extent: float  # the longer side of the bounding rectangle, 1 in texture space
    height: float  # position of the plane along the axis
    name: str = "plane"

    def hits(self, points: FloatArray, directions: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Where rays (N, 3) leave the surface, or their start, and (N,) whether they miss."""
        towards = directions[:, 2]
        with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
            met = points + ((self.height - points[:, 2]) / towards)[:, None] * directions
            middle = self.low + 0.5 * self.extent
            beyond = np.abs(met[:, :2] - middle).max(axis=1) - 0.5 * self.extent
            missed = ~((towards > 0.0) & (beyond <= _EXTENT * self.extent))
        met[missed] = points[missed]
        return met, missed

    def coordinates(
        self, points: FloatArray, faces: IntArray, polygons: IntArray | None = None
    ) -> Projected:
        """(s, t) of the points of the plane nearest to points (N, 3): the S mapping."""
        if self.extent == 0.0:
            return Projected(corners=np.zeros((len(faces), 3, 2)))
        return Projected(corners=((points[:, :2] - self.low) / self.extent)[faces])


@dataclass(frozen=True, eq=False)
class Cylinder:
    """A cylinder about the axis, through the points farthest from it."""

    radius: float
    # low, high: least and greatest height of the mesh.
    low: float
    high: float
    # Heights that become t = 0 and t = 1; t is 0 if they are equal.
    heights: tuple[float, float]
    theta: tuple[float, float]  # angles in degrees that become s = 0 and s = 1
    rounding: float  # points no farther from the axis lie on it
    name: str = "cylinder"

    def hits(self, points: FloatArray, directions: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Where rays leave the cylinder; see `Plane.hits`."""
        extent = _EXTENT * (self.high - self.low or self.radius)
        met, missed = _left_round(points, directions, self.radius, n_axes=2)
        missed |= ~((met[:, 2] >= self.low - extent) & (met[:, 2] <= self.high + extent))
        met[missed] = points[missed]
        return met, missed

    def coordinates(
        self, points: FloatArray, faces: IntArray, polygons: IntArray | None = None
    ) -> Projected:
        """Angles become s, heights become t; `wrap_angles` describes points on the axis."""
        angles = wrap_angles(
            points, faces, theta=self.theta, rounding=self.rounding, polygons=polygons
        )
        first, last = self.heights
        t = (points[:, 2] - first) / (last - first) if first != last else np.zeros(len(points))
        return Projected(corners=np.stack([angles.s, t[faces]], axis=2), tallies=angles.tallies())


@dataclass(frozen=True, eq=False)
class Sphere:
    """A sphere about the center, through the points farthest from it."""

    radius: float
    theta: tuple[float, float]  # longitudes in degrees that become s = 0 and s = 1
    rounding: float  # points no farther from the axis are at a pole
    name: str = "sphere"

    def hits(self, points: FloatArray, directions: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Where rays leave the sphere; only the direction (0, 0, 0) misses."""
        met, missed = _left_round(points, directions, self.radius, n_axes=3)
        at_pole = pm.hypot(met[:, 0], met[:, 1]) <= _POLE_ROUNDING * self.radius
        met[at_pole & ~missed, :2] = 0.0
        return met, missed

    def coordinates(
        self, points: FloatArray, faces: IntArray, polygons: IntArray | None = None
    ) -> Projected:
        """Longitudes become s, latitudes t; see `onto_sphere` for the poles and the center."""
        return onto_sphere(
            points, faces, theta=self.theta, rounding=self.rounding, polygons=polygons
        )


IntermediateSurface = Plane | Cylinder | Sphere


def surface_around(
    local: LocalPoints, faces: IntArray, options: UnwrapOptions
) -> IntermediateSurface:
    """Make the surface that encloses a mesh, given in the frame of the surface."""
    points = local.points[faces.ravel()]
    low, high = points.min(axis=0), points.max(axis=0)
    if options.surface == "plane":
        return Plane(low[:2], float((high - low)[:2].max()), float(high[2]))
    radius = float(np.sqrt(pm.vecdot(points, points).max()))
    if not radius > local.rounding:
        radius = 1.0
    if options.surface == "sphere":
        return Sphere(radius, options.theta, local.rounding)
    from_axis = float(pm.hypot(points[:, 0], points[:, 1]).max())
    return Cylinder(
        from_axis if from_axis > local.rounding else radius,
        float(low[2]),
        float(high[2]),
        height_ends(local, faces, options),
        options.theta,
        local.rounding,
    )


def mapped_by_rays(
    surface: IntermediateSurface,
    points: FloatArray,
    directions: FloatArray,
    faces: IntArray,
    polygons: IntArray | None = None,
) -> Projected:
    """Map corners to where rays hit, or polygons with a miss to the nearest points."""
    hits, missed = surface.hits(points, directions)
    lost = missed[faces].any(axis=1)
    if polygons is not None:
        lost = (np.bincount(polygons, lost) > 0)[polygons]
    if not lost.any():
        return surface.coordinates(hits, faces, polygons)
    chosen = faces + np.where(lost, len(points), 0)[:, None]
    mapped = surface.coordinates(np.concatenate([hits, points]), chosen, polygons)
    name = f"faces whose rays miss the {surface.name}, mapped to its nearest points"
    return Projected(corners=mapped.corners, tallies={name: int(lost.sum()), **mapped.tallies})


def _left_round(
    points: FloatArray, directions: FloatArray, radius: float, *, n_axes: int
) -> tuple[FloatArray, BoolArray]:
    """Where rays from inside leave a cylinder (`n_axes` 2) or a sphere (3), and which never do."""
    start, along = points[:, :n_axes], directions[:, :n_axes]
    a = pm.vecdot(along, along)
    b = pm.vecdot(start, along)
    # At most 0, since the start is inside; more is rounding.
    c = np.minimum(pm.vecdot(start, start) - radius * radius, 0.0)
    root = np.sqrt(b * b - a * c)
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        # The greater root of a k^2 + 2 b k + c, written without a difference of near equals.
        steps = np.where(b > 0.0, -c / (b + root), (root - b) / a)
        met = points + steps[:, None] * directions
        missed = ~np.isfinite(met).all(axis=1) | (a == 0.0)
    met[missed] = points[missed]
    return met, missed


_ROUNDING = 2.0**-40  # of unit vectors, and of distances: of sides as near, the first is taken

# Axes of the box in the frame: its pictures have the axis up and e1 as the front.
_UPRIGHT = [1, 2, 0]


@dataclass(frozen=True, eq=False)
class Box:
    """A box about the center, aligned with a frame."""

    half: FloatArray  # (3,) float64; half its size along e2, the axis and e1
    options: UnwrapOptions  # `size` and `padding` are read
    name: str = "box"

    @classmethod
    def around(cls, local: LocalPoints, faces: IntArray, options: UnwrapOptions) -> Box:
        """The least box about the center that encloses a mesh, thick in all directions."""
        half = np.abs(local.points[faces.ravel()]).max(axis=0)[_UPRIGHT]
        flat = half <= local.rounding
        half[flat] = 1.0 if flat.all() else half.max()
        return cls(half, options)

    def mapped_by_rays(
        self, points: FloatArray, directions: FloatArray, faces: IntArray
    ) -> Projected:
        """Map corners to where rays from them, (V, 3) in the frame, leave the box."""
        points, directions = points[:, _UPRIGHT], directions[:, _UPRIGHT]
        # A ray along a side must not meet it far away by rounding.
        directions = np.where(np.abs(directions) <= _ROUNDING, 0.0, directions)
        corner_sides = self._sides(points, directions)[faces]
        sides = corner_sides[:, 0].copy()
        across = (corner_sides != sides[:, None]).any(axis=1)
        middles = points[faces[across]].mean(axis=1)
        sides[across] = self._sides(middles, _or_outward(directions[faces[across]], middles))

        starts, along = points[faces], directions[faces]
        axes, signs = sides // 2, 1.0 - 2.0 * (sides % 2)
        rows = np.arange(len(faces))
        towards = along[rows, :, axes] * signs[:, None]
        gaps = np.maximum(self.half[axes][:, None] - starts[rows, :, axes] * signs[:, None], 0.0)
        with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
            met = starts + (gaps / towards)[:, :, None] * along
        met = np.where((towards > 0.0)[:, :, None] & np.isfinite(met), met, starts)
        met = np.clip(met, -self.half, self.half)

        counts = {
            "faces across an edge of the box": int(across.sum()),
            "corners at the center": int((directions == 0.0).all(axis=1)[faces].sum()),
        }
        return Projected(corners=side_pictures(met, sides, self.half, self.options), tallies=counts)

    def mapped_by_normals(
        self, points: FloatArray, normals: FloatArray, faces: IntArray
    ) -> Projected:
        """Project corners onto the side of the box nearest to the object's normals (V, 3)."""
        corners = points[:, _UPRIGHT][faces]
        chosen = _or_outward(normals[:, _UPRIGHT][faces], corners.mean(axis=1))
        axes = _first_least(-np.abs(chosen))
        sides = 2 * axes + (np.take_along_axis(chosen, axes[:, None], axis=1)[:, 0] < 0.0)
        return Projected(corners=side_pictures(corners, sides, self.half, self.options))

    def _sides(self, points: FloatArray, directions: FloatArray) -> Int64Array:
        """(N,) int64: side where each ray leaves the box; the nearest side without a direction."""
        with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
            gaps = np.copysign(self.half, directions) - points
            steps = np.where(directions == 0.0, np.inf, gaps / directions)
        axes = _first_least(steps)
        ahead = np.take_along_axis(directions, axes[:, None], axis=1)[:, 0]
        none = (directions == 0.0).all(axis=1)
        if none.any():
            gaps = self.half - np.abs(points[none])
            axes[none] = _first_least(gaps, _ROUNDING * self.half.max())
            ahead[none] = np.take_along_axis(points[none], axes[none, None], axis=1)[:, 0]
        return np.asarray(2 * axes + (ahead < 0.0))


def _first_least(values: FloatArray, slack: float = 0.0) -> Int64Array:
    """(N,) int64: the first column that is the least of its row but for rounding."""
    least = values.min(axis=1, keepdims=True)
    with np.errstate(invalid="ignore"):  # infinite
        near = values <= least + _ROUNDING * np.abs(least) + slack
    return np.asarray((near | (values == least)).argmax(axis=1))


def _or_outward(directions: FloatArray, middles: FloatArray) -> FloatArray:
    """(n, 3): sums of the corners' directions; the outward direction where they cancel."""
    sums = directions.sum(axis=1)
    canceled = np.abs(sums).max(axis=1, initial=0.0) <= _ROUNDING
    return np.where(canceled[:, None], middles, sums)


def two_part(mesh: Mesh, options: UnwrapOptions) -> Projected:
    """Map a mesh through an intermediate surface."""
    frame = _frame(options)
    if options.surface == "cylinder":
        center = center_about_axis(mesh, options.center, frame)
    else:
        center = center_of(mesh, options.center)
    local = points_about(mesh, center, frame)
    # Unused vertices may lie anywhere, but their rays are computed with the rest.
    local = replace(local, points=np.where(mesh.used_vertices[:, None], local.points, 0.0))
    by_normal = options.via == "surface-normal"
    if options.surface == "box":
        # The object's normals choose among the normals of the box.
        directions, tallies = _directions(mesh, local, center, frame, options)
        box = Box.around(local, mesh.faces, options)
        onto_box = box.mapped_by_normals if by_normal else box.mapped_by_rays
        mapped = onto_box(local.points, directions, mesh.faces)
    else:
        surface = surface_around(local, mesh.faces, options)
        # A ray from the center hits a sphere along its normal.
        if by_normal or (options.surface, options.via) == ("sphere", "centroid"):
            return surface.coordinates(local.points, mesh.faces, mesh.polygon_of)
        directions, tallies = _directions(mesh, local, center, frame, options)
        mapped = mapped_by_rays(surface, local.points, directions, mesh.faces, mesh.polygon_of)
    return replace(mapped, tallies=tallies | mapped.tallies)


def _frame(options: UnwrapOptions) -> FloatArray:
    """Rows of the surface's frame; the last is the axis."""
    if options.surface != "plane":
        return frame_about("y" if options.axis is None else options.axis)
    axis = "z" if options.axis is None else options.axis
    return upright_frame(AXES[axis] if isinstance(axis, str) else axis)


def _directions(
    mesh: Mesh, local: LocalPoints, center: FloatArray, frame: FloatArray, options: UnwrapOptions
) -> tuple[FloatArray, dict[str, int]]:
    """(V, 3) unit directions of rays, 0 for a vertex at the center; and tallies."""
    outward = _unit(local.points, local.rounding)
    if options.via == "centroid":
        return outward, {}
    directions = in_frame(smooth_normals(mesh), frame)
    if options.via == "reflection":
        assert options.eye is not None
        to_eye = np.array(options.eye) - center
        views = in_frame(to_eye[None] * local.scale, frame) - local.points
        directions = _mirrored(_unit(views, local.rounding), directions)
    rayless = (directions == 0.0).all(axis=1)
    directions[rayless] = outward[rayless]
    n_rayless = int(rayless[mesh.faces].sum())
    return directions, {"corners without a ray, sent from the center": n_rayless}


def _mirrored(views: FloatArray, normals: FloatArray) -> FloatArray:
    """Compute 2 (n . v) n - v for unit vectors; 0 where either is 0."""
    along = pm.vecdot(normals, views)[:, None]
    mirrored = _unit(2.0 * along * normals - views, 0.0)
    mirrored[(normals == 0.0).all(axis=1)] = 0.0
    return mirrored


def _unit(vectors: FloatArray, rounding: float) -> FloatArray:
    """(N, 3): vectors normalized; 0 for those no longer than `rounding`."""
    largest = np.abs(vectors).max(axis=1, keepdims=True)
    none = largest[:, 0] <= rounding
    scaled = vectors / np.where(none[:, None], 1.0, largest)  # so that no square overflows
    scaled[none] = 0.0
    lengths = np.sqrt(pm.vecdot(scaled, scaled))[:, None]
    return np.asarray(scaled / np.where(none[:, None], 1.0, lengths))
