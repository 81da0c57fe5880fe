"""A tree of boxes over triangles in the order of a Morton curve, for rays in bundles.

This takes half the time of building a tree for single rays. A compact tree, for single rays, sorts
the triangles once more. Kernel: `core/morton_tree.c`.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
import numpy.typing as npt

from texbake.core import core
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import Float32Array, FloatArray, Int64Array, IntArray, Mesh
from texbake.mesh.streamed.mesh import Chunk
from texbake.mesh.weld import without_copies
from texbake.parallel import run_bands
from texbake.records import dataclass

WIDTH = 8  # triangles of a leaf, and boxes of a node
_CELLS = 1024  # of the curve, along the longest side of the box
_DIGIT_BITS = 10
_FACES_PER_BAND = 1 << 18
_SMALL = 1 << 18  # leaves whose corners take up to 151 MB
_FACES_OF_LARGE_NODE = 1 << 12
_LEAVES_PER_BAND = 1 << 13  # a multiple of WIDTH: a node is written by one band


@dataclass(frozen=True, eq=False)
class MortonTree:
    """Triangles in leaves of `WIDTH`, and boxes around them, in local coordinates."""

    # Positions in model units, faces, number of the first face, center and scale of the frame.
    mesh: tuple[FloatArray, IntArray, int, FloatArray, float]
    ids: IntArray  # (L, WIDTH) int32; faces of the mesh; -1 where there is none
    # (N, 6, WIDTH) float32; boxes of the children of each node: least x, y, z, then greatest. The
    # lowest level first, the root last.
    nodes: Float32Array
    starts: Int64Array  # (levels,) int64; first node of each level
    box: FloatArray  # (6,) float64; of all triangles: least x, y, z, then greatest
    # Whether its leaves are filled; otherwise rays load corners from the mesh, which in a large
    # tree takes less time than filling the leaves, and much less memory.
    has_leaves: bool
    threads: int | None

    @classmethod
    def build(
        cls,
        mesh: Mesh | Chunk,
        frame: LocalFrame,
        faces: range | None = None,
        *,
        compact: bool = False,
        threads: int | None,
    ) -> MortonTree:
        """Build the tree over some faces, or all for None, one of those with equal corners.

        Triangles of a chunk keep their ids. A compact tree serves rays in unrelated directions.
        """
        faces = range(len(mesh.faces)) if faces is None else faces
        places = _sorted_places(mesh, faces, threads)
        if isinstance(mesh, Mesh):
            face_ids, codes = places.view(np.uint32).reshape(-1, 2).T  # on little-endian machines
            kept = without_copies(mesh.positions, mesh.faces, face_ids, codes)
            if not kept.all():
                places = places[kept]
        if compact:
            _sort_into_nodes(places, mesh, frame, threads)
        n_leaves = -(-len(places) // WIDTH)
        sizes = [-(-n_leaves // WIDTH)]
        while sizes[-1] > 1:
            sizes.append(-(-sizes[-1] // WIDTH))
        starts = np.cumsum([0, *sizes], dtype=np.int64)
        ids = np.empty((n_leaves, WIDTH), dtype=np.int32)
        nodes = np.empty((int(starts[-1]), 6, WIDTH), dtype=np.float32)

        def bound(start: int, stop: int) -> None:
            core.bound_leaves(
                places[start * WIDTH : stop * WIDTH],
                mesh.positions,
                mesh.faces,
                frame.center,
                frame.scale,
                ids[start:stop],
                nodes[start // WIDTH : -(-stop // WIDTH)],
            )

        run_bands(bound, n_leaves, band=_LEAVES_PER_BAND, threads=threads)
        for below, start, end in zip(starts, starts[1:-1], starts[2:], strict=False):
            core.join_boxes(nodes[below:start], nodes[start:end])
        first = mesh.first if isinstance(mesh, Chunk) else 0
        if first:
            np.add(ids, np.int32(first), out=ids, where=ids >= 0)
        root = nodes[-1].astype(np.float64)
        box = np.concatenate([root[:3].min(axis=1), root[3:].max(axis=1)])
        of_mesh = (mesh.positions, mesh.faces, first, frame.center, frame.scale)
        has_leaves = compact or n_leaves <= _SMALL
        tree = cls(of_mesh, ids, nodes, starts[:-1], box, has_leaves, threads)
        _ = has_leaves and tree.leaves  # filled before threads ask for them
        return tree

    @cached_property
    def leaves(self) -> FloatArray:
        """(L, 9, WIDTH) local x, y, z of first corners, then of second and third ones."""
        leaves = np.empty((len(self.ids), 9, WIDTH))

        def fill(start: int, stop: int) -> None:
            core.fill_leaves(self.ids[start:stop], *self.mesh, leaves[start:stop])

        run_bands(fill, len(leaves), band=_LEAVES_PER_BAND, threads=self.threads)
        return leaves


def _sorted_places(mesh: Mesh | Chunk, faces: range, threads: int | None) -> npt.NDArray[np.uint64]:
    """Faces in the order of the curve, each in the lower half of a number."""
    low, high = mesh.bounds
    size = float((high - low).max())
    cells_per_unit = _CELLS / size if 0.0 < size < np.inf else 0.0
    places = np.empty(len(faces), dtype=np.uint64)

    def place(start: int, stop: int) -> None:
        chosen = mesh.faces[faces.start + start : faces.start + stop]
        core.place_on_curve(
            mesh.positions, chosen, faces.start + start, low, cells_per_unit, places[start:stop]
        )

    run_bands(place, len(faces), band=_FACES_PER_BAND, threads=threads)
    other = np.empty_like(places)
    for digit in range(3):
        shift = 32 + digit * _DIGIT_BITS
        source, target = (places, other) if digit % 2 == 0 else (other, places)

        _sort_by_digit(source, target, shift, threads)
    return other


def _sort_into_nodes(
    places: npt.NDArray[np.uint64], mesh: Mesh | Chunk, frame: LocalFrame, threads: int | None
) -> None:
    """Sort the faces in place so that those below each node are close together."""
    middles = np.empty((len(places), 3), dtype=np.float32)

    def find(start: int, stop: int) -> None:
        some, center, scale = places[start:stop], frame.center, frame.scale
        core.find_middles(some, mesh.positions, mesh.faces, center, scale, middles[start:stop])

    run_bands(find, len(places), band=_FACES_PER_BAND, threads=threads)
    unit = WIDTH
    while WIDTH * unit < len(places):
        unit *= WIDTH
    while unit >= WIDTH:
        # Large nodes are sorted one level at a time, so that all threads have some.
        least = unit if unit > _FACES_OF_LARGE_NODE else WIDTH

        def sort(start: int, stop: int, unit: int = unit, least: int = least) -> None:
            core.sort_into_nodes(middles[start:stop], places[start:stop], unit, least)

        run_bands(sort, len(places), band=WIDTH * unit, threads=threads)
        unit = least // WIDTH


def _sort_by_digit(
    source: npt.NDArray[np.uint64], target: npt.NDArray[np.uint64], shift: int, threads: int | None
) -> None:
    """Sort numbers by the digit from bit `shift` on; equal digits keep their order."""
    n_bands = -(-len(source) // _FACES_PER_BAND)
    counts = np.empty((n_bands, 1 << _DIGIT_BITS), dtype=np.int64)

    def count(start: int, stop: int) -> None:
        core.count_digits(source[start:stop], shift, counts[start // _FACES_PER_BAND])

    def move(start: int, stop: int) -> None:
        core.move_by_digits(source[start:stop], shift, firsts[start // _FACES_PER_BAND], target)

    run_bands(count, len(source), band=_FACES_PER_BAND, threads=threads)
    ends = np.cumsum(counts.T.reshape(-1)).reshape(counts.T.shape).T
    firsts = np.ascontiguousarray(ends - counts)
    run_bands(move, len(source), band=_FACES_PER_BAND, threads=threads)
