"""Meshes made by code: a plane, a cube, spheres, and the dimpled orange of the demo.

All wind counter-clockwise seen from outside and come out the same on every run. The polar axis of
`grid_sphere` and `uv_sphere` is z, as mathematics has it; `orange` stands on the world's +Y.

The orange is a flattened sphere with a few long waves, dented at the stem and at the navel, with
pores on a Fibonacci lattice, each moved a little by a hash of its number.

Based on: Christopher J. Kitrick, "Geodesic domes", Structural Topology 11, 1985 (points spaced
evenly in angle over a spherical triangle); Álvaro González, "Measurement of areas on a sphere using
Fibonacci and latitude-longitude lattices", Mathematical Geosciences 42, 2010; Guy L. Steele et al.,
"Fast splittable pseudorandom number generators", OOPSLA 2014 (the hash). Kernel:
`core/orange_pores.c`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from texbake.core import core, portable_math as pm
from texbake.errors import OptionError
from texbake.mesh.mesh import FloatArray, Int64Array, IntArray, Mesh
from texbake.mesh.parametric.grid import grid_quads, ids_around, split_quads
from texbake.mesh.parametric.options import MAX_TRIANGLES
from texbake.parallel import run_bands

# Levels of an icosphere with no more triangles than that.
_MOST_LEVELS = 9

Field = Callable[[FloatArray, FloatArray], Any]


def plane(n_x: int = 1, n_y: int = 1, height_at: Field | None = None) -> Mesh:
    """Grid over the unit square, facing +z, with texture coordinates (s, t) = (x, y)."""
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
    """Sphere about z as a grid of angles, row by row, open by `pole_margin` radians at poles."""
    theta = np.linspace(pole_margin, np.pi - pole_margin, n_theta)
    phi = np.linspace(0.0, 2.0 * np.pi, n_phi, endpoint=False)
    faces = ids_around(n_theta, n_phi)[split_quads(grid_quads(n_theta - 1, n_phi))]
    return Mesh(positions=_from_spherical(theta, phi, radius_at), faces=faces, name="grid sphere")


def uv_sphere(n_lat: int = 32, n_lon: int = 64, radius_at: Field | None = None) -> Mesh:
    """Closed sphere of latitude bands with a vertex at either pole; u = φ / 2π, v = 1 - θ / π."""
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
    uv_faces = np.concatenate([north_fan, split_quads(grid_quads(n_rows - 1, n_lon)), south_fan])
    pole_ids = n_rows * n_lon + np.repeat([0, 1], n_lon)
    return Mesh(
        positions=np.concatenate([_from_spherical(theta, phi, radius_at), poles]),
        faces=np.concatenate([ids_around(n_rows, n_lon), pole_ids])[uv_faces],
        uvs=uvs,
        uv_faces=uv_faces,
        name="uv sphere",
    )


def icosphere(level: int = 3) -> Mesh:
    """Unit sphere of 20 · 4^level nearly equal triangles, from an icosahedron; no seam, no uvs."""
    _check_count("level", level, 0, _MOST_LEVELS)
    directions, faces = _geodesic_sphere(2**level)
    return Mesh(positions=directions, faces=faces, name="icosphere")


def orange(n_triangles: int = 1_000_000) -> Mesh:
    """An orange: flattened, uneven, with a stem end, a navel and thousands of pores."""
    _check_count("n_triangles", n_triangles, 20, MAX_TRIANGLES)
    directions, faces = _geodesic_sphere(round(math.sqrt(n_triangles / 20.0)))
    directions *= peel_radii(directions)[:, None]
    return Mesh(positions=directions, faces=faces, name="orange")


def _check_count(what: str, count: int, least: int, most: int) -> None:
    if count < least:
        raise OptionError(f"{what}: {count} is too few; it must be at least {least}")
    if count > most:
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
    """Icosphere, f parts per edge: directions (10 f² + 2, 3), each once, faces (20 f², 3)."""
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


_N_CELLS = 48  # a side of the grid that finds the pores near a direction; see `_pores`
_FLATTENING = 0.93  # height over width
_N_PORES = 8000
_PORE_RADIUS = 0.6  # of the greatest pore, in units of the lattice spacing
_PORE_DEPTH = 0.0065  # of the deepest, in units of the orange's radius
# Wave vector, phase and height of each wave of the unevenness.
_WAVES = (
    ((1.7, 0.6, -1.1), 0.3, 0.012),
    ((-0.9, 2.3, 1.4), 1.9, 0.008),
    ((3.1, -1.2, 2.6), 4.0, 0.005),
    ((-4.3, 3.7, 1.9), 2.2, 0.003),
    ((5.9, 6.1, -5.2), 5.1, 0.0015),
)


def peel_radii(directions: FloatArray) -> FloatArray:
    """(n,) distances from an orange's center along unit vectors (n, 3), stem up on +Y."""
    directions = np.ascontiguousarray(directions, dtype=np.float64)
    pores, radii, depths = _pores(), np.empty(len(directions)), np.empty(len(directions))

    def work(start: int, stop: int) -> None:
        part = directions[start:stop]
        core.pore_depths(part, *pores, depths[start:stop])
        radii[start:stop] = _fruit_radii(part) * (1.0 - depths[start:stop])

    run_bands(work, len(directions), band=65536)
    return radii


def _fruit_radii(directions: FloatArray) -> FloatArray:
    """Radius without the pores."""
    x, y, z = directions.T
    flattened = 1.0 / np.sqrt(x * x + z * z + (y / _FLATTENING) ** 2)
    uneven = sum(
        height * pm.sin(pm.matmul(directions, np.array(wave)) + phase)
        for wave, phase, height in _WAVES
    )
    # Squared distance from the axis; beyond the equator the other end's terms vanish.
    s = x * x + z * z
    top, bottom = (pm.exp(-np.clip(1.0 - sign * y, 0.0, None) / 0.035) for sign in (1.0, -1.0))
    # Re (x + iz)^5 and the like: ribs around the stem that are smooth at the pole itself.
    ribs = (x**5 - 10.0 * x**3 * z**2 + 5.0 * x * z**4) / pm.power(s + 1e-3, 2.5)
    stem = -0.085 * top * (1.0 + 0.22 * ribs * (1.0 - pm.exp(-s / 0.01)))
    button = 0.03 / (1.0 + pm.exp((s - 0.0045) / 0.0009)) * (y > 0.0)
    navel = -0.03 * pm.exp(-np.clip(1.0 + y, 0.0, None) / 0.006) - 0.012 * bottom
    return np.asarray(flattened * (1.0 + uneven + stem + button + navel))


@cache
def _pores() -> tuple[Any, ...]:
    """Centers, radii and depths of pores, cells per side, and pores by cell, with starts."""
    i = np.arange(_N_PORES)
    spacing = np.sqrt(4.0 * np.pi / _N_PORES)
    jitter = (0.7 * spacing) * (np.stack([_hashed(i, stream) for stream in range(3)], 1) - 0.5)
    golden_angle = np.pi * (3.0 - math.sqrt(5.0))
    y = 1.0 - (2.0 * i + 1.0) / _N_PORES
    ring = np.sqrt(1.0 - y * y)
    centers = np.stack([ring * pm.cos(golden_angle * i), y, ring * pm.sin(golden_angle * i)], 1)
    centers += jitter
    centers /= pm.norm(centers, axis=1, keepdims=True)
    size = 0.55 + 0.45 * _hashed(i, 3)
    radii = (_PORE_RADIUS * spacing) * size
    depths = _PORE_DEPTH * size * (0.5 + 0.5 * _hashed(i, 4))

    low, high = (_cells(centers + sign * radii[:, None]) for sign in (-1.0, 1.0))
    cells, pores = [], []
    for step in np.ndindex(2, 2, 2):  # no pore is wider than a cell
        reached = low + np.array(step)
        within = (reached <= high).all(axis=1)
        cells.append((reached[within] * [_N_CELLS**2, _N_CELLS, 1]).sum(axis=1))
        pores.append(i[within])
    cell_of = np.concatenate(cells)
    order = np.lexsort([np.concatenate(pores), cell_of])
    starts = np.searchsorted(cell_of[order], np.arange(_N_CELLS**3 + 1))
    return centers, radii, depths, _N_CELLS, starts, np.concatenate(pores)[order]


def _cells(points: FloatArray) -> Int64Array:
    cells = np.floor((points + 1.0) * (0.5 * _N_CELLS)).astype(np.int64)
    return np.clip(cells, 0, _N_CELLS - 1)


def _hashed(numbers: Int64Array, stream: int) -> FloatArray:
    """Evenly spread values in [0, 1), one per number, unrelated between streams (SplitMix64)."""
    z = (numbers.astype(np.uint64) * np.uint64(8) + np.uint64(stream + 1)) * np.uint64(
        0x9E3779B97F4A7C15
    )
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return np.asarray(((z ^ (z >> np.uint64(31))) >> np.uint64(11)) * 2.0**-53, dtype=np.float64)
