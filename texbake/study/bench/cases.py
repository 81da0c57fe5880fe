"""Generated meshes whose surface has a closed form: high-poly ones of any size, and low-poly ones.

The low-poly meshes have texture coordinates by construction, so that no program's own unwrapping or
simplification comes between. No mesh stores normals: every program computes them itself. A user's
pair is a case as well.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from texbake.baking.scenes import measure_extent
from texbake.core import portable_math as pm
from texbake.mesh.compose import join_meshes
from texbake.mesh.files import write_mesh
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.mesh.parametric.grid import grid_quads, split_quads
from texbake.mesh.shapes import cube, grid_sphere, plane, uv_sphere
from texbake.mesh.weld import weld_rows
from texbake.raycast.scene import RayScene
from texbake.study.knob import StudyPair, low_with_uvs
from texbake.study.truth.surfaces import ImplicitSurface, wave_heights


@dataclass(frozen=True, eq=False)
class BenchCase:
    """A pair of meshes and what is known of their surface."""

    name: str
    # high, low: float32 positions; the low-poly mesh has texture coordinates.
    high: Mesh
    low: Mesh
    reach: float  # how far rays start outside the low-poly mesh and end inside it, in model units
    surface: ImplicitSurface | None = None  # None for the user's meshes
    # From a number of triangles to a mesh of the same surface, to unwrap; None to unwrap `low`.
    build: Callable[[int], Mesh] | None = None
    # From points (n, 3) of `floor` to the exact ambient light there, from 0 to 1.
    openness: Callable[[FloatArray], FloatArray] | None = None
    floor: int = 0  # number of the first faces of the low-poly mesh, at which `openness` holds

    @cached_property
    def pair(self) -> StudyPair:
        """The meshes as the truths of the study take them."""
        return StudyPair(self.high, self.low, self.subject, self.surface)

    @property
    def subject(self) -> str:
        """What is worked on, in words."""
        return (
            f"{self.high.name}, {self.high.n_faces:,} triangles, and a low-poly mesh of "
            f"{self.low.n_faces:,}"
        )


def made_case(name: str, n_triangles: int) -> BenchCase:
    """Return one of `CASE_NAMES` with about that many triangles in its high-poly mesh."""
    return _MAKERS[name](n_triangles)


def _case(
    name: str,
    build: Callable[[int], Mesh],
    n_triangles: int,
    low: Mesh,
    reach: float,
    value: Callable[[FloatArray], FloatArray],
) -> BenchCase:
    high = _rounded(build(n_triangles).replace(name=name))
    low = _rounded(low.replace(name=f"{name} low-poly"))
    return BenchCase(name, high, low, reach, ImplicitSurface(value), build)


def _rounded(mesh: Mesh) -> Mesh:
    """Positions as files hold them, so that every program works on the same ones."""
    return mesh.replace(positions=mesh.positions.astype(np.float32).astype(np.float64))


# Spheres


def _sphere_grid(n_triangles: int) -> Mesh:
    n_theta = max(round(math.sqrt(n_triangles / 4.0)), 3)
    return grid_sphere(n_theta, 2 * n_theta)


def _low_sphere() -> Mesh:
    return uv_sphere(17, 16)


def _sphere(n_triangles: int) -> BenchCase:
    def value(p: FloatArray) -> FloatArray:
        return np.asarray(pm.norm(p, axis=1) - 1.0)

    return _case("sphere", _sphere_grid, n_triangles, _low_sphere(), 0.1, value)


def _wavy_radii(p: FloatArray) -> FloatArray:
    """(n,) distances from the middle in the directions of points (n, 3)."""
    x, y, z = pm.sin(30.0 * (p / pm.norm(p, axis=1, keepdims=True)).T)
    return np.asarray(1.0 + 0.01 * (x * y + y * z + z * x))


def _displaced_sphere(n_triangles: int) -> BenchCase:
    def value(p: FloatArray) -> FloatArray:
        return np.asarray(pm.norm(p, axis=1) - _wavy_radii(p))

    def build(n: int) -> Mesh:
        mesh = _sphere_grid(n)
        return mesh.replace(positions=mesh.positions * _wavy_radii(mesh.positions)[:, None])

    return _case("displaced-sphere", build, n_triangles, _low_sphere(), 0.1, value)


# A plane


def _displaced_plane(n_triangles: int) -> BenchCase:
    def value(p: FloatArray) -> FloatArray:
        x, y, z = p.T
        return np.asarray(z - wave_heights(x, y))

    def build(n: int) -> Mesh:
        side = max(round(math.sqrt(n / 2.0)), 2)
        mesh = plane(side, side, wave_heights)
        return mesh.replace(uvs=None, uv_faces=None)

    return _case("displaced-plane", build, n_triangles, plane(4, 4), 0.1, value)


# A torus knot: a tube around a curve that winds around a torus

_WINDS, _ROUNDS = 2, 3  # around the axis of the torus, and around its ring
_RING, _WINDING, _TUBE = 1.0, 0.4, 0.15
_CURVE_POINTS = 4_000


def _knot_curve(t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Points of the curve at t from 0 to 2 pi, and two unit vectors across it."""
    a, b = _WINDS * t, _ROUNDS * t
    out = np.stack([pm.cos(a), pm.sin(a), np.zeros_like(a)], axis=1)
    around = np.stack([-pm.sin(a), pm.cos(a), np.zeros_like(a)], axis=1)
    up = np.array([0.0, 0.0, 1.0])
    off = pm.cos(b)[:, None] * out + pm.sin(b)[:, None] * up  # normal of the torus
    points = _RING * out + _WINDING * off
    along = _WINDS * (_RING + _WINDING * pm.cos(b))[:, None] * around
    along += _ROUNDS * _WINDING * (pm.cos(b)[:, None] * up - pm.sin(b)[:, None] * out)
    along /= pm.norm(along, axis=1, keepdims=True)
    return points, off, np.cross(along, off)


def _knot_mesh(n_along: int, n_around: int, *, uvs: bool = False) -> Mesh:
    t = np.linspace(0.0, 2.0 * np.pi, n_along, endpoint=False)
    angle = np.linspace(0.0, 2.0 * np.pi, n_around, endpoint=False)
    points, off, across = (x[:, None, :] for x in _knot_curve(t))
    ring = pm.cos(angle)[None, :, None] * off + pm.sin(angle)[None, :, None] * across
    quads = grid_quads(n_along, n_around)[:, [0, 3, 2, 1]]  # seen from outside
    row, column = np.divmod(quads, n_around + 1)
    faces = split_quads((row % n_along) * n_around + column % n_around)
    mesh = Mesh(positions=(points + _TUBE * ring).reshape(-1, 3), faces=faces, name="torus knot")
    if not uvs:
        return mesh
    u, v = np.meshgrid(np.arange(n_around + 1) / n_around, np.arange(n_along + 1) / n_along)
    coordinates = np.stack([u, v], axis=-1).reshape(-1, 2)
    return mesh.replace(uvs=coordinates, uv_faces=split_quads(quads))


def _torus_knot(n_triangles: int) -> BenchCase:
    from scipy.spatial import cKDTree

    parameters = np.linspace(0.0, 2.0 * np.pi, _CURVE_POINTS, endpoint=False)
    tree = cKDTree(_knot_curve(parameters)[0])

    def value(p: FloatArray) -> FloatArray:
        """Distance from the curve, at the parameter whose plane holds the point."""
        t = parameters[tree.query(p)[1]]
        for _ in range(6):
            points, off, across = _knot_curve(t)
            along = np.cross(off, across)
            step = 1e-5
            speed = (_knot_curve(t + step)[0] - _knot_curve(t - step)[0]) / (2.0 * step)
            rest = pm.vecdot(p - points, along)
            t = t + rest / pm.norm(speed, axis=1)
        return np.asarray(pm.norm(p - _knot_curve(t)[0], axis=1) - _TUBE)

    def build(n: int) -> Mesh:
        n_around = max(round(math.sqrt(n / 2.0 / 14.0)), 3)
        return _knot_mesh(max(n // (2 * n_around), 8), n_around)

    return _case("torus-knot", build, n_triangles, _knot_mesh(96, 10, uvs=True), 0.03, value)


# A box with rounded edges: hard surface with bevels

_BOX, _BEVEL = 0.5, 0.08  # half its side, radius of its edges


def _beveled_box(n_triangles: int) -> BenchCase:
    def value(p: FloatArray) -> FloatArray:
        outside = np.abs(p) - (_BOX - _BEVEL)
        lengths = pm.norm(np.maximum(outside, 0.0), axis=1)
        return np.asarray(lengths + np.minimum(outside.max(axis=1), 0.0) - _BEVEL)

    return _case("beveled-box", _rounded_box, n_triangles, _cube_with_uvs(), 0.1, value)


def _rounded_box(n_triangles: int) -> Mesh:
    """A box with a grid on each side, drawn in to its rounded edges and corners."""
    n = max(round(math.sqrt(n_triangles / 12.0)), 2)
    across, up = np.meshgrid(np.linspace(-_BOX, _BOX, n + 1), np.linspace(-_BOX, _BOX, n + 1))
    quads = grid_quads(n, n)[:, [0, 3, 2, 1]]
    sides: list[FloatArray] = []
    faces: list[IntArray] = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            side = np.empty((n + 1, n + 1, 3))
            side[..., axis] = sign * _BOX
            side[..., (axis + 1) % 3], side[..., (axis + 2) % 3] = across, up
            order = quads if sign > 0.0 else quads[:, ::-1]
            faces.append(split_quads(order) + len(sides) * (n + 1) ** 2)
            sides.append(side.reshape(-1, 3))
    points = np.concatenate(sides)
    inner = np.clip(points, _BEVEL - _BOX, _BOX - _BEVEL)
    out = points - inner
    points = inner + _BEVEL * out / pm.norm(out, axis=1, keepdims=True)
    return _welded(points, np.concatenate(faces))


def _welded(points: FloatArray, faces: IntArray) -> Mesh:
    """Vertices at one position become one, so that normals are smooth across."""
    firsts = weld_rows(points)
    kept, places = np.unique(firsts, return_inverse=True)
    return Mesh(positions=points[kept], faces=places[faces].astype(np.int32), name="box")


def _cube_with_uvs() -> Mesh:
    """A cube of 8 vertices, its sides beside one another in three columns and two rows."""
    mesh = cube()
    corners = np.empty((12, 3, 2))
    for i, face in enumerate(mesh.faces):
        points = mesh.positions[face]
        normal = np.cross(points[1] - points[0], points[2] - points[0])
        axis, sign = int(np.abs(normal).argmax()), np.sign(normal[np.abs(normal).argmax()])
        side = axis + 3 * (sign < 0)
        first, second = points[:, (axis + 1) % 3], points[:, (axis + 2) % 3]
        square = np.stack([0.5 + sign * first, 0.5 + second], axis=1)
        corners[i] = (0.05 + 0.9 * square + [side % 3, side // 3]) / 3.0
    uvs, places = np.unique(corners.reshape(-1, 2), axis=0, return_inverse=True)
    return mesh.replace(uvs=uvs, uv_faces=places.reshape(-1, 3).astype(np.int32))


# Two parts near each other: a ball over a floor

_FLOOR, _BALL, _GAP = 4.0, 0.5, 0.08  # width, radius, distance between them
_MIDDLE = np.array([0.0, 0.0, _BALL + _GAP])


def _two_parts(n_triangles: int) -> BenchCase:
    def value(p: FloatArray) -> FloatArray:
        return np.asarray(np.minimum(p[:, 2], pm.norm(p - _MIDDLE, axis=1) - _BALL))

    def build(n: int) -> Mesh:
        side = max(round(math.sqrt(n / 4.0)), 2)
        floor = plane(side, side).replace(uvs=None, uv_faces=None)
        return _together(_placed_floor(floor), _placed_ball(_sphere_grid(n // 2)))

    def openness(points: FloatArray) -> FloatArray:
        """1 less the share of the sky, weighted by the cosine, that the ball hides from a floor."""
        away = _MIDDLE - points
        return np.asarray(1.0 - away[:, 2] * _BALL**2 / pm.norm(away, axis=1) ** 3)

    floor, ball = plane(4, 4), uv_sphere(16, 16)
    halves = [
        mesh.replace(uvs=mesh.uvs * [0.48, 0.96] + [left, 0.02])
        for mesh, left in ((_placed_floor(floor), 0.01), (_placed_ball(ball), 0.51))
        if mesh.uvs is not None
    ]
    made = _case("two-parts", build, n_triangles, _together(*halves), 0.03, value)
    return BenchCase(
        made.name, made.high, made.low, made.reach, made.surface, build, openness, floor.n_faces
    )


def _together(*meshes: Mesh) -> Mesh:
    """Put meshes into one, as a single object in every program."""
    return join_meshes(meshes).replace(face_groups=None, group_names=())


def _placed_floor(mesh: Mesh) -> Mesh:
    return mesh.replace(positions=(mesh.positions - [0.5, 0.5, 0.0]) * _FLOOR)


def _placed_ball(mesh: Mesh) -> Mesh:
    return mesh.replace(positions=mesh.positions * _BALL + _MIDDLE)


_MAKERS: dict[str, Callable[[int], BenchCase]] = {
    "sphere": _sphere,
    "displaced-sphere": _displaced_sphere,
    "displaced-plane": _displaced_plane,
    "torus-knot": _torus_knot,
    "beveled-box": _beveled_box,
    "two-parts": _two_parts,
}


def pair_files(case: BenchCase, folder: Path) -> dict[str, str]:
    """Return the paths of the high-poly mesh (`high`) and the low-poly one (`low`), written once.

    The high-poly mesh is binary PLY, the low-poly one OBJ with texture coordinates.
    """
    return {
        "high": mesh_file(case.high, folder, f"{case.name} high"),
        "low": _written(case.low, folder / f"{case.name} low.obj"),
    }


def mesh_file(mesh: Mesh, folder: Path, name: str) -> str:
    """Return the path of a mesh as binary PLY, without texture coordinates, written once."""
    return _written(mesh.replace(uvs=None, uv_faces=None), folder / f"{name}.ply")


def _written(mesh: Mesh, path: Path) -> str:
    if not path.exists():
        positions = mesh.positions.astype(np.float32)
        write_mesh(mesh.replace(positions=positions), path)
    return str(path)


def own_case(high: Mesh, low: Mesh) -> BenchCase:
    """Return a case of a user's pair, as all programs can read it.

    Positions are rounded to float32 and normals are left out. The low-poly mesh is unwrapped if it
    has no texture coordinates. Ray distances are those that texbake measures.
    """
    high, low = _bare(high), _bare(low)
    low = low_with_uvs(high, low)
    frame = LocalFrame.around(high, low)
    extent = measure_extent(RayScene.build(high, frame), low, "smooth")
    return BenchCase(name=high.name, high=high, low=low, reach=max(extent.front, extent.back))


def _bare(mesh: Mesh) -> Mesh:
    """Without normals, groups, materials and colors, with the positions that files hold."""
    return Mesh(
        positions=mesh.positions.astype(np.float32).astype(np.float64),
        faces=mesh.faces,
        uvs=mesh.uvs,
        uv_faces=mesh.uv_faces,
        name=mesh.name,
    )
