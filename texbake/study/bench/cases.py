"""Generated meshes whose surface has a closed form: high-poly ones of any size, and low-poly ones.

The low-poly meshes have texture coordinates by construction, so that no program's own unwrapping or
simplification comes between. No mesh stores normals, but for the one with hard edges: every program
computes them itself. A user's pair is a case as well.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property
from pathlib import Path

import numpy as np

from texbake.baking.scenes import measure_extent
from texbake.core import portable_math as pm
from texbake.mesh.compose import join_meshes
from texbake.mesh.files import write_mesh
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.mesh.shapes import grid_sphere, orange, peel_radii, plane, uv_sphere
from texbake.mesh.weld import weld_rows
from texbake.raycast.scene import RayScene
from texbake.records import dataclass
from texbake.study.bench.solids import Gyroid, beveled_box, box_value, cube_with_uvs
from texbake.study.knob import StudyPair, low_with_uvs
from texbake.study.truth.probes import Probes, probe, probe_surface
from texbake.study.truth.surfaces import ImplicitSurface, Surface, orange_surface, wave_heights


@dataclass(frozen=True, eq=False)
class BenchCase:
    """A pair of meshes and what is known of their surface."""

    name: str
    # high, low: float32 positions; the low-poly mesh has texture coordinates.
    high: Mesh
    low: Mesh
    reach: float  # how far rays start outside the low-poly mesh and end inside it, in model units
    surface: Surface | None = None  # None for the user's meshes
    # From a number of triangles to a mesh of the same surface, to unwrap; None to unwrap `low`.
    build: Callable[[int], Mesh] | None = None
    # From points (n, 3) of `floor` to the exact ambient light there, from 0 to 1.
    openness: Callable[[FloatArray], FloatArray] | None = None
    floor: int = 0  # number of the first faces of the low-poly mesh, at which `openness` holds

    @property
    def subject(self) -> str:
        """What is worked on, in words."""
        return (
            f"{self.high.name}, {self.high.n_faces:,} triangles, and a low-poly mesh of "
            f"{self.low.n_faces:,}"
        )

    @cached_property
    def _probes(self) -> dict[int, Probes]:
        return {}

    def probes(self, n: int) -> Probes:
        """Return what about `n` points of the low-poly mesh should show."""
        if n not in self._probes:
            self._probes[n] = (
                probe(StudyPair(self.high, self.low, self.subject), n)
                if self.surface is None
                else probe_surface(self.surface, self.low, n, reach=self.reach)
            )
        return self._probes[n]


def made_case(name: str, n_triangles: int) -> BenchCase:
    """Return one of `CASE_NAMES` with about that many triangles in its high-poly mesh."""
    return _MAKERS[name](n_triangles)


def _case(
    name: str,
    build: Callable[[int], Mesh],
    n_triangles: int,
    low: Mesh,
    reach: float,
    surface: Surface,
) -> BenchCase:
    high = _rounded(build(n_triangles).replace(name=name))
    low = _rounded(low.replace(name=f"{name} low-poly"))
    return BenchCase(name, high, low, reach, surface, build)


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

    return _case("sphere", _sphere_grid, n_triangles, _low_sphere(), 0.1, ImplicitSurface(value))


def _wavy_radii(p: FloatArray, *, mirrored: bool = False) -> FloatArray:
    """(n,) distances from the center in the directions of points (n, 3), even in y if mirrored."""
    angles = 30.0 * (p / pm.norm(p, axis=1, keepdims=True)).T
    x, y, z = pm.sin(angles)
    if mirrored:
        y = pm.cos(angles[1])
    return np.asarray(1.0 + 0.01 * (x * y + y * z + z * x))


def _displaced_sphere(n_triangles: int) -> BenchCase:
    def value(p: FloatArray) -> FloatArray:
        return np.asarray(pm.norm(p, axis=1) - _wavy_radii(p))

    def build(n: int) -> Mesh:
        mesh = _sphere_grid(n)
        return mesh.replace(positions=mesh.positions * _wavy_radii(mesh.positions)[:, None])

    return _case("displaced-sphere", build, n_triangles, _low_sphere(), 0.1, ImplicitSurface(value))


def _orange(n_triangles: int) -> BenchCase:
    low = uv_sphere(32, 32)
    low = low.replace(positions=low.positions * peel_radii(low.positions)[:, None])
    return _case("orange", orange, n_triangles, low, 0.06, orange_surface())


def _gyroid(n_triangles: int) -> BenchCase:
    bone = Gyroid.of(n_triangles)
    ball = uv_sphere(32, 30)
    low = ball.replace(positions=ball.positions * bone.radius)
    # A ray into a tunnel that is deeper than this should miss.
    return _case("gyroid", bone.mesh, n_triangles, low, 0.06, ImplicitSurface(bone.value))


# Two balls with the same texture coordinates, which the mirrored halves of each share

_APART = np.array([2.5, 0.0, 0.0])


def _mirrored_uvs(n_triangles: int) -> BenchCase:
    def value(p: FloatArray) -> FloatArray:
        radii = [pm.norm(q, axis=1) - _wavy_radii(q, mirrored=True) for q in (p, p - _APART)]
        return np.asarray(np.minimum(*radii))

    def build(n: int) -> Mesh:
        ball = _sphere_grid(n // 2)
        radii = _wavy_radii(ball.positions, mirrored=True)
        return _twice(ball.replace(positions=ball.positions * radii[:, None]))

    ball = uv_sphere(17, 32)
    assert ball.uvs is not None and ball.uv_faces is not None
    # Those of y > 0, whose vertices at y = 0 are moved there exactly.
    half = ball.positions[ball.faces].mean(axis=1)[:, 1] > 0.0
    faces, uv_faces = ball.faces[half], ball.uv_faces[half]
    points = np.where(np.abs(ball.positions) < 1e-9, 0.0, ball.positions)
    both = _welded(
        np.concatenate([points, points * [1.0, -1.0, 1.0]]),
        np.concatenate([faces, faces[:, ::-1] + len(points)]),
    )
    low = both.replace(
        uvs=ball.uvs * [1.92, 0.96] + 0.02, uv_faces=np.concatenate([uv_faces, uv_faces[:, ::-1]])
    )
    return _case("mirrored-uvs", build, n_triangles, _twice(low), 0.1, ImplicitSurface(value))


def _twice(mesh: Mesh) -> Mesh:
    both = _together(mesh, mesh.replace(positions=mesh.positions + _APART))
    if mesh.uvs is None or mesh.uv_faces is None:
        return both
    return both.replace(uvs=mesh.uvs, uv_faces=np.concatenate([mesh.uv_faces, mesh.uv_faces]))


def _welded(points: FloatArray, faces: IntArray) -> Mesh:
    """Weld vertices at one position, so that normals are smooth across the seam."""
    used, corners = np.unique(weld_rows(points)[faces], return_inverse=True)
    faces = corners.reshape(-1, 3).astype(np.int32)
    return Mesh(positions=points[used], faces=faces, name="welded")


# Open surfaces over a square

_MARGIN = 0.03  # by which a low-poly mesh goes beyond the terrain, so that rays there should miss


def _terrain(n_triangles: int) -> BenchCase:
    def value(p: FloatArray) -> FloatArray:
        x, y, z = p.T
        beyond = np.maximum(np.abs(x - 0.5), np.abs(y - 0.5)) - 0.5
        return np.asarray(np.maximum(z - wave_heights(x, y), beyond))

    low = plane(4, 4)
    low = low.replace(positions=low.positions * (1.0 + 2.0 * _MARGIN) - [_MARGIN, _MARGIN, 0.0])
    return _case("terrain", _waves, n_triangles, low, 0.1, ImplicitSurface(value))


def _waves(n_triangles: int, share: float = 1.0) -> Mesh:
    side = max(round(math.sqrt(n_triangles / 2.0)), 2)
    mesh = plane(side, side, lambda x, y: share * wave_heights(x, y))
    return mesh.replace(uvs=None, uv_faces=None)


# Two plates, one over the other, no thicker than the gap between them

_THICK, _SHARE = 0.02, 0.3  # thickness and gap; of the heights of the waves


def _thin_shells(n_triangles: int) -> BenchCase:
    def value(p: FloatArray) -> FloatArray:
        heights = p[:, 2] - _SHARE * wave_heights(p[:, 0], p[:, 1])
        inside = np.minimum(np.abs(heights), np.abs(heights - 2.0 * _THICK))
        return np.asarray(inside - 0.5 * _THICK)

    def build(n: int) -> Mesh:
        return _sheets([_waves(n // 4, _SHARE)] * 4)

    flat = plane(4, 4)
    assert flat.uvs is not None
    turned = flat.uvs * [-1.0, 1.0] + [1.0, 0.0]  # seen from below
    tiles = [
        flat.replace(uvs=0.46 * uvs + [x, y])
        for x in (0.02, 0.52)
        for y, uvs in ((0.02, turned), (0.52, flat.uvs))
    ]
    # Rays begin inside the other plate, whose far side they should pass through.
    surface = ImplicitSurface(value)
    return _case("thin-shells", build, n_triangles, _sheets(tiles), 1.5 * _THICK, surface)


def _sheets(sheets: list[Mesh]) -> Mesh:
    """Lower and upper sides of both plates."""
    placed = []
    for number, sheet in enumerate(sheets):
        if number % 2 == 0:
            uv_faces = None if sheet.uv_faces is None else sheet.uv_faces[:, ::-1]
            sheet = sheet.replace(faces=sheet.faces[:, ::-1], uv_faces=uv_faces)
        shift = np.array([0.0, 0.0, (number - 0.5) * _THICK])
        placed.append(sheet.replace(positions=sheet.positions + shift))
    return _together(*placed)


def _hard_edges(n_triangles: int) -> BenchCase:
    surface = ImplicitSurface(box_value)
    return _case("hard-edges", beveled_box, n_triangles, cube_with_uvs(), 0.1, surface)


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
    made = _case("two-parts", build, n_triangles, _together(*halves), 0.03, ImplicitSurface(value))
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
    "orange": _orange,
    "gyroid": _gyroid,
    "hard-edges": _hard_edges,
    "terrain": _terrain,
    "thin-shells": _thin_shells,
    "mirrored-uvs": _mirrored_uvs,
    "two-parts": _two_parts,
}


def pair_files(case: BenchCase, folder: Path) -> dict[str, str]:
    """Paths of the high-poly mesh (`high`, binary PLY) and of `low`, an OBJ with uvs."""
    return {
        "high": mesh_file(case.high, folder, f"{case.name}-high"),
        "low": _written(case.low, folder / f"{case.name}-low.obj"),
    }


def mesh_file(mesh: Mesh, folder: Path, name: str) -> str:
    """Return the path of a mesh as binary PLY, without texture coordinates, written once."""
    return _written(mesh.replace(uvs=None, uv_faces=None), folder / f"{name}.ply")


def _written(mesh: Mesh, path: Path) -> str:
    if not path.exists():
        write_mesh(mesh.replace(positions=mesh.positions.astype(np.float32)), path)
    return str(path)


def own_case(high: Mesh, low: Mesh) -> BenchCase:
    """Case of a user's pair, in float32 and without normals, as all programs can read it."""
    high, low = _bare(high), _bare(low)
    low = low_with_uvs(high, low)
    extent = measure_extent(RayScene.build(high, LocalFrame.around(high, low)), low, "smooth")
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
