"""Meshes made by code: a plane, a cube, spheres, and the dimpled orange of the demo.

All wind counter-clockwise seen from outside and come out the same on every run. The polar axis of
`grid_sphere` and `uv_sphere` is z, as mathematics has it; `orange` stands on the world's +Y.

Based on: Christopher J. Kitrick, "Geodesic domes", Structural Topology 11, 1985 (points spaced
evenly in angle over a spherical triangle).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from texbake.core import portable_math as pm
from texbake.errors import OptionError
from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.mesh.parametric.grid import grid_quads, ids_around, split_quads
from texbake.mesh.parametric.options import MAX_TRIANGLES
from texbake.mesh.peel import peel_radii

# Levels of an icosphere with no more triangles than that.
_MOST_LEVELS = 9

Field = Callable[[FloatArray, FloatArray], Any]


def plane(n_x: int = 1, n_y: int = 1, height_at: Field | None = None) -> Mesh:
    """Grid over the unit square, facing +z, with texture coordinates (s, t) = (x, y)."""
    _check_count("n_x", n_x, 1)
    _check_count("n_y", n_y, 1)
    x, y = np.meshgrid(np.arange(n_x + 1) / n_x, np.arange(n_y + 1) / n_y)
    z = _evaluated(height_at, x, y, 0.0)
    faces = split_quads(grid_quads(n_y, n_x)[:, [0, 3, 2, 1]])
    return Mesh(
        positions=np.stack([x, y, z], axis=-1).reshape(-1, 3),
        faces=faces,
        uvs=np.stack([x, y], axis=-1).reshape(-1, 2),
        uv_faces=faces,
        name="plane",
    )


def cube() -> Mesh:
    """Cube of side 1 about the origin: 8 vertices, 12 triangles, no texture coordinates."""
    corners = [[x, y, z] for z in (-0.5, 0.5) for y in (-0.5, 0.5) for x in (-0.5, 0.5)]
    quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
    return Mesh(positions=np.array(corners), faces=split_quads(np.array(quads)), name="cube")


def grid_sphere(
    n_theta: int, n_phi: int, radius_at: Field | None = None, *, pole_margin: float = 0.001
) -> Mesh:
    """Sphere as a grid of polar angle and azimuth, open by a small ring at either pole.

    Vertex `row * n_phi + column` lies at z = r cos θ, x = r sin θ cos φ, y = r sin θ sin φ.

    `pole_margin`: radians between either pole and its ring of open edges.
    """
    _check_count("n_theta", n_theta, 2)
    _check_count("n_phi", n_phi, 3)
    if not 0.0 < pole_margin < np.pi / 2.0:
        raise OptionError(f"pole_margin: {pole_margin} is out of range; give one between 0 and π/2")
    theta = np.linspace(pole_margin, np.pi - pole_margin, n_theta)
    phi = np.linspace(0.0, 2.0 * np.pi, n_phi, endpoint=False)
    faces = ids_around(n_theta, n_phi)[split_quads(grid_quads(n_theta - 1, n_phi))]
    positions = _from_spherical(theta, phi, radius_at)
    return Mesh(positions=positions, faces=faces, name="grid sphere")


def uv_sphere(n_lat: int = 32, n_lon: int = 64, radius_at: Field | None = None) -> Mesh:
    """Closed sphere of latitude bands with a vertex at either pole and texture coordinates.

    u is φ / 2π, 1 on the far side of the seam, and v is 1 - θ / π. Each triangle at a pole has a
    texture coordinate of its own there, midway between the u of its other two corners.
    """
    _check_count("n_lat", n_lat, 2)
    _check_count("n_lon", n_lon, 3)
    n_rows = n_lat - 1  # rings of vertices between the poles
    theta = np.linspace(0.0, np.pi, n_lat + 1)[1:-1]
    phi = np.linspace(0.0, 2.0 * np.pi, n_lon, endpoint=False)
    poles = _from_spherical(np.array([0.0, np.pi]), np.zeros(1), radius_at)
    poles[:, :2] = 0.0  # sin π is not 0 in floating point

    # Everything is laid out in texture space, cut open along the seam, then joined in space.
    u, v = np.meshgrid(np.arange(n_lon + 1) / n_lon, 1.0 - np.arange(1, n_lat) / n_lat)
    u_middle = (np.arange(n_lon) + 0.5) / n_lon
    north, south = (np.stack([u_middle, np.full(n_lon, end)], axis=-1) for end in (1.0, 0.0))
    uvs = np.concatenate([np.stack([u, v], axis=-1).reshape(-1, 2), north, south])
    column = np.arange(n_lon)
    n_inner, last_row = n_rows * (n_lon + 1), (n_rows - 1) * (n_lon + 1)
    north_fan = np.stack([n_inner + column, column, column + 1], axis=-1)
    south_fan = np.stack([n_inner + n_lon + column, last_row + column + 1, last_row + column], -1)
    bands = split_quads(grid_quads(n_rows - 1, n_lon))
    uv_faces = np.concatenate([north_fan, bands, south_fan])
    pole_ids = n_rows * n_lon + np.repeat([0, 1], n_lon)
    position_of_uv = np.concatenate([ids_around(n_rows, n_lon), pole_ids])
    return Mesh(
        positions=np.concatenate([_from_spherical(theta, phi, radius_at), poles]),
        faces=position_of_uv[uv_faces],
        uvs=uvs,
        uv_faces=uv_faces,
        name="uv sphere",
    )


def icosphere(level: int = 3) -> Mesh:
    """Unit sphere of 20 · 4^level nearly equal triangles, from an icosahedron; no seam, no uvs."""
    _check_count("level", level, 0, most=_MOST_LEVELS)
    directions, faces = _geodesic_sphere(2**level)
    return Mesh(positions=directions, faces=faces, name="icosphere")


def orange(n_triangles: int = 1_000_000) -> Mesh:
    """Make an orange: flattened, uneven, with a stem end, a navel and thousands of pores.

    Its radius is a smooth closed-form function of the direction, `peel_radii`, so that a finer
    orange is a better picture of the same surface.
    """
    _check_count("n_triangles", n_triangles, 20, most=MAX_TRIANGLES)
    directions, faces = _geodesic_sphere(round(math.sqrt(n_triangles / 20.0)))
    directions *= peel_radii(directions)[:, None]
    return Mesh(positions=directions, faces=faces, name="orange")


def _check_count(what: str, count: int, least: int, *, most: int | None = None) -> None:
    if count < least:
        raise OptionError(f"{what}: {count} is too few; it must be at least {least}")
    if most is not None and count > most:
        raise OptionError(f"{what}: {count:,} is too many; it must be at most {most:,}")


def _evaluated(field: Field | None, a: FloatArray, b: FloatArray, default: float) -> FloatArray:
    values = default if field is None else field(a, b)
    return np.broadcast_to(
        np.asarray(values, dtype=np.float64), np.broadcast_shapes(a.shape, b.shape)
    )


def _from_spherical(theta: FloatArray, phi: FloatArray, radius_at: Field | None) -> FloatArray:
    """(T · P, 3): points of every θ with every φ, row by row."""
    theta, phi = theta[:, None], phi[None, :]
    r = _evaluated(radius_at, theta, phi, 1.0)
    r_flat = r * pm.sin(theta)
    x, y, z = r_flat * pm.cos(phi), r_flat * pm.sin(phi), r * pm.cos(theta)
    return np.stack([x, y, z], axis=-1).reshape(-1, 3)


def _geodesic_sphere(frequency: int) -> tuple[FloatArray, IntArray]:
    """Icosahedron with each edge cut into `frequency` parts, projected onto the unit sphere.

    Vertices come in the order corners, insides of edges, insides of faces, each computed once, so
    that neighboring faces share them.

    Returns `directions` (10 f² + 2, 3) float64; `faces` (20 f², 3) int32.
    """
    corners, corner_faces = _icosahedron()
    sides = np.sort(corner_faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges, side_edges = np.unique(sides, axis=0, return_inverse=True)
    f = frequency
    # Lattice points of a face by their distance, in steps, from the side opposite each corner.
    i, j = np.nonzero(np.tri(f + 1, dtype=bool)[::-1])
    steps = np.stack([f - i - j, i, j])
    inside = (steps > 0).all(axis=0)
    along = np.stack([np.arange(f - 1, 0, -1), np.arange(1, f)])
    angle = pm.arctan(2.0) / f  # arctan 2 lies between neighboring corners
    directions = np.concatenate(
        [
            corners,
            pm.matmul(pm.sin(angle * along).T, corners[edges]).reshape(-1, 3),
            pm.matmul(pm.sin(angle * steps[:, inside]).T, corners[corner_faces]).reshape(-1, 3),
        ]
    )
    directions /= np.sqrt(pm.vecdot(directions, directions))[:, None]

    ids = np.empty((20, len(i)), dtype=np.int32)
    first_inside = 12 + 30 * (f - 1)
    ids[:, inside] = np.arange(first_inside, len(directions)).reshape(20, -1)
    for face, (row, face_corners) in enumerate(zip(ids, corner_faces, strict=True)):
        for side, (a, b) in enumerate(((0, 1), (1, 2), (2, 0))):
            on_side = steps[3 - a - b] == 0
            towards = a if face_corners[a] > face_corners[b] else b
            first = 12 + side_edges[3 * face + side] * (f - 1) - 1
            row[on_side] = first + steps[towards, on_side]
        for corner in range(3):
            row[steps[corner] == f] = face_corners[corner]
    return directions, ids[:, _lattice_triangles(f)].reshape(-1, 3)


def _lattice_triangles(f: int) -> IntArray:
    """(f², 3): triangles of the lattice points i + j <= f, numbered with j fastest."""
    i, j = np.nonzero(np.tri(f, dtype=bool)[::-1])
    here = i * (f + 1) - i * (i - 1) // 2 + j
    below = here + (f + 1) - i
    up = np.stack([here, below, here + 1], axis=-1)
    has_down = i + j < f - 1
    down = np.stack([below, below + 1, here + 1], axis=-1)[has_down]
    return np.concatenate([up, down]).astype(np.int32)


def _icosahedron() -> tuple[FloatArray, IntArray]:
    g = (1.0 + math.sqrt(5.0)) / 2.0
    cyclic = [(0.0, s, t * g) for s in (-1.0, 1.0) for t in (-1.0, 1.0)]
    corners = np.array([np.roll(p, shift) for shift in range(3) for p in cyclic])
    # Faces are the triples of corners that lie 2, the length of an edge, apart.
    near = np.isclose(pm.norm(corners[:, None] - corners[None, :], axis=2), 2.0)
    triples = [
        (a, b, c)
        for a in range(12)
        for b in range(a + 1, 12)
        for c in range(b + 1, 12)
        if near[a, b] and near[b, c] and near[c, a]
    ]
    faces = np.array(triples, dtype=np.int32)
    inward = pm.det(corners[faces]) < 0.0
    faces[inward] = faces[inward][:, ::-1]
    return corners / pm.norm(corners[0]), faces
