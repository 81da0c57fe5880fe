"""Models that many tests share: generated ones with the problems of real meshes, and real ones.

The real models are files in the folder that TEXBAKE_DATA names. If it is missing, tests run only on
the generated models.
"""

import os
import warnings
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from skimage.measure import marching_cubes

from texbake import Mesh, read_mesh
from texbake.mesh.shapes import icosphere
from texbake.mesh.topology import find_edges, genus

CASES = Path(__file__).with_name("cases")
REAL = Path(os.environ.get("TEXBAKE_DATA", Path(__file__).parents[2] / "shared" / "data")).resolve()
HAS_REAL = (REAL / "INDEX.md").is_file()


def real(*names):
    """Parameters of the real meshes with these names, if the folder exists."""
    return [pytest.param(name, marks=pytest.mark.realdata) for name in names if HAS_REAL]


def joined(*meshes):
    starts = np.cumsum([0, *(mesh.n_vertices for mesh in meshes)])
    return Mesh(
        positions=np.concatenate([mesh.positions for mesh in meshes]),
        faces=np.concatenate([m.faces + s for m, s in zip(meshes, starts, strict=False)]),
    )


def moved(mesh, *, scale=1.0, by=(0.0, 0.0, 0.0)):
    return mesh.replace(positions=mesh.positions * scale + np.asarray(by))


def flipped(mesh):
    return mesh.replace(faces=mesh.faces[:, ::-1])


def soup_of(mesh):
    """The mesh with separate vertices for each face, as in an STL file."""
    corners = np.arange(mesh.faces.size).reshape(-1, 3)
    return Mesh(positions=mesh.positions[mesh.faces].reshape(-1, 3), faces=corners)


def handles(mesh):
    """The genus of a closed mesh."""
    found = genus(mesh.faces, find_edges(mesh.faces), mesh.n_vertices)
    assert found is not None
    return found


def creature(n, bump=0.0):
    """A figure of genus 1, whose tail is a ring, from a field of n cells per side."""
    ticks = np.linspace(-1.0, 1.0, n + 1)
    points = np.stack(np.meshgrid(ticks, ticks, ticks, indexing="ij"), axis=-1)
    x, y, z = np.moveaxis(points, -1, 0)
    ring = np.sqrt((x + 0.72) ** 2 + (y - 0.1) ** 2) - 0.17
    parts = [np.sqrt(ring * ring + z * z) - 0.07]
    for start, end, radius in [
        ((-0.35, 0.0, 0.0), (0.35, 0.05, 0.0), 0.27),  # body, neck, head
        ((0.4, 0.1, 0.0), (0.6, 0.3, 0.0), 0.13),
        ((0.62, 0.35, 0.0), (0.75, 0.3, 0.0), 0.17),
        *(((0.6, 0.5, 0.1 * k), (0.55, 0.72, 0.2 * k), 0.06) for k in (-1, 1)),
        *(((0.4 * i, -0.1, 0.16 * k), (0.5 * i, -0.75, 0.22 * k), 0.09)
          for i in (-1, 1) for k in (-1, 1)),
    ]:  # fmt: skip
        along = np.subtract(end, start)
        share = ((points - start) * along).sum(axis=-1) / (along * along).sum()
        nearest = start + np.clip(share, 0.0, 1.0)[..., None] * along
        parts.append(np.sqrt(((points - nearest) ** 2).sum(axis=-1)) - radius)
    field = parts[0]
    for part in parts[1:]:
        near = np.maximum(0.1 - np.abs(field - part), 0.0)
        field = np.minimum(field, part) - near * near / 0.4
    field = field + bump * np.sin(25.0 * x) * np.sin(25.0 * y) * np.sin(25.0 * z)
    mesh = level_surface(field, 0.0, spacing=2.0 / n)
    return mesh.replace(positions=mesh.positions - 1.0)


def level_surface(field, level, *, spacing=1.0):
    """The surface where a field has a value, by marching cubes."""
    with warnings.catch_warnings():
        # scikit-image 0.26 sets the shape of arrays, which NumPy 2.5 warns of.
        warnings.simplefilter("ignore", DeprecationWarning)
        positions, faces, _, _ = marching_cubes(field, level, spacing=(spacing,) * 3)
    return Mesh(positions=positions, faces=faces)


def evened(mesh, n_rounds):
    """The mesh with each vertex moved to the middle of its neighbors, which removes slivers."""
    start, end = mesh.faces.ravel(), np.roll(mesh.faces, -1, axis=1).ravel()
    positions, degrees = mesh.positions, np.bincount(start)[:, None]
    for _ in range(n_rounds):
        sums = [np.bincount(start, positions[end, axis]) for axis in range(3)]
        positions = np.stack(sums, axis=1) / degrees
    return mesh.replace(positions=positions)


def scan():
    """The figure as from a scanner: rough, with holes, and with specks around it."""
    random = np.random.default_rng(1)
    mesh = evened(creature(64), 4)
    rough = mesh.positions + 0.003 * random.normal(size=mesh.positions.shape)
    centers = rough[mesh.faces].mean(axis=1)
    holes = centers[random.choice(len(centers), 5)]
    away = np.sqrt(((centers[:, None] - holes) ** 2).sum(axis=2)).min(axis=1)
    specks = [moved(icosphere(0), scale=0.01, by=random.uniform(-1, 1, 3)) for _ in range(4)]
    return joined(mesh.replace(positions=rough, faces=mesh.faces[away > 0.08]), *specks)


def of_cells(solid):
    """Surface of the solid cells of a grid, not manifold where cells touch only along an edge."""
    solid = np.pad(solid.astype(int), 1)
    shape = np.add(solid.shape, 1)
    ids = np.arange(shape.prod()).reshape(shape)
    faces = []
    for axis in range(3):
        order = (axis, (axis + 1) % 3, (axis + 2) % 3)
        step = np.diff(solid.transpose(order), axis=0)
        corner = ids.transpose(order)[1:-1]
        around = corner[:, :-1, :-1], corner[:, 1:, :-1], corner[:, 1:, 1:], corner[:, :-1, 1:]
        quads = np.stack(around, axis=-1)
        quads = np.concatenate([quads[step < 0], quads[step > 0][:, ::-1]])
        faces += [quads[:, :3], quads[:, [0, 2, 3]]]
    used, faces = np.unique(np.concatenate(faces), return_inverse=True)
    positions = np.stack(np.unravel_index(used, shape), axis=1)
    return Mesh(positions=positions - 1.0, faces=faces.reshape(-1, 3))


def sponge(level):
    """Menger's sponge: closed, of genus 5, 81 or 1,409."""
    keep = (np.indices((3, 3, 3)) == 1).sum(axis=0) < 2
    solid = np.ones((1, 1, 1), int)
    for _ in range(level):
        solid = np.kron(solid, keep)
    return of_cells(solid)


def bone(n=64):
    """Half of a shell around struts and pores, closed, of a genus of about a hundred."""
    x, y, z = np.indices((n, n, n)) * 2.0 / (n - 1) - 1.0
    a, b, c = 16.0 * x, 16.0 * y, 16.0 * z
    gyroid = np.sin(a) * np.cos(b) + np.sin(b) * np.cos(c) + np.sin(c) * np.cos(a)
    depth = 0.95 - np.sqrt(4.0 * x * x + 4.0 * y * y + 0.9 * z * z)
    shell = np.where(z > 0.0, 0.15 - depth, -1.0)
    solid = np.minimum(9.0 * depth, np.maximum(0.6 - np.abs(gyroid), 4.0 * shell))
    return level_surface(np.pad(solid, 2, constant_values=-9.0), 0.0).replace(name="bone.ply")


def bracket(n_x=4, n_y=3, n=32):
    """A plate with round holes as CAD programs write it: long thin triangles, none joined."""
    angles = (np.arange(n) + 0.5) / n * 2.0 * np.pi
    rim = 0.5 + 0.35 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    cell = np.concatenate([rim, [[1, 1], [0, 1], [0, 0], [1, 0]]])
    first, after = np.arange(n), np.roll(np.arange(n), -1)
    corner = n + first * 4 // n
    turns = corner != corner[after]
    top = np.concatenate([
        np.stack([first, corner, after], axis=1),
        np.stack([corner, corner[after], after], axis=1)[turns],
    ])  # fmt: skip
    places = np.stack(np.meshgrid(np.arange(n_x), np.arange(n_y)), axis=-1).reshape(-1, 1, 2)
    cells = (cell + places).round(12)
    points, ids = np.unique(cells.reshape(-1, 2), axis=0, return_inverse=True)
    top = ids.reshape(len(cells), -1)[:, top].reshape(-1, 3)
    start, end, below = top.ravel(), np.roll(top, -1, axis=1).ravel(), len(points)
    is_rim = ~np.isin(start * below + end, end * below + start)
    a, b = start[is_rim], end[is_rim]
    walls = [np.stack([b, a, a + below], axis=1), np.stack([b, a + below, b + below], axis=1)]
    heights = np.repeat([0.3, 0.0], below)[:, None]
    positions = np.concatenate([np.tile(points, (2, 1)), heights], axis=1)
    faces = np.concatenate([top, top[:, ::-1] + below, *walls])
    return soup_of(Mesh(positions=positions, faces=faces))


def fused():
    """Cells that touch along edges and at corners, with duplicate faces and faces without area."""
    mesh = of_cells(np.random.default_rng(2).random((6, 6, 6)) < 0.4)
    flat = mesh.faces[:5, [0, 1, 1]]
    return mesh.replace(faces=np.concatenate([mesh.faces, mesh.faces[:9], flat]))


def inverted():
    """The figure with a third of its faces wound the other way."""
    mesh = creature(32)
    is_turned = np.random.default_rng(3).random((mesh.n_faces, 1)) < 1 / 3
    return mesh.replace(faces=np.where(is_turned, mesh.faces[:, ::-1], mesh.faces))


def organs():
    """Parts that intersect and contain one another, cracked and torn; one of them is hollow."""
    ball = icosphere(3)
    tube = flipped(moved(creature(24), scale=0.4, by=(0.9, 0.0, 0.0)))
    torn = soup_of(ball).replace(faces=soup_of(ball).faces[40:])
    nudged = torn.positions + 1e-6 * np.random.default_rng(4).normal(size=torn.positions.shape)
    return joined(
        ball, flipped(moved(ball, scale=0.5)), tube, moved(fused(), scale=0.1, by=(-1.2, 0.6, 0)),
        moved(torn.replace(positions=nudged), scale=0.3, by=(0.0, 0.9, 0.0)),
    )  # fmt: skip


MADE = {
    "figure": lambda: creature(24), "bumpy figure": lambda: creature(96, 0.012),
    "figure with coordinates": lambda: read_mesh(CASES / "figure_low.obj"), "scan": scan,
    "sponge": lambda: sponge(2), "bracket": bracket, "fused cells": fused,
    "inverted figure": inverted,
    "crossing figures": lambda: joined(creature(24), moved(creature(24), by=(0.1, 0.13, 0.17))),
    "organs": organs,
}  # fmt: skip
BROKEN = ("fused cells", "inverted figure", "crossing figures", "organs")


@cache
def model(name):
    """A mesh by its name in `MADE`, or by its path in the folder of real meshes."""
    return MADE[name]() if name in MADE else read_mesh(REAL / name)


# Names of the high-poly and low-poly mesh, the normal map, the ray distance of Blender's bake of
# it, and the number of texels where that bake hit a back face, so that the normal points inward.
PAIRS = {
    "figure": ("bumpy figure", "figure with coordinates", CASES / "figure_normal.png", 0.06, 0)
}
for _name, _distance, _n_behind in (
    ("koala", 0.2258574, 0), ("skull", 0.4077253, 377), ("spot", 0.0532155, 0),
    ("penguin", 0.0740113, 36_524),
) if HAS_REAL else ():  # fmt: skip
    _map = REAL / "blender" / f"{_name}_normal_1024.png"
    _meshes = (f"pairs/{_name}/{side}.obj" for side in ("high", "low_uv"))
    PAIRS[_name] = (*_meshes, _map, _distance, _n_behind)


def pair(name):
    high, low, *_ = PAIRS[name]
    return model(high), model(low)
