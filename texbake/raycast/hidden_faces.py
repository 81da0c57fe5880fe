"""Parts and surfaces that nobody sees from outside, found by rays that try to get away.

Rays leave random points of the faces of a part on both sides. The part is visible if one of them
meets nothing, and hidden if all of them are blocked, some by another part. A part is hidden as a
whole or not at all, so that no gap opens in what is seen. Surfaces of visible parts count by the
share of the rays that get away, so that simplifying leaves more triangles to what is seen.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from texbake.mesh.compose import excerpt
from texbake.mesh.distance import face_areas, unit_normals
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import BoolArray, FloatArray, IndexArray, Int64Array, IntArray, Mesh
from texbake.mesh.objects import weld_vertices
from texbake.mesh.topology import face_components
from texbake.raycast.openness import openness
from texbake.raycast.orientation import cast_from, cosine_directions, points_allowed, points_in
from texbake.raycast.rays import NO_HIT
from texbake.raycast.scene import RayScene

_SEED = 20151103
# Rays from each side of a face, round by round, and from all faces together by their area; a part
# that is seen needs no further round.
_ROUNDS = ((4, 1 << 14), (12, 1 << 16), (48, 1 << 18))
_RAYS_AT_ONCE = 1 << 19
_MOST_POINTS = 32.0  # times the points that finding the outside of a mesh allows

# Openness from which a surface counts in full, and the least that any counts. All count alike where
# less than this share of the area is less open than this.
_SEEN, _LEAST = 0.2, 0.02
_FEW, _HARDLY = 0.1, 0.02


def hidden_faces(
    mesh: Mesh, is_opaque: BoolArray, is_one_sided: BoolArray, *, threads: int | None = None
) -> BoolArray:
    """(F,) bool: faces of the parts that opaque faces of other parts hide.

    Inverted parts of `is_one_sided` faces hide nothing; beyond a bound of work, parts are visible.
    """
    welded = weld_vertices(mesh, threads=threads)[mesh.faces]
    parts, n_parts = face_components(welded, mesh.n_vertices)
    frame = LocalFrame.around(mesh)
    local = mesh.replace(positions=frame.to_local(mesh.positions))
    is_wall = _walls(local, parts, n_parts, is_opaque, is_one_sided)
    is_seen, meets_other = np.zeros((2, n_parts), dtype=np.bool_)
    if n_parts < 2 or not is_wall.any():
        return np.zeros(mesh.n_faces, dtype=np.bool_)
    scene = RayScene.build(excerpt(mesh, is_wall), frame, compact=True, threads=threads)
    areas = face_areas(local.positions, local.faces, threads=threads)
    shares = areas / max(math.fsum(areas), 1e-300)
    left = _MOST_POINTS * points_allowed(local)
    random = np.random.Generator(np.random.PCG64(_SEED))
    for n_rays, n_by_area in _ROUNDS:
        faces = np.flatnonzero(~is_seen[parts])
        counts = n_rays + (n_by_area * shares[faces]).astype(np.int64)
        left -= int(counts.sum())
        if left < 0.0:
            is_seen[:] = True
            break
        for of_rays in _in_chunks(faces, counts):
            hits = _first_hits(local, scene, of_rays, random)
            away = hits == NO_HIT
            is_seen[parts[of_rays[away.any(axis=0)]]] = True
            others = ~away & (parts[is_wall][hits] != parts[of_rays])
            meets_other[parts[of_rays[others.any(axis=0)]]] = True
    return np.asarray((meets_other & ~is_seen)[parts])


def visible_shares(
    mesh: Mesh, is_opaque: BoolArray, is_one_sided: BoolArray, *, threads: int | None = None
) -> FloatArray | None:
    """(V,) how much vertices count that opaque faces hide more or less, from `_LEAST` to 1.

    None where hardly anything is hidden, so that all count alike.
    """
    places = weld_vertices(mesh, threads=threads)
    faces = places[mesh.faces]
    mesh = mesh.replace(positions=LocalFrame.around(mesh).to_local(mesh.positions))
    parts, n_parts = face_components(faces, mesh.n_vertices)
    walls = faces[_walls(mesh, parts, n_parts, is_opaque, is_one_sided)]
    if not len(walls):
        return None
    seen = openness(mesh.positions, faces, walls=walls, threads=threads)
    areas = face_areas(mesh.positions, faces, threads=threads)
    hidden = math.fsum(areas[seen[faces].max(axis=1) < _HARDLY])
    if not hidden > _FEW * math.fsum(areas):
        return None
    return np.clip(seen[places] / _SEEN, _LEAST, 1.0)


def _walls(
    mesh: Mesh, parts: IntArray, n_parts: int, is_opaque: BoolArray, is_one_sided: BoolArray
) -> BoolArray:
    """(F,) bool: faces that hide what is behind them."""
    return is_opaque & ~(is_one_sided & _is_turned(mesh, parts, n_parts)[parts])


def _is_turned(mesh: Mesh, parts: IntArray, n_parts: int) -> BoolArray:
    """(n_parts,) bool: whether most of a part's faces look toward its middle."""
    corners = mesh.positions[mesh.faces]
    weights = np.maximum(face_areas(mesh.positions, mesh.faces), np.finfo(np.float64).tiny)
    middle = np.zeros((n_parts, 3))
    for axis, values in enumerate(corners.mean(axis=1).T):
        middle[:, axis] = np.bincount(parts, weights * values, minlength=n_parts)
    middle /= np.bincount(parts, weights, minlength=n_parts)[:, None]
    a, b, c = (corners[:, i] - middle[parts] for i in range(3))
    return np.bincount(parts, (a * np.cross(b, c)).sum(axis=1), minlength=n_parts) < 0.0


def _in_chunks(faces: IndexArray, counts: Int64Array) -> Iterator[IndexArray]:
    """Yield the face of each ray, some at a time."""
    chunks = np.cumsum(counts) // _RAYS_AT_ONCE
    for part in np.split(np.arange(len(faces)), np.flatnonzero(np.diff(chunks)) + 1):
        yield np.repeat(faces[part], counts[part])


def _first_hits(
    mesh: Mesh, scene: RayScene, faces: IndexArray, random: np.random.Generator
) -> IntArray:
    """(2, n) int32: face that a ray from each side of each face meets; the mesh is in the frame."""
    origins = points_in(mesh, faces, random)
    normals = unit_normals(mesh.positions, mesh.faces[faces])
    directions = cosine_directions(normals, random)
    sides = (cast_from(scene, origins, s * normals, s * directions) for s in (1.0, -1.0))
    return np.stack([hits.faces for hits in sides])
