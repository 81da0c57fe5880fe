"""What is wrong with the normals that a mesh is shaded with."""

from __future__ import annotations

import math

import numpy as np

from texbake.checks.finding import Finding, found
from texbake.checks.subject import Subject
from texbake.mapping.adjacency import next_half_edges
from texbake.mesh.mesh import FloatArray, IntArray

# Normals packed into 8 bits a component are off by up to half a degree.
_ROUNDING = math.radians(1.0)


def no_normals(subject: Subject) -> Finding | None:
    """Find out whether the mesh has no normals."""
    return found("no-normals", subject.role, int(subject.mesh.normals is None))


def zero_normals(subject: Subject) -> Finding | None:
    """Find faces with area and a normal of length zero at a corner."""
    mesh = subject.mesh
    if mesh.normals is None:
        return None
    zero = (mesh.normals == 0.0).all(axis=1)
    faces = np.flatnonzero(zero[mesh.normal_faces].any(axis=1) & subject.has_area)
    return found("zero-normals", subject.role, len(faces), faces, subject.areas[faces])


def turned_normals(subject: Subject) -> Finding | None:
    """Find faces with a normal at a corner that points to their back."""
    mesh = subject.mesh
    if mesh.normals is None or mesh.normal_faces is None:
        return None
    cosines = np.full(mesh.n_faces, np.inf)
    for corner in range(3):
        shading = mesh.normals[mesh.normal_faces[:, corner]]
        np.minimum(cosines, np.einsum("ij,ij->i", shading, subject.normals), out=cosines)
    faces = np.flatnonzero(cosines < -math.sin(_ROUNDING))
    return found("turned-normals", subject.role, len(faces), faces, -cosines[faces])


def hard_edges_without_seam(subject: Subject) -> Finding | None:
    """Find edges across which normals jump and texture coordinates do not."""
    mesh, edges = subject.mesh, subject.edges
    if mesh.normals is None or mesh.normal_faces is None or not subject.has_coordinates:
        return None
    one, other = edges.pairs()
    places = subject.places[edges.faces].ravel()
    # The corner of the other face at the same place as the first's, and the one at the far end.
    along = places[one] == places[other]
    ends = next_half_edges(one), next_half_edges(other)
    across = np.where(along, other, ends[1]), np.where(along, ends[1], other)
    uv_ids = subject.uv_ids[edges.faces].ravel()
    normal_ids = mesh.normal_faces[edges.faces].ravel()
    joined = (uv_ids[one] == uv_ids[across[0]]) & (uv_ids[ends[0]] == uv_ids[across[1]])
    jumps = np.maximum(
        _angles(mesh.normals, normal_ids[one], normal_ids[across[0]]),
        _angles(mesh.normals, normal_ids[ends[0]], normal_ids[across[1]]),
    )
    hard = joined & (jumps > _ROUNDING)
    faces = edges.faces[np.concatenate([one[hard], other[hard]]) // 3]
    return found(
        "hard-edges-without-seam", subject.role, hard.sum(), faces, np.tile(jumps[hard], 2)
    )


def _angles(
    normals: FloatArray,
    one: IntArray,
    other: IntArray,
) -> FloatArray:
    """Angle between normals in radians; 0 where one of them has no direction."""
    angles = np.zeros(len(one))
    differ = np.flatnonzero(one != other)
    a, b = normals[one[differ]], normals[other[differ]]
    # 2 asin of half the chord: exact for small angles, where the cosine is not.
    chords = np.linalg.norm(a - b, axis=1) / 2.0
    directed = (a != 0.0).any(axis=1) & (b != 0.0).any(axis=1)
    angles[differ] = np.where(directed, 2.0 * np.arcsin(np.minimum(chords, 1.0)), 0.0)
    return angles


CHECKS = (no_normals, zero_normals, turned_normals)
LIGHT_CHECKS = (hard_edges_without_seam,)
