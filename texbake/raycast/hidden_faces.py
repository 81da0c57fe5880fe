"""Faces of an assembly that nobody sees from outside, found by rays that try to get away.

Rays leave random points of a face on both sides. A face is visible if one of them meets nothing,
and hidden if all of them are blocked, some by another part: what a part hides of itself, such as
the bottom of a deep hole, stays. So do the faces at visible ones, so that no gap opens.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from texbake.mesh.compose import excerpt
from texbake.mesh.distance import unit_normals
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import BoolArray, IntArray, Mesh
from texbake.mesh.objects import weld_vertices
from texbake.mesh.topology import face_components
from texbake.raycast.orientation import cast_from, cosine_directions, points_in
from texbake.raycast.rays import NO_HIT
from texbake.raycast.scene import RayScene

_SEED = 20151103
# Rays from each side of a face, round by round; a visible face needs no further round.
_ROUNDS = (4, 12, 48)
_RAYS_AT_ONCE = 1 << 19


def hidden_faces(mesh: Mesh, is_opaque: BoolArray, *, threads: int | None = None) -> BoolArray:
    """(F,) bool: faces hidden by opaque ones of other parts, in all poses of the mesh."""
    welded = weld_vertices(mesh, threads=threads)[mesh.faces]
    parts, n_parts = face_components(welded, mesh.n_vertices)
    hidden = np.ones(mesh.n_faces, dtype=np.bool_)
    if n_parts < 2 or not is_opaque.any():
        return ~hidden
    poses = () if mesh.deformation is None else tuple(mesh.deformation.poses)
    for positions in (mesh.positions, *poses):
        pose = mesh.replace(positions=positions, deformation=None)
        hidden &= _hidden(pose, is_opaque, parts, hidden, threads)
    is_seen = np.zeros(mesh.n_vertices, dtype=np.bool_)
    is_seen[welded[~hidden]] = True
    return np.asarray(hidden & ~is_seen[welded].any(axis=1))


def _hidden(
    mesh: Mesh, is_opaque: BoolArray, parts: IntArray, asked: BoolArray, threads: int | None
) -> BoolArray:
    """Those of the faces asked for from which no ray gets away, and some meet another part."""
    frame = LocalFrame.around(mesh)
    scene = RayScene.build(excerpt(mesh, is_opaque), frame, compact=True, threads=threads)
    local = mesh.replace(positions=frame.to_local(mesh.positions))
    parts_of_hits = parts[is_opaque]
    waiting, meets_other = asked.copy(), np.zeros(mesh.n_faces, dtype=np.bool_)
    random = np.random.Generator(np.random.PCG64(_SEED))
    for n_rays in _ROUNDS:
        faces = np.flatnonzero(waiting)
        step = _RAYS_AT_ONCE // n_rays
        for first in range(0, len(faces), step):
            of_rays = np.repeat(faces[first : first + step], n_rays)
            hits = _first_hits(local, scene, of_rays, random)
            away = hits == NO_HIT
            waiting[of_rays[away.any(axis=0)]] = False
            others = ~away & (parts_of_hits[hits] != parts[of_rays])
            meets_other[of_rays[others.any(axis=0)]] = True
    return waiting & meets_other


def _first_hits(
    mesh: Mesh, scene: RayScene, faces: npt.NDArray[np.intp], random: np.random.Generator
) -> IntArray:
    """(2, n) int32: face that a ray from each side of each face meets; the mesh is in the frame."""
    origins = points_in(mesh, faces, random)
    normals = unit_normals(mesh.positions, mesh.faces[faces])
    directions = cosine_directions(normals, random)
    sides = (cast_from(scene, origins, s * normals, s * directions) for s in (1.0, -1.0))
    return np.stack([hits.faces for hits in sides])
