"""Faces that overlap in texture space.

Pairs of faces to compare come from a tree of bounding boxes, packed over the faces in the order of
a space-filling curve. One overlap is enough to mark a face, so that a stack of thousands costs no
more than a stack of two. The number of comparisons is bounded even in the worst case, such as a
hundred thousand slivers side by side along a diagonal; faces that were not compared with all others
are reported.

Kernel: `core/planar_overlap.c`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from texbake.core import core, portable_math as pm
from texbake.errors import counted
from texbake.mapping.corner_uvs import signed_areas
from texbake.mesh.frame import unit_scale
from texbake.mesh.mesh import BoolArray, FloatArray, Int64Array, IntArray, Mesh
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
