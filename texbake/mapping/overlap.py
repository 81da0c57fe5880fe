"""Faces that overlap in texture space, and islands that lie on one another on purpose.

Pairs of faces to compare come from a tree of bounding boxes. One overlap is enough to mark a face,
so that a stack of thousands costs no more than a stack of two. The number of comparisons is
bounded; faces that were not compared with all others are reported.

Mirrored halves, and parts that repeat, are often given the same texels. Such stacked islands have
the same corners and outline in the texture, but for whole tiles, and about the same shape in space.
An island is a chart, or one side of a chart that is folded at a line of symmetry. Islands that
overlap in any other way are not stacked, nor are faces that each fill the whole texture.

Kernel: `core/planar_overlap.c`.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from texbake.core import core, portable_math as pm
from texbake.errors import OptionError, counted, quoted
from texbake.mapping.corner_uvs import signed_areas
from texbake.mapping.seams import chart_ids, merged_labels
from texbake.mesh.frame import unit_scale
from texbake.mesh.mesh import BoolArray, FloatArray, IndexArray, Int64Array, IntArray, Mesh
from texbake.mesh.tangents import shading_tangents
from texbake.mesh.weld import weld_rows
from texbake.parallel import run_bands
from texbake.records import dataclass

# Overlaps up to this depth, as a share of the texture, are rounding: of float32, or of the six
# decimals of many files; ...
_DEPTH = 1e-6

# ... or up to this share of the greatest coordinate: 4 units in the last place of a float32.
_RELATIVE_DEPTH = 2.0**-22

_BAND = 4096  # faces tested by one thread at a time

# Comparisons in all, and at least for each face, before a face is left undecided. Up to 16,000
# faces that is never the case; an ordinary mesh takes about 12 comparisons per face.
_MOST_PAIRS = 1 << 28
_LEAST_PAIRS_OF_A_FACE = 512


@dataclass(frozen=True, kw_only=True, eq=False)
class Overlaps:
    """Which faces overlap another."""

    overlapping: BoolArray  # (F,) bool
    # (F,) bool; faces without a known overlap that were compared with only some of the faces near
    # them, because there are thousands of those.
    unsure: BoolArray


class _Packed(NamedTuple):
    """Lines of the faces, thick faces in order, and boxes around them, as the kernels take them."""

    lines: FloatArray
    order: Int64Array
    boxes: FloatArray
    children: Int64Array


def find_overlaps(corners: FloatArray, *, threads: int | None = None) -> Overlaps:
    """Find faces of corners (F, 3, 2) that overlap others by more than 1e-6 of the texture.

    >>> square = np.array([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]], dtype=float)
    >>> find_overlaps(square - [[[0, 0]], [[0, 0.1]]]).overlapping
    array([ True,  True])
    """
    overlapping, unsure = np.zeros((2, len(corners)), dtype=np.bool_)
    farthest = float(np.abs(corners).max(initial=0.0))
    # A power of two, so that squares of any coordinate are finite and no bit is lost.
    scale = min(unit_scale(farthest), 1.0)
    depth = max(_DEPTH, _RELATIVE_DEPTH * farthest) * scale
    corners = _along_their_edges(corners * scale)
    packed = _packed(corners, None, depth)
    places = np.arange(len(packed.order))
    most = max(_LEAST_PAIRS_OF_A_FACE, _MOST_PAIRS // max(len(places), 1))

    def look(start: int, stop: int) -> None:
        core.find_planar_overlaps(
            corners, *packed, depth, most, places[start:stop], overlapping, unsure, None,
        )  # fmt: skip

    run_bands(look, len(places), band=_BAND, threads=threads)
    return Overlaps(overlapping=overlapping, unsure=unsure)


def layout_notes(level: Mesh, finest: Mesh, *, threads: int | None = None) -> list[str]:
    """Sentence if faces of a simplified mesh overlap or are mirrored, unlike its source."""
    if level.uvs is None or finest.uvs is None:
        return []
    n_folded = _n_folded(level, threads)
    if not n_folded or _n_folded(finest, threads):
        return []
    return [
        f"{n_folded:,} of {counted(level.n_faces, 'triangle')} overlap others or are mirrored in "
        "the texture; request more triangles"
    ]


def _n_folded(mesh: Mesh, threads: int | None) -> int:
    """Count the faces that overlap another in the texture, or are clockwise in it."""
    assert mesh.uvs is not None and mesh.uv_faces is not None
    corners = mesh.uvs[mesh.uv_faces]
    (a, b), (c, d) = (corners[:, 1:] - corners[:, :1]).transpose(1, 2, 0)
    heights = (a * d - b * c) / np.maximum(pm.hypot(a, b), pm.hypot(c, d)).clip(_DEPTH)
    found = find_overlaps(corners, threads=threads)
    return int((found.overlapping | (heights < -_DEPTH)).sum())


def overlap_layers(corners: FloatArray, charts: IntArray, *, depth: float) -> IntArray:
    """(F,) lowest layer in which a face overlaps no earlier one of its chart by `depth`."""
    corners = _along_their_edges(corners)
    charts = np.ascontiguousarray(charts, dtype=np.int32)
    layers = np.zeros(len(corners), dtype=np.int32)
    packed = _packed(corners, charts, depth)
    places = np.argsort(packed.order, kind="stable")  # in the order of faces, for the layers
    found, unsure = np.zeros((2, len(corners)), dtype=np.bool_)
    core.find_planar_overlaps(
        corners, *packed, depth, len(corners), places, found, unsure, layers,
    )  # fmt: skip
    return layers


def _along_their_edges(corners: FloatArray) -> FloatArray:
    """Corners rotated so that long edges lie along an axis, which makes their boxes tight."""
    edges = np.roll(corners, -1, axis=1) - corners
    lengths = (edges**2).sum(axis=2)
    # Squared as complex numbers, edges of opposite directions are equal.
    x, y = np.take_along_axis(edges, lengths.argmax(axis=1)[:, None, None], axis=1)[:, 0].T
    angle = -pm.arctan2(float((2.0 * x * y).sum()), float((x * x - y * y).sum())) / 2.0
    cos, sin = pm.cos(angle), pm.sin(angle)
    s, t = corners[..., 0], corners[..., 1]
    return np.ascontiguousarray(np.stack([cos * s - sin * t, sin * s + cos * t], axis=2))


def _packed(corners: FloatArray, charts: IntArray | None, depth: float) -> _Packed:
    """Boxes over the faces that are more than `depth` thick; Kernel: `core/planar_overlap.c`."""
    most = len(corners) + len(corners) // 7 + 1024
    lines = np.empty((len(corners), 3, 3))
    order = np.empty(len(corners), dtype=np.int64)
    boxes, children = np.empty((most, 6)), np.empty((most, 2), dtype=np.int64)
    counts = np.empty(2, dtype=np.int64)
    core.pack_boxes(corners, charts, depth, lines, order, boxes, children, counts)
    n_solid, n_boxes = counts.tolist()
    return _Packed(lines, order[:n_solid], boxes[:n_boxes], children[:n_boxes])


# Share of the area of faces that may overlap others, or leave the unit square, in an atlas.
_FEW, _OUTSIDE = 0.01, 1e-3


def is_atlas(mesh: Mesh, threads: int | None = None) -> bool:
    """Whether the faces of a mesh lie in the unit square, and nearly all beside one another."""
    corners = mesh.corner_uvs()
    if corners.min() < -_OUTSIDE or corners.max() > 1.0 + _OUTSIDE:
        return False
    areas = np.abs(signed_areas(corners))
    overlapping = find_overlaps(corners, threads=threads).overlapping
    return bool(areas[overlapping].sum() <= _FEW * areas.sum() > 0.0)


# Corners this close, in tiles, are the same: a sixteenth of a texel of the largest maps, and four
# times the error of six decimals, or of float32 within eight tiles.
_SAME = 2.0**-18

# Share of the length of an outline in space by which that of another may differ, in sum over its
# edges. The two arms of a character may be in different poses.
_ALIKE = 0.2


@dataclass(frozen=True, eq=False)
class StackedIslands:
    """Which faces are baked for others that share their texels."""

    stacked: BoolArray  # (F,) bool; faces of islands that coincide with another
    shares: BoolArray  # (F,) bool; those of them that are not baked
    # (F, 2) float64; whole tiles to subtract from the coordinates of a face; 0 unless its island is
    # stacked and lies outside the unit square.
    tiles: FloatArray
    n_sharing: int  # islands that are not baked
    stacks: IntArray  # (F,) int32; equal for faces of islands that coincide

    @classmethod
    def of(cls, mesh: Mesh, baked: Sequence[str] = ()) -> StackedIslands:
        """Find stacks of islands; chosen are `baked` faces or groups, else one in the square."""
        chosen = _named_faces(mesh, baked)
        uvs = mesh.corner_uvs()
        with np.errstate(over="ignore", invalid="ignore"):  # far outside of any tile
            islands = chart_ids(mesh, cut=signed_areas(uvs) < 0.0)
            boxes = _Boxes.of(uvs, islands)
        near = boxes.near_others()
        stacks = np.arange(len(near))
        if near.any():
            of_near = near[islands]
            local = uvs[of_near] - boxes.tiles[islands[of_near], np.newaxis]
            outlines = _Outlines.of(local, mesh, np.flatnonzero(of_near), islands)
            firsts = weld_rows(outlines.codes)
            firsts[~near] = stacks[~near]
            stacks = np.where(outlines.alike(firsts), firsts, stacks)
        in_stack = np.bincount(stacks, minlength=len(stacks))[stacks] > 1
        rank = np.where((boxes.tiles == 0.0).all(axis=1), 1, 2)
        rank[islands[chosen]] = 0
        order = np.lexsort((rank, stacks))
        sharing = np.ones(len(stacks), dtype=np.bool_)
        sharing[order[np.unique(stacks[order], return_index=True)[1]]] = False
        tiles = np.where(in_stack[:, np.newaxis], boxes.tiles, 0.0)
        n_sharing = int(sharing.sum())
        return cls(
            in_stack[islands],
            sharing[islands],
            tiles[islands],
            n_sharing,
            stacks[islands].astype(np.int32),
        )

    def mirrored(self, mesh: Mesh) -> BoolArray:
        """(F,) bool: mirrored faces, each in an island that coincides with another."""
        return self.stacked & (signed_areas(mesh.corner_uvs()) < 0.0)

    def baked(self, mesh: Mesh) -> Mesh:
        """Return the mesh, with its tangents, and no area in the texture for what shares."""
        if not self.n_sharing:
            return mesh
        corner_uvs = mesh.corner_uvs() - self.tiles[:, np.newaxis]
        corner_uvs[self.shares] = corner_uvs[self.stacked & ~self.shares][0, 0]
        return mesh.replace(
            uvs=corner_uvs.reshape(-1, 2),
            uv_faces=np.arange(3 * mesh.n_faces).reshape(-1, 3),
            tangents=shading_tangents(mesh),
        )


@dataclass(frozen=True, eq=False)
class _Boxes:
    """Boxes of islands."""

    tiles: FloatArray  # (n, 2) float64; lower left corner of the tile that the island begins in
    fits: BoolArray  # whether all of the island is in that tile, and more than a point or a line
    corners: FloatArray  # (n, 4) float64; of the box within the tile

    @classmethod
    def of(cls, uvs: FloatArray, islands: IntArray) -> _Boxes:
        """Find the boxes of islands, which are numbered without gaps."""
        order = np.argsort(islands, kind="stable")
        starts = np.flatnonzero(np.diff(islands[order], prepend=-1))
        low = np.minimum.reduceat(uvs.min(axis=1)[order], starts)
        high = np.maximum.reduceat(uvs.max(axis=1)[order], starts)
        tiles = np.floor(low + _SAME)
        fits = ((high - tiles <= 1.0 + _SAME) & (high - low > _SAME)).all(axis=1)
        return cls(tiles, np.asarray(fits), np.hstack([low - tiles, high - tiles]))

    def near_others(self) -> BoolArray:
        """(n,) bool: islands within a tile whose box could be that of another."""
        near = self.fits.copy()
        for side in self.corners.T:
            order = np.argsort(side, kind="stable")
            close = np.diff(side[order]) <= _SAME
            near[order] &= np.append(close, False) | np.append(False, close)
        return np.asarray(near)


@dataclass(frozen=True, eq=False)
class _Outlines:
    """Outlines of islands."""

    # (n, 4) int32; rows that are equal for islands with equal corners and outlines: two sums of
    # 64-bit codes, over the corners and over the edges, so that neither the order of faces nor the
    # diagonals of quadrilaterals matter.
    codes: IntArray
    islands: IntArray  # (m,) int32; of each edge
    ends: IntArray  # (m, 2) int32; of each edge, the lower first
    lengths: FloatArray  # (m,) float64; of each edge in space

    @classmethod
    def of(cls, uvs: FloatArray, mesh: Mesh, faces: IndexArray, islands: IntArray) -> _Outlines:
        """Find the outlines of the islands of some faces, which have the coordinates `uvs`."""
        ids = _places(uvs.reshape(-1, 2)).reshape(-1, 3)
        ends = np.stack([ids, np.roll(ids, -1, axis=1)], axis=2).reshape(-1, 2)
        ends.sort(axis=1)
        of_corners = np.repeat(islands[faces], 3)
        edges = weld_rows(np.column_stack([of_corners, ends]))
        corners = weld_rows(np.column_stack([of_corners, ids.ravel()]))
        once = np.bincount(edges, minlength=len(edges)) == 1
        first = corners == np.arange(len(corners))
        places = ends.astype(np.uint64)
        sums = np.zeros((int(islands.max()) + 1, 2), dtype=np.uint64)
        edge_codes = _mixed(places[once, 0] << np.uint64(32) | places[once, 1])
        np.add.at(sums[:, 0], of_corners[once], edge_codes)
        np.add.at(sums[:, 1], of_corners[first], _mixed(ids.ravel()[first].astype(np.uint64)))
        points = mesh.positions[mesh.faces[faces]] * unit_scale(float(np.abs(mesh.bounds).max()))
        lengths = pm.norm(np.roll(points, -1, axis=1) - points, axis=2).ravel()
        return cls(sums.view(np.int32), of_corners[once], ends[once], lengths[once])

    def alike(self, stacks: IntArray) -> BoolArray:
        """(n,) bool: islands in stacks whose outlines have about the same lengths in space."""
        firsts = weld_rows(np.column_stack([stacks[self.islands], self.ends]))
        differences = np.abs(self.lengths - self.lengths[firsts])
        sums = [
            np.bincount(self.islands, each, len(stacks)) for each in (differences, self.lengths)
        ]
        differs = sums[0] > _ALIKE * sums[1]
        return np.asarray(np.bincount(stacks, differs, len(stacks))[stacks] == 0)


def _places(points: FloatArray) -> IntArray:
    """(n,) int32: equal for points closer than `_SAME` along both axes, and for chains of them."""
    # Such points are in one cell of at least one of four grids.
    cells = [np.floor(points / (2.0 * _SAME) + shift) for shift in product((0.0, 0.5), repeat=2)]
    firsts = np.concatenate([weld_rows(each) for each in cells])
    return merged_labels(len(points), np.tile(np.arange(len(points)), len(cells)), firsts)


def _mixed(codes: npt.NDArray[np.uint64]) -> npt.NDArray[np.uint64]:
    """Spread the bits of codes; Based on: Steele, Lea, Flood, "SplitMix", 2014."""
    mixed: Any = codes + np.uint64(0x9E3779B97F4A7C15)
    for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
        mixed = (mixed ^ mixed >> np.uint64(shift)) * np.uint64(factor)
    return np.asarray(mixed ^ mixed >> np.uint64(31))


def _named_faces(mesh: Mesh, names: Sequence[str]) -> BoolArray:
    """(F,) bool: triangles of some faces, by their numbers, and of groups, by their names."""
    chosen = np.zeros(mesh.n_faces, dtype=np.bool_)
    for name in names:
        if name in mesh.group_names and mesh.face_groups is not None:
            chosen |= mesh.face_groups == mesh.group_names.index(name)
        elif name.isdecimal() and int(name) < mesh.n_polygons:
            chosen |= mesh.polygon_numbers == int(name)
        else:
            groups = f", or one of its groups {', '.join(mesh.group_names)}"
            raise OptionError(
                f"bake_island: {mesh.name} has no {quoted(name)}; name a face from 0 to "
                f"{mesh.n_polygons - 1:,}{groups if mesh.group_names else ''}"
            )
    return chosen
