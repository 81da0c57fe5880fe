"""The camera, and its matrix from world space to clip space.

World and camera space are right-handed. The camera looks along its own -z axis, with +x to the
right and +y up in the picture. Depth is reversed without a far plane: 1 at the near plane, 0 at
infinity. This gives float32 depths the same relative precision at all distances.

`Camera.framing` fits a sphere into the picture. `fill_picture` lets the meshes themselves reach its
sides: each vertex and side give one inequality for the position of the eye, and the tightest for
each side is the extreme of a linear function of the vertices. It ignores strays: a few triangles
far from everything else, and triangles without area.

Based on: Upchurch and Desbrun, "Tightening the precision of perspective rendering", Journal of
Graphics Tools 16(1), 2012, for the infinite projection; reversed as in Reed, "Depth precision
visualized", 2015.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from texbake.core import core, portable_math as pm
from texbake.errors import MeshError, OptionError
from texbake.mesh.mesh import FloatArray, Mesh
from texbake.parallel import run_bands
from texbake.records import dataclass
from texbake.rendering.options import RenderOptions

# Near plane relative to the radius of the framed sphere: close enough to move into the mesh. With
# reversed depth this costs no precision.
NEAR = 1e-3
# Margin around the bounding sphere.
_MARGIN = 1.03
# Relative to the largest coordinate: twice the rounding error of half a difference.
_ROUNDING = 2.0**-52
# Below this sine of the angle between `up` and the view, rounding decides which way is right.
_PARALLEL = 1e-9


@dataclass(frozen=True, kw_only=True, eq=False)
class Camera:
    """A perspective camera in world space."""

    eye: FloatArray  # (3,) float64: position of the camera
    # (3, 3) float64: rows are the unit vectors right, up and back (opposite to the view)
    axes: FloatArray
    fov: float  # vertical field of view in radians
    near: float  # distance of the near plane in model units

    def __post_init__(self) -> None:
        for name in "eye", "axes":  # as kernels take them
            object.__setattr__(self, name, np.ascontiguousarray(getattr(self, name), np.float64))

    @classmethod
    def framing(cls, *meshes: Mesh, options: RenderOptions | None = None) -> Camera:
        """Return a camera that frames the sphere about the joint bounding box of meshes."""
        return cls.framing_sphere(*cls.sphere_around(*meshes), options or RenderOptions())

    @classmethod
    def framing_sphere(cls, center: FloatArray, radius: float, options: RenderOptions) -> Camera:
        """Return a camera that frames a sphere."""
        tangent = pm.tan(math.radians(options.fov) / 2)
        narrow = pm.arctan(tangent * min(1.0, options.width / options.height))
        distance = options.distance or _MARGIN * radius / pm.sin(narrow)
        axes = view_axes(*(math.radians(angle) for angle in options.view[:2]), up=options.up)
        return cls(
            eye=center + distance * axes[2],
            axes=axes,
            fov=math.radians(options.fov),
            near=min(NEAR * radius, 0.5 * distance),
        )

    @classmethod
    def looking_at(
        cls,
        eye: Sequence[float],
        target: Sequence[float],
        *,
        up: Sequence[float] = (0.0, 1.0, 0.0),
        fov: float,
        near: float,
    ) -> Camera:
        """Return a camera in world space that looks at a target, its vertical `fov` in radians."""
        if not 0.0 < fov < math.pi:
            raise OptionError(
                f"fov: {math.degrees(fov):g} is out of range; it must be above 0 and below 180"
            )
        if not 0.0 < near < math.inf:
            raise OptionError(f"near: {near:g} is not above 0; give the distance of the near plane")
        axes = axes_toward(eye, target, up)
        return cls(eye=np.array(eye, np.float64), axes=axes, fov=fov, near=near)

    @staticmethod
    def sphere_around(*meshes: Mesh) -> tuple[FloatArray, float]:
        """Center of the joint bounding box, and radius of the sphere around all; 1 if 0."""
        low = np.min([mesh.bounds[0] for mesh in meshes], axis=0)
        center = 0.5 * low + 0.5 * np.max([mesh.bounds[1] for mesh in meshes], axis=0)
        squared = 0.0
        for mesh in meshes:
            offsets = mesh.used_positions - center
            squared = max(squared, float(pm.vecdot(offsets, offsets).max()))
        if not math.isfinite(squared):
            raise MeshError(f"{meshes[0].name}: it is too large to render; scale it down")
        return center, math.sqrt(squared) if squared > 0.0 else 1.0

    def clip_from_world(self, aspect: float) -> FloatArray:
        """(4, 4) float64: matrix from world to clip space; `aspect` is width / height."""
        focal = 1.0 / pm.tan(self.fov / 2)
        view = np.eye(4)
        view[:3, :3] = self.axes
        view[:3, 3] = pm.matmul(-self.axes, self.eye)
        projection = np.array(
            [
                [focal / aspect, 0.0, 0.0, 0.0],
                [0.0, focal, 0.0, 0.0],
                [0.0, 0.0, 0.0, self.near],
                [0.0, 0.0, -1.0, 0.0],
            ]
        )
        return pm.matmul(projection, view)

    def view_rays(self, width: int, height: int) -> FloatArray:
        """(3, 3) rows o, x, y; the ray of column i, row j is o + i x + j y, one unit deep."""
        tall = 2.0 * pm.tan(self.fov / 2) / height
        right, up, back = self.axes
        corner = -back - 0.5 * width * tall * right + 0.5 * height * tall * up
        return np.stack([corner, tall * right, -tall * up])


def view_axes(azimuth: float, elevation: float, *, up: str) -> FloatArray:
    """Rows right, up, back of a camera that looks at the origin; also defined at the poles."""
    sin_a, cos_a = pm.sin(azimuth), pm.cos(azimuth)
    sin_e, cos_e = pm.sin(elevation), pm.cos(elevation)
    right = np.array([cos_a, 0.0, -sin_a])
    back = np.array([sin_a * cos_e, sin_e, cos_a * cos_e])
    axes = np.stack([right, np.cross(back, right), back])
    if up == "z":
        axes = np.stack([axes[:, 0], -axes[:, 2], axes[:, 1]], axis=1)
    return axes


def axes_toward(eye: Sequence[float], target: Sequence[float], up: Sequence[float]) -> FloatArray:
    """Rows right, up, back of a camera that looks at a target; see `Camera.looking_at`."""
    place, goal, upward = (np.array(point, np.float64) for point in (eye, target, up))
    for name, point in ("position", place), ("target", goal), ("up", upward):
        if point.shape != (3,) or not np.isfinite(point).all():
            raise OptionError(f"{name}: {point.tolist()} is not three finite numbers")
    # If the points differ by no more than the rounding of coordinates, the direction is undefined.
    largest = max(float(np.abs(place).max()), float(np.abs(goal).max()))
    back = _unit(place / 2 - goal / 2)
    if back is None or float(np.abs(place / 2 - goal / 2).max()) <= _ROUNDING * largest:
        raise OptionError("position: it is the same as the target; move one of them")
    upward_unit = _unit(upward)
    if upward_unit is None:
        raise OptionError("up: it has no length; give a direction such as 0, 1, 0")
    right = np.cross(upward_unit, back)
    if float(pm.norm(right)) <= _PARALLEL:
        raise OptionError("up: it is parallel to the view; give another direction")
    right /= pm.norm(right)
    return np.stack([right, np.cross(back, right), back])


def _unit(vector: FloatArray) -> FloatArray | None:
    """Return the unit vector of a direction; None for a zero vector."""
    largest = float(np.abs(vector).max())
    if not 0.0 < largest < math.inf:
        return None
    scaled = vector / largest
    return np.asarray(scaled / pm.norm(scaled))


# Share of the picture's width or height that the surfaces fill.
_FILL = 0.9
# Least distance of the eye from the middle, in radii, so that perspective does not exaggerate.
_AWAY = 2.2
# Triangles are strays if they have at most _STRAY_AREA of the area and lie far from most of it: a
# box that leaves out at most _LEFT_OVER of the area on each side is _STRAY_SIZE times smaller than
# the box of the whole mesh.
_STRAY_AREA = 1e-3
_LEFT_OVER = 1e-2
_STRAY_SIZE = 8.0
# How many triangles are sampled to find the box around most of the area.
_SAMPLES = 1 << 13
# Points per band.
_BAND = 1 << 16


def fill_picture(meshes: Sequence[Mesh], options: RenderOptions) -> tuple[Camera, int]:
    """Camera that fills the picture, and how many triangles it leaves out as they lie far away."""
    kept = _without_strays(meshes)
    n_strays = sum(mesh.n_faces for mesh in meshes) - sum(mesh.n_faces for mesh in kept)
    camera = _fit_camera(kept, options)
    if camera is None:
        raise MeshError(f"{meshes[0].name}: it is too large to render; scale it down")
    return camera, n_strays


def _fit_camera(meshes: Sequence[Mesh], options: RenderOptions) -> Camera | None:
    """Return the camera whose picture meshes fill; None if they are too large for float64."""
    axes = view_axes(*(math.radians(angle) for angle in options.view[:2]), up=options.up)
    right, up, back = axes
    tall = _FILL * pm.tan(math.radians(options.fov) / 2)
    wide = tall * options.width / options.height
    # A point (x, y, z) along the axes is in the picture of an eye at (X, Y, Z) if
    # x + wide z <= X + wide Z and -x + wide z <= -X + wide Z, and likewise for y.
    sides = [right + wide * back, -right + wide * back, up + tall * back, -up + tall * back]
    reach = _extremes(meshes, np.stack([*sides, *axes, *-axes]))
    low, high = -reach[7:], reach[4:7]
    radius = 0.5 * _diagonal(np.stack([low, high])) or 1.0
    if not math.isfinite(radius) or not np.isfinite(reach).all():
        return None
    to_right, to_left, to_top, to_bottom = reach[:4]
    away = max(
        (to_right + to_left) / (2.0 * wide),
        (to_top + to_bottom) / (2.0 * tall),
        0.5 * (low[2] + high[2]) + _AWAY * radius,
    )
    across, above = 0.5 * (to_right - to_left), 0.5 * (to_top - to_bottom)
    return Camera(
        eye=across * right + above * up + away * back,
        axes=axes,
        fov=math.radians(options.fov),
        near=NEAR * radius,
    )


def _extremes(meshes: Sequence[Mesh], directions: FloatArray) -> FloatArray:
    """(D,) float64: the greatest dot product of any point with each direction."""
    found, columns = [], np.ascontiguousarray(directions.T)
    for mesh in meshes:
        extremes = np.empty((-(-mesh.n_vertices // _BAND), len(directions)))

        def work(start: int, stop: int, mesh: Mesh = mesh, out: FloatArray = extremes) -> None:
            core.find_extremes(
                mesh.positions, mesh.used_vertices, columns, start // _BAND, out, start, stop
            )

        run_bands(work, mesh.n_vertices, band=_BAND)
        found.append(extremes.max(axis=0))
    return np.asarray(np.max(found, axis=0))


def _without_strays(meshes: Sequence[Mesh]) -> list[Mesh]:
    """Return the meshes without the few triangles that lie far from all others."""
    step = -(-sum(mesh.n_faces for mesh in meshes) // _SAMPLES)
    corners = np.concatenate([mesh.positions[mesh.faces[::step]] for mesh in meshes])
    areas = _areas(corners)
    if step > 1:  # a stray among the samples may be the only one of its size
        areas = np.minimum(areas, 0.5 * _LEFT_OVER * areas.sum())
    box = _box_of_most(corners, areas)
    bounds = np.array([mesh.bounds for mesh in meshes])
    whole = np.stack([bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)])
    if box is None or not _diagonal(whole) > _STRAY_SIZE * _diagonal(box):
        return list(meshes)
    room = _diagonal(box)
    kept, area, stray_area = [], 0.0, 0.0
    for mesh in meshes:
        corners = mesh.positions[mesh.faces]
        inside = ((corners >= box[0] - room) & (corners <= box[1] + room)).all(axis=(1, 2))
        areas = _areas(corners)
        area, stray_area = area + float(areas.sum()), stray_area + float(areas[~inside].sum())
        if inside.any():
            kept.append(Mesh(positions=mesh.positions, faces=mesh.faces[inside], name=mesh.name))
    return kept if stray_area <= _STRAY_AREA * area else list(meshes)


def _box_of_most(corners: FloatArray, areas: FloatArray) -> FloatArray | None:
    """(2, 3) box around the triangles with most of the area; None if all areas are 0."""
    middles = corners.mean(axis=1)
    inside = areas > 0.0
    for k in range(3):
        order = np.argsort(middles[:, k], kind="stable")
        below = np.cumsum(areas[order])
        total = below[-1]
        if not 0.0 < total < math.inf:
            return None
        is_low = below <= _LEFT_OVER * total
        is_high = below - areas[order] >= (1.0 - _LEFT_OVER) * total
        inside[order[is_low | is_high]] = False
    if not inside.any():
        return None
    points = corners[inside].reshape(-1, 3)
    return np.stack([points.min(axis=0), points.max(axis=0)])


def _areas(corners: FloatArray) -> FloatArray:
    """(F,) float64: twice the area of each triangle."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    with np.errstate(over="ignore", invalid="ignore"):
        crossed = np.cross(a, b)
        return np.asarray(np.sqrt((crossed * crossed).sum(axis=1)))


def _diagonal(box: FloatArray) -> float:
    with np.errstate(over="ignore"):
        return float(np.sqrt(((box[1] - box[0]) ** 2).sum()))
