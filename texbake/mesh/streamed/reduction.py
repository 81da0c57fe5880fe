"""A mesh that stays in its file, reduced piece by piece to one that is simplified in memory.

Pieces are triangles that follow one another in the file. Each is welded and collapsed by itself.
Its open borders stay as they are, so that all pieces fit together again. What was open only
because the file was cut there is then simplified with the rest.

Surfaces that meet at an edge or in a point can be in different pieces; they may then move apart.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from texbake.core import portable_math as pm
from texbake.mesh.decimate import weld_corners
from texbake.mesh.distance import SurfaceDistance, distance_to
from texbake.mesh.hard_edges import is_flat_shaded
from texbake.mesh.mesh import Mesh
from texbake.mesh.piecewise import reduce_pieces
from texbake.mesh.streamed.mesh import StreamedMesh
from texbake.records import dataclass

# Meshes of more triangles are reduced in pieces, which costs less memory and no more time.
MOST_IN_MEMORY = 1 << 24
AT_ONCE = 1 << 21  # of a piece
_TIMES = 8  # what a piece is reduced by
_LEAST_TIMES = 8  # faces that are left, at least, as a multiple of those requested
_SAMPLES = 100_000  # triangles from which the distance is measured


@dataclass(frozen=True, eq=False)
class ReducedMesh:
    """What is left of a mesh that stays in its file. Made by `ReducedMesh.of`."""

    source: StreamedMesh
    mesh: Mesh

    @classmethod
    def of(cls, source: StreamedMesh, n_faces: int, *, threads: int | None) -> ReducedMesh | None:
        """Reduce a mesh so that it can be simplified to `n_faces`; None if too little would go."""
        share = max(1.0 / _TIMES, _LEAST_TIMES * n_faces / source.n_faces)
        if share > 0.5:
            return None
        # Where each facet has normals of its own, every edge is hard, and would stay.
        is_flat = all(is_flat_shaded(piece, threads=threads) for piece in source.pieces(AT_ONCE))
        reduced = []
        for piece in source.pieces(AT_ONCE):
            if is_flat:
                piece = piece.replace(normals=None, normal_faces=None)
            reduced.append(_reduced(piece, share, threads))
        fields: dict[str, Any] = {}
        starts = np.cumsum([0, *(len(rows["positions"]) for rows in reduced)])
        for name in tuple(reduced[0]):
            rows = [piece.pop(name) for piece in reduced]
            if name == "faces":
                rows = [some + np.int32(start) for some, start in zip(rows, starts, strict=False)]
            fields[name] = np.concatenate(rows)
        if "normals" in fields:
            fields["normal_faces"] = fields["faces"]
        return cls(source, Mesh(**fields, name=source.name))

    @property
    def note(self) -> str:
        """What the user should know of the result."""
        return (
            f"{self.source.name} was read in pieces, which were first reduced to "
            f"{self.mesh.n_faces:,} triangles; the distance from the result is measured to these"
        )

    def distance(self, low: Mesh, *, threads: int | None) -> SurfaceDistance:
        """Measure the distance between the mesh in the file (a) and one made of it (b)."""
        corners = self.source.spread_corners(max(1, self.source.n_faces // _SAMPLES))
        faces = np.arange(len(corners), dtype=np.int32).reshape(-1, 3)
        spread = Mesh(positions=corners, faces=faces)
        bounds = np.stack([self.source.bounds, low.bounds])
        size = bounds[:, 1].max(axis=0) - bounds[:, 0].min(axis=0)
        return SurfaceDistance(
            a_to_b=distance_to(spread, low, threads=threads),
            b_to_a=distance_to(low, self.mesh, threads=threads),
            diagonal=float(pm.norm(size)),
        )


def _reduced(piece: Mesh, share: float, threads: int | None) -> dict[str, Any]:
    """Positions, faces, normals and colors of a piece, with a row of each for every vertex."""
    stream = weld_corners(piece, threads=threads)
    if len(stream.faces):
        n_wanted = int(share * len(stream.faces))
        stream = reduce_pieces(stream, n_wanted, is_cut=True, threads=threads)
    rows = stream.position_ids
    fields = {"positions": piece.positions[rows], "faces": stream.faces}
    if piece.colors is not None:
        fields["colors"] = piece.colors[rows]
    if piece.normals is not None:
        normals = rows if stream.normal_ids is None else stream.normal_ids
        fields["normals"] = piece.normals[normals]
    return fields
