"""Contrasts in space: normals, thresholds, places far away, and rays between triangles."""

from __future__ import annotations

from typing import Any

import numpy as np
from catalog.contrast import Contrast, degrees_between, not_finite
from catalog.geometry import mesh_of, moved, with_faces
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from texbake import Mesh
from texbake.mesh.frame import LocalFrame
from texbake.mesh.normals import degenerate_faces, face_normals, smooth_normals, vertex_normals
from texbake.mesh.shapes import cube, icosphere
from texbake.mesh.weld import weld_rows
from texbake.raycast.rays import NO_HIT, Rays
from texbake.raycast.scene import RayScene

# A rotation of no special angle, so that no coordinate is 0 by luck.
_TURN = np.linalg.qr(np.random.default_rng(4).normal(size=(3, 3)))[0]


def _face_normals(mesh: Mesh, dtype: type = np.float64) -> Any:
    """Normalized cross products."""
    a, b, c = (mesh.positions.astype(dtype)[mesh.faces[:, i]] for i in range(3))
    cross = np.cross(b - a, c - a)
    return cross / np.sqrt((cross * cross).sum(axis=1, keepdims=True))


def _vertex_normals(mesh: Mesh) -> Any:
    """Sum of the faces' normals at each vertex, normalized."""
    sums = np.zeros((mesh.n_vertices, 3))
    np.add.at(sums, mesh.faces, _face_normals(mesh)[:, None])
    return sums / np.linalg.norm(sums, axis=1, keepdims=True)


def _needles() -> Mesh:
    """Needles of 1 by 1e-8 at all places of a plane that is turned."""
    rng = np.random.default_rng(0)
    tips = np.column_stack([rng.random((4096, 2)), np.zeros(4096)])
    along = np.tile([1.0, 0.0, 0.0], (4096, 1))
    corners = np.stack([tips, tips + along, tips + along + [0.0, 1e-8, 0.0]], axis=1)
    return mesh_of(corners.reshape(-1, 3) @ _TURN.T, np.arange(3 * 4096).reshape(-1, 3))


def _tilt_of_plane(_: Mesh, normals: Any) -> float:
    return float(np.nan_to_num(degrees_between(normals, _TURN @ [0, 0, 1.0]), nan=90.0).max())


def _split() -> Mesh:
    ball = icosphere(3)
    points = ball.positions[ball.faces].reshape(-1, 3)
    return mesh_of(points, np.arange(len(points)).reshape(-1, 3))


def _tear(mesh: Mesh, normals: Any) -> float:
    """Widest gap that opens between vertices of one place when all are moved by 1."""
    return float(np.linalg.norm(normals - normals[weld_rows(mesh.positions)], axis=1).max())


def _with_degenerate() -> Mesh:
    ball = icosphere(3)
    return with_faces(ball, np.column_stack([np.arange(600), np.arange(600), np.arange(600) + 1]))


def _dropped(mesh: Mesh, degenerate: Any) -> float:
    return float(np.count_nonzero(degenerate))


def _tiny_areas(mesh: Mesh) -> Any:
    a, b, c = (mesh.positions[mesh.faces[:, i]] for i in range(3))
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2.0 < 1e-12


def _shape_error(mesh: Mesh, local: Any) -> float:
    """Greatest error of an edge, in sizes of the mesh, against differences in float64."""
    a, b = mesh.faces[:, 0], mesh.faces[:, 1]
    exact = mesh.positions[b] - mesh.positions[a]
    found = local[b].astype(np.float64) - local[a]
    scale = np.abs(found).max() / np.abs(exact).max()
    scale = 2.0 ** np.round(np.log2(scale)) if scale else 1.0
    return float(np.abs(found / scale - exact).max() / 2.0)


def _to_local(mesh: Mesh) -> Any:
    return LocalFrame.around(mesh).to_local(mesh.positions).astype(np.float32)


def _aimed_at_vertices() -> tuple[Mesh, Rays]:
    mesh = icosphere(5)
    targets = LocalFrame.around(mesh).to_local(mesh.positions)
    toward = -targets + 0.1 * np.random.default_rng(3).normal(size=targets.shape)
    toward /= np.linalg.norm(toward, axis=1, keepdims=True)
    n = len(targets)
    return mesh, Rays(targets - 0.2 * toward, toward, np.full(n, 0.4), np.full(n, 0.2))


def _embree(data: tuple[Mesh, Rays]) -> Any:
    mesh, rays = data
    scene = EmbreeScene(robust=True)
    # The scene uses the mesh as long as it lives.
    triangles = TriangleMesh(scene, _to_local(mesh), mesh.faces)
    lines = (rays.origins, rays.directions, rays.lengths)
    hits = scene.run(*(a.astype(np.float32) for a in lines), query="INTERSECT", output=True)
    del triangles
    return hits["primID"].astype(np.int32)


def _in_bundles(data: tuple[Mesh, Rays]) -> Any:
    mesh, rays = data
    return RayScene.build(mesh, LocalFrame.around(mesh)).cast(rays).faces


GEOMETRY_CONTRASTS = (
    Contrast(name="needles of 1 by 1e-8",
             wrong="heights of 1e-8 cancel in float32",
             unit="largest tilt of a normal, in degrees", prepare=_needles,
             naive=lambda mesh: _face_normals(mesh, np.float32), ours=face_normals,
             error=_tilt_of_plane, bound=1e-5,
             why="positions are rounded to 1e-16, 1e-8 of the width"),
    Contrast(name="vertices split at every edge",
             wrong="smooth normals by vertex index differ at one position",
             unit="widest tear, in displacement distances", prepare=_split,
             naive=vertex_normals, ours=smooth_normals, error=_tear, bound=0.0,
             why="one position has one normal, bit for bit"),
    Contrast(name="faces without area",
             wrong="0 / 0 spreads to every vertex of these faces",
             unit="vertex normals that are NaN", prepare=_with_degenerate, naive=_vertex_normals,
             ours=vertex_normals, error=not_finite, bound=0.0, why="exact"),
    Contrast(name="a face and its back",
             wrong="their normals sum to 0, and 0 / 0 is NaN",
             unit="vertex normals that are NaN",
             prepare=lambda: with_faces(cube(), cube().faces[:, ::-1]), naive=_vertex_normals,
             ours=vertex_normals, error=not_finite, bound=0.0, why="exact"),
    Contrast(name="a mesh of size 1e-12",
             wrong="all areas are below an absolute threshold",
             unit="valid faces called degenerate", prepare=lambda: moved(icosphere(4), 1e-12),
             naive=_tiny_areas, ours=degenerate_faces, error=_dropped, bound=0.0, why="exact"),
    Contrast(name="coordinates of 1e200",
             wrong="squares overflow",
             unit="face normals that are NaN",
             prepare=lambda: moved(icosphere(4), 1e200), naive=_face_normals, ours=face_normals,
             error=not_finite, bound=0.0, why="exact"),
    Contrast(name="coordinates of 1e-310",
             wrong="squares are 0",
             unit="face normals that are NaN",
             prepare=lambda: moved(icosphere(4), 1e-310), naive=_face_normals, ours=face_normals,
             error=not_finite, bound=0.0, why="exact"),
    Contrast(name="1e7 sizes from the origin",
             wrong="float32 has a single step for the whole mesh",
             unit="largest error of an edge, in sizes",
             prepare=lambda: moved(icosphere(4), 1.0, (1e7, -1e7, 1e7)),
             naive=lambda mesh: mesh.positions.astype(np.float32), ours=_to_local,
             error=_shape_error, bound=2e-7, why="half a float32 step at either end"),
    Contrast(name="10,242 rays at vertices",
             wrong="each triangle leaves the hit to its neighbors",
             unit="rays that pass through a closed mesh", prepare=_aimed_at_vertices, naive=_embree,
             ours=_in_bundles,
             error=lambda _, faces: float(np.count_nonzero(faces == NO_HIT)), bound=0.0,
             why="exact"),
)  # fmt: skip
