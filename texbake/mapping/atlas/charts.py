"""A mesh flattened in pieces: what is cut, mended, relaxed, joined and packed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.mesh.compose import offset_joined
from texbake.mesh.mesh import FloatArray, IntArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Charts:
    """A mesh flattened in pieces, each laid out for itself about its own origin.

    Attributes
    ----------
    uvs : (T, 2) float64
        Coordinates, in the unit of the points: a chart has the area that its faces have in space.
    faces : (F, 3) int32
        Indices into `uvs`; the three are equal in a face that lies in no chart.
    chart_ids : (T,) int32
        Chart of each coordinate; charts are numbered from 0 without gaps.
    n_ignored : int
        Faces that lie in no chart, because they have no area on the grid, or next to none.
    n_mirrored : int
        Charts that came out mirrored and were turned over.
    n_split : int
        Charts that were made by taking apart those that lay on themselves.
    notes : tuple of str
        What a report should say: steps that failed and what was done instead, charts that miss a
        bound and why.
    """

    uvs: FloatArray
    faces: IntArray
    chart_ids: IntArray
    n_ignored: int
    n_mirrored: int
    n_split: int
    notes: tuple[str, ...] = ()

    @property
    def n_charts(self) -> int:
        """Number of charts."""
        return int(self.chart_ids.max()) + 1

    @property
    def solid(self) -> npt.NDArray[np.bool_]:
        """(F,) bool: faces that lie in a chart."""
        return np.asarray((self.faces != self.faces[:, :1]).any(axis=1))


def gathered_charts(
    mesh_faces: IntArray, pieces: Sequence[tuple[IntArray, Charts]], notes: tuple[str, ...] = ()
) -> Charts:
    """Put the charts of parts of a mesh together.

    Parameters
    ----------
    mesh_faces : (F, 3) int32
        Vertices of the faces of the whole mesh.
    pieces : sequence of ((n,) int32, Charts)
        Faces of the mesh, and their charts; at least one. What is in none lies in no chart.
    notes : tuple of str
        What to tell of the whole; those of the pieces come after.
    """
    faces = np.zeros_like(mesh_faces)
    face_ids = np.concatenate([face_ids for face_ids, _ in pieces])
    faces[face_ids] = offset_joined([(charts.faces, len(charts.uvs)) for _, charts in pieces])
    solid = np.flatnonzero((faces != faces[:, :1]).any(axis=1))
    return Charts(
        uvs=np.concatenate([charts.uvs for _, charts in pieces]),
        faces=_with_anchors(mesh_faces, solid, faces[solid]),
        chart_ids=offset_joined([(charts.chart_ids, charts.n_charts) for _, charts in pieces]),
        n_ignored=len(mesh_faces) - len(solid),
        n_mirrored=sum(charts.n_mirrored for _, charts in pieces),
        n_split=sum(charts.n_split for _, charts in pieces),
        notes=notes + tuple(note for _, charts in pieces for note in charts.notes),
    )


def _with_anchors(
    mesh_faces: IntArray, solid: npt.NDArray[np.integer], faces: npt.NDArray[np.integer]
) -> IntArray:
    """(F, 3) int32: `faces` for the solid ones; one coordinate for the corners of each other.

    It is one that a solid face has at one of its vertices, where there is one.
    """
    none = np.iinfo(np.int32).max
    at_vertex = np.full(int(mesh_faces.max()) + 1, none, dtype=np.int64)
    np.minimum.at(at_vertex, mesh_faces[solid].ravel(), faces.ravel())
    anchors = at_vertex[mesh_faces].min(axis=1)
    all_faces = np.repeat(np.where(anchors < none, anchors, 0)[:, None], 3, axis=1)
    all_faces[solid] = faces
    return all_faces.astype(np.int32)
