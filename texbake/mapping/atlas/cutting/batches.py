"""Which faces of a mesh xatlas cuts together: a part of a large piece, or several small pieces."""

from __future__ import annotations

import numpy as np

from texbake.mapping.adjacency import merged_labels
from texbake.mapping.atlas.cutting.parts import Part, divided_parts, split_parts
from texbake.mesh.mesh import FloatArray, IntArray


def connected_parts(opposite: IntArray) -> IntArray:
    """(F,) int32: number of the connected piece that each face is in, by first faces."""
    half_edges = np.flatnonzero(opposite > np.arange(len(opposite))).astype(np.int32)
    return merged_labels(len(opposite) // 3, half_edges // 3, opposite[half_edges] // 3)


def face_batches(
    points: FloatArray,
    corners: IntArray,
    part: Part,
    *,
    part_faces: int,
    regions: IntArray,
) -> list[IntArray]:
    """Spread some faces of a mesh over batches.

    Parameters
    ----------
    points : (V, 3) float64
        On the grid, in the unit cube.
    corners : (F, 3) int32
        Of the faces of the mesh: indices into `points`.
    part : Part
        The faces, which need not be connected.
    part_faces : int
        Faces that a batch should have; a connected piece of half as many more is not divided.
    regions : (F,) int32
        Faces of different regions are in different batches.

    Returns
    -------
    list of (n,) int32
        Faces of each batch, ascending.
    """
    pieces = connected_parts(part.opposite)
    labels = divided_parts(
        points,
        corners[part.face_ids],
        part.opposite,
        pieces,
        part_faces=part_faces,
        whole_faces=part_faces + part_faces // 2,
    )
    batches = _batched(labels, pieces, regions[part.face_ids], part_faces)
    return [part.face_ids[batch.face_ids] for batch in split_parts(part.opposite, batches)]


def _batched(parts: IntArray, pieces: IntArray, regions: IntArray, batch_faces: int) -> IntArray:
    """(F,) int32: batch of each face. A part of a divided piece is one; the others share them.

    Pieces that share a batch do not touch along edges of two faces, so nothing is joined again.
    """
    sizes = np.bincount(parts)
    first = np.unique(parts, return_index=True)[1]
    piece_of, region_of = pieces[first], regions[first]
    divided = np.bincount(piece_of)[piece_of] > 1
    # A new batch begins where the faces so far fill another.
    order = np.argsort(region_of, kind="stable")
    shared = np.where(divided, 0, sizes)[order]
    numbers = np.empty(len(sizes), dtype=np.int64)
    numbers[order] = (np.cumsum(shared) - shared) // batch_faces
    numbers[divided] = len(parts) + np.flatnonzero(divided)
    keys = region_of.astype(np.int64) << 32 | numbers
    batches: IntArray = np.unique(keys, return_inverse=True)[1].astype(np.int32)
    return batches[parts]
