"""Separate parts of a wrap: solid ones, and the walls of cavities in them, which face inwards."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.mesh.mesh import FloatArray, IntArray
from texbake.mesh.remeshing.winding import winding_numbers
from texbake.mesh.topology import face_components


@dataclass(frozen=True, eq=False)
class Parts:
    """Separate parts of a closed surface.

    Attributes
    ----------
    ids : (F,) int32
        Part of each face.
    volumes : (n,) float64
        In units of a voxel, negative for the walls of cavities.
    """

    ids: IntArray
    volumes: FloatArray

    @classmethod
    def of(cls, points: FloatArray, faces: IntArray) -> Parts:
        """Find the parts."""
        ids, n_parts = face_components(faces, len(points))
        a, b, c = (points[faces[:, corner]] for corner in range(3))
        sixths = np.einsum("ij,ij->i", a, np.cross(b, c))
        return cls(ids, np.bincount(ids, sixths, n_parts) / 6.0)

    @property
    def is_wall(self) -> npt.NDArray[np.bool_]:
        """Which of the parts are walls of cavities."""
        return self.volumes < 0.0


def largest_parts(
    points: FloatArray, faces: IntArray, n_kept: int | None, *, threads: int | None = None
) -> tuple[FloatArray, IntArray, int]:
    """Keep the solid parts of most volume, with their cavities; also count the others.

    Parameters
    ----------
    points : (V, 3) float64
        In units of a voxel.
    faces : (F, 3) int32
    n_kept
        Number of solid parts to keep; None for all.
    threads
        None for every processor.
    """
    if n_kept is None:
        return points, faces, 0
    parts = Parts.of(points, faces)
    n_solid = int(np.count_nonzero(~parts.is_wall))
    if n_solid <= n_kept:
        return points, faces, 0
    order = np.argsort(-parts.volumes, kind="stable")  # walls come last
    kept = np.zeros(len(order), dtype=np.bool_)
    kept[order[:n_kept]] = True
    walls = np.flatnonzero(parts.is_wall)
    kept[walls] = kept[_owners(points, faces, parts, walls, order[:n_solid], threads)]
    used, compact = np.unique(faces[kept[parts.ids]], return_inverse=True)
    return points[used], compact.reshape(-1, 3).astype(np.int32), n_solid - n_kept


def _owners(
    points: FloatArray,
    faces: IntArray,
    parts: Parts,
    walls: npt.NDArray[np.intp],
    solids: npt.NDArray[np.intp],
    threads: int | None,
) -> npt.NDArray[np.intp]:
    """The solid part that each wall is in: the smallest around it. Solids are the largest first."""
    owners = np.full(len(walls), solids[0])
    if len(walls) == 0:
        return owners
    firsts = np.unique(parts.ids, return_index=True)[1]
    places = points[faces[firsts[walls], 0]]
    for solid in solids[1:]:
        part = faces[parts.ids == solid]
        low, high = points[part].min(axis=(0, 1)), points[part].max(axis=(0, 1))
        near = np.flatnonzero(((places > low) & (places < high)).all(axis=1))
        windings = winding_numbers(points, part, places[near], threads=threads)
        owners[near[windings > 0.5]] = solid
    return owners
