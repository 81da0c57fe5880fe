"""Meshes that are hard in texture space: coordinates, and the tangents that follow from them."""

from functools import cache

import numpy as np
from catalog.case import Case
from catalog.geometry import mesh_of

from texbake import Mesh
from texbake.mesh.shapes import icosphere, plane, uv_sphere

UVS = frozenset({"uvs"})
TOO_FAR = "tiles from the origin, so areas in the texture cannot be computed"
NOTHING_COVERED = {
    "bake": "cover nothing: all of them have no area",
    "distortion": "none of its faces has an area both in space and in the texture",
}


def with_uvs(mesh, uvs, uv_faces=None):
    """Mesh with other coordinates, by position unless corners are given."""
    corners = mesh.faces if uv_faces is None else np.array(uv_faces, np.int32)
    return mesh.replace(uvs=np.array(uvs, float), uv_faces=corners)


def beside(mesh, *triangles):
    """A square over the middle of the texture, and more faces with coordinates as given."""
    extra = np.array(triangles, float).reshape(-1, 2)
    points = np.column_stack([extra * 0.0, np.zeros(len(extra))])
    points[0::3] = (2, 0, 0)
    points[1::3] = (3, 0, 0)
    points[2::3] = (2, 1, 0)
    points[:, 2] += np.repeat(np.arange(len(extra) // 3), 3)
    ids = np.arange(len(extra)).reshape(-1, 3)
    return mesh_of(
        np.concatenate([mesh.positions, points]),
        np.concatenate([mesh.faces, ids + mesh.n_vertices]),
        uvs=np.concatenate([mesh.uvs, extra]),
        uv_faces=np.concatenate([mesh.uv_faces, ids + len(mesh.uvs)]).astype(np.int32),
    )


def _inner(low=0.25, high=0.75):
    square = plane(2, 2)
    return with_uvs(square, low + (high - low) * square.uvs)


def _half_texels():
    """Corners exactly at centers of texels of a 16 x 16 map, on both sides of every edge."""
    square = plane(3, 3)
    return with_uvs(square, (2.5 + 4.0 * square.uvs * 3.0) / 16.0)


def _mirrored_halves():
    """Both halves of a strip on the same half of the texture; the middle vertices are shared."""
    strip = plane(4, 1)
    return with_uvs(strip, np.column_stack([np.abs(strip.uvs[:, 0] - 0.5), strip.uvs[:, 1]]))


def _opposing():
    """Two faces whose u runs towards the common edge from both sides, corners welded."""
    return mesh_of(
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [2, 0, 0]],
        [[0, 1, 2], [1, 3, 2]],
        uvs=[[0.0, 0.0], [0.5, 0.0], [0.5, 0.5], [0.0, 0.0]],
        uv_faces=np.array([[0, 1, 2], [1, 3, 2]], np.int32),
    )


def _straddling():
    """A sphere whose coordinates are by vertex, so that one column runs back over the texture."""
    ball = uv_sphere(4, 8)
    theta = np.arctan2(ball.positions[:, 1], ball.positions[:, 0]) / (2.0 * np.pi) + 0.5
    height = np.arccos(np.clip(ball.positions[:, 2], -1.0, 1.0)) / np.pi
    return with_uvs(ball, np.column_stack([theta, 1.0 - height]))


def _pole_in_a_face():
    """A sphere turned so that its poles lie within faces, with coordinates by vertex."""
    ball = icosphere(1)
    middle = ball.positions[ball.faces[0]].mean(axis=0)
    axes = np.linalg.qr(np.column_stack([middle, [1.0, 0, 0], [0, 1.0, 0]]))[0][:, [1, 2, 0]]
    points = ball.positions @ axes
    longitude = np.arctan2(points[:, 1], points[:, 0]) / (2.0 * np.pi) + 0.5
    latitude = np.arcsin(np.clip(points[:, 2], -1.0, 1.0)) / np.pi + 0.5
    return with_uvs(mesh_of(points, ball.faces), np.column_stack([longitude, latitude]))


@cache
def in_cells(case):
    """Mesh of a case, with its own coordinates or one cell for each face, without any unwrap."""
    mesh = case.make()
    if mesh.uvs is not None:
        return mesh
    n = int(np.ceil(np.sqrt(mesh.n_faces)))
    cells = np.arange(mesh.n_faces)
    origins = np.column_stack([cells % n, cells // n]).astype(float)
    corners = (origins[:, None] + [[0.15, 0.15], [0.85, 0.15], [0.15, 0.85]]) / n
    return mesh.replace(
        uvs=corners.reshape(-1, 2), uv_faces=np.arange(3 * mesh.n_faces).reshape(-1, 3)
    )


TINY_SIDES = (1e-3, 1e-6, 1e-9, 1e-12)

TEXTURE_SPACE: tuple[Case[Mesh], ...] = (
    Case(name="zero-area coordinates", wrong="the inverse of the texture matrix is 1 / 0",
         make=lambda: beside(_inner(), [0.1, 0.1], [0.1, 0.1], [0.1, 0.1]), traits=UVS),
    Case(name="coordinates of area down to 1e-24",
         wrong="a threshold on the determinant drops small faces", traits=UVS,
         make=lambda: beside(_inner(), *[
             corner for side in TINY_SIDES
             for corner in ([0.1, 0.1], [0.1 + side, 0.1], [0.1, 0.1 + side])])),
    Case(name="needle thinner than a texel",
         wrong="it covers no texel center, and rounding decides what it owns", traits=UVS,
         make=lambda: beside(_inner(), [0.02, 0.1], [0.98, 0.1004], [0.98, 0.1008])),
    Case(name="corners on centers of texels",
         wrong="shared corners are owned by no face or by all of them",
         make=_half_texels, traits=UVS),
    Case(name="coordinates of exactly 0 and 1", wrong="1 is the column after the last one",
         make=lambda: plane(3, 2), traits=UVS),
    Case(name="mirrored coordinates", wrong="the area is negative, and no texel is covered",
         make=lambda: with_uvs(plane(2, 2), plane(2, 2).uvs * [-1.0, 1.0] + [1.0, 0.0]),
         traits=UVS),
    Case(name="mirrored halves sharing vertices", wrong="the tangents of both sides sum to 0",
         make=_mirrored_halves, traits=UVS),
    Case(name="coordinates three deep", wrong="the face that is written last owns the texel",
         traits=UVS, make=lambda: mesh_of(
             np.concatenate([plane().positions + np.array([0.0, 0.0, i]) for i in range(3)]),
             np.concatenate([plane().faces + 4 * i for i in range(3)]),
             uvs=np.tile(plane().uvs, (3, 1)),
             uv_faces=np.concatenate([plane().faces + 4 * i for i in range(3)]))),
    Case(name="coordinates outside the tile", wrong="the bake writes past the rows of the map",
         make=lambda: with_uvs(plane(4, 4), plane(4, 4).uvs * 3.0 - 1.0), traits=UVS),
    Case(name="coordinates of 1e9", wrong="they overflow the integers of the coverage grid",
         make=lambda: beside(_inner(), [1e9, 0.0], [1e9 + 1.0, 0.0], [1e9, 1.0]), traits=UVS),
    Case(name="face over the ±π seam", wrong="its coordinates run backwards over the whole texture",
         make=_straddling, traits=UVS),
    Case(name="face that holds a pole",
         wrong="its corners lie around the pole, but its coordinates lie beside it",
         make=_pole_in_a_face, traits=UVS),
    Case(name="coordinates of 1e200", wrong="their squares overflow, and areas are NaN",
         make=lambda: with_uvs(plane(2, 2), plane(2, 2).uvs * 1e200 - 1e200),
         refused={"bake": "lies in the unit square", "glb": "beyond float32",
                  "distortion": TOO_FAR, "layout": TOO_FAR,
                  "parametric": "tiles from the origin"}, traits=UVS),
    Case(name="coordinates on a line", wrong="their determinant is 0, or pure rounding",
         make=lambda: with_uvs(plane(2, 2), plane(2, 2).uvs[:, :1] * [1.0, 0.3]),
         refused=NOTHING_COVERED, traits=UVS),
    Case(name="u constant", wrong="the derivative along u is 0, and so is the tangent",
         make=lambda: with_uvs(plane(2, 2), plane(2, 2).uvs * [0.0, 1.0]),
         refused=NOTHING_COVERED, traits=UVS),
    Case(name="all coordinates equal", wrong="no texel is covered, and the bake computes 0 / 0",
         make=lambda: with_uvs(plane(2, 2), plane(2, 2).uvs * 0.0 + 0.5),
         refused=NOTHING_COVERED, traits=UVS),
    Case(name="opposing neighbors", wrong="the tangents at a shared corner cancel to NaN",
         make=_opposing, traits=UVS),
    Case(name="chart smaller than a texel", wrong="the bake silently writes an empty map",
         make=lambda: with_uvs(plane(2, 2), 0.5 + 1e-4 * plane(2, 2).uvs),
         refused={"bake": "smaller than any texel"}, traits=UVS),
)  # fmt: skip
