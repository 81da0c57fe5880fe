"""Parts of a mesh flattened whole, each as one chart, and divided where that stretches too much.

Most parts of a scan are disks of little curvature, however rough they are. They need no cuts: the
layout of least symmetric Dirichlet energy is found faster than xatlas cuts them, and without the
many small charts that xatlas makes of rough surfaces. A part that curves too much is halved, again
and again, as long as that lowers the stretch; cuts do not remove the stretch of noise.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from texbake.mapping.areas import surface_areas
from texbake.mapping.atlas.charts import Charts
from texbake.mapping.atlas.cutting.parts import Part, divide_parts, split_parts
from texbake.mapping.atlas.cutting.repair import OVERLAP_DEPTH, repair_charts
from texbake.mapping.atlas.flattening.flatten import flatten
from texbake.mapping.overlap import overlap_layers
from texbake.mapping.seams import merged_labels, next_half_edges
from texbake.mesh.compose import offset_joined
from texbake.mesh.mesh import FloatArray, IntArray
from texbake.parallel import run_bands

# A part of fewer faces is not divided further.
_FEWEST_FACES = 24

# Dividing helps if it leaves less than `_HELP` of the stretch above 1: on a smooth surface about a
# quarter is left, on noise nearly all. Where it does not help, a stretch of `_MOST_NOISE` is
# accepted.
_HELP = 0.9
_MOST_NOISE = 1.25

# A layout of which a greater share overlaps itself is useless; less is cut off afterwards.
_MOST_OVERLAP = 0.01


@dataclass(frozen=True, kw_only=True, eq=False)
class Disk:
    """Faces flattened together.

    Attributes
    ----------
    face_ids : (m,) int32
        Faces of the mesh.
    faces : (m, 3) int32
        Indices into `uvs`.
    uvs : (n, 2) float64
    area : float
        Area in space.
    l2 : float
        L2 stretch.
    """

    face_ids: IntArray
    faces: IntArray
    uvs: FloatArray
    area: float
    l2: float


def disk_charts(
    points: FloatArray,
    corners: IntArray,
    parts: Sequence[Part],
    *,
    most_l2: float,
    threads: int | None = None,
    advance: Callable[[int], None] | None = None,
) -> tuple[list[tuple[IntArray, Charts]], IntArray]:
    """Flatten parts of a mesh, each in as few charts as the stretch allows.

    Parameters
    ----------
    points : (V, 3) float64
        Points on the grid, in the unit cube.
    corners : (F, 3) int32
        Corners of the mesh's faces: indices into `points`.
    parts : sequence of Part
    most_l2 : float
        Largest stretch of a chart, unless dividing does not lower it.
    threads : int, optional
        None for every processor; the charts are the same for any number.
    advance : callable, optional
        Called with the number of faces just done, including those that are left.

    Returns
    -------
    pieces : list of ((m,) int32, Charts)
        Faces of each part, and their charts.
    left : (k,) int32
        Faces that could not be flattened, ascending.
    """
    laid: list[tuple[list[Disk], list[IntArray]]] = [([], [])] * len(parts)
    charts: list[Charts | None] = [None] * len(parts)
    order = sorted(range(len(parts)), key=lambda number: -len(parts[number].face_ids))

    n_counted = 0

    def count(n_parts: int) -> None:
        # Parts are of similar size, so that it does not matter which of them are done.
        nonlocal n_counted
        done = order[n_counted : n_counted + n_parts]
        n_counted += n_parts
        if advance is not None:
            advance(sum(len(parts[number].face_ids) for number in done))

    def lay(first: int, last: int) -> None:
        for number in order[first:last]:
            whole = _attempt(points, corners, parts[number])
            disks, left = _flat_disks(points, corners, whole, most_l2)
            laid[number] = disks, left
            charts[number] = _charts_of(points, corners, disks) if disks else None

    run_bands(lay, len(parts), band=1, threads=threads, advance=count)
    pieces = [
        (np.concatenate([disk.face_ids for disk in disks]), made)
        for (disks, _), made in zip(laid, charts, strict=True)
        if made is not None
    ]
    left = [face_ids for _, rest in laid for face_ids in rest]
    return pieces, np.sort(np.concatenate([np.empty(0, np.int32), *left]))


def _charts_of(points: FloatArray, corners: IntArray, disks: Sequence[Disk]) -> Charts | None:
    sizes = [len(disk.uvs) for disk in disks]
    return repair_charts(
        points[np.concatenate([corners[disk.face_ids] for disk in disks])],
        offset_joined([(disk.faces, size) for disk, size in zip(disks, sizes, strict=True)]),
        np.concatenate([disk.uvs for disk in disks]),
        np.repeat(np.arange(len(disks)), sizes),
        even=False,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class _Attempt:
    """A part, and its layout in one piece if there is one."""

    part: Part
    disk: Disk | None


def _flat_disks(
    points: FloatArray, corners: IntArray, whole: _Attempt, most_l2: float
) -> tuple[list[Disk], list[IntArray]]:
    """Flatten a connected part, divided if necessary; also return faces that cannot be."""
    if whole.disk is not None and whole.disk.l2 <= most_l2:
        return [whole.disk], []
    halves = _halves(points, corners, whole.part)
    if whole.disk is not None and whole.disk.l2 <= _MOST_NOISE and not _is_help(halves, whole.disk):
        # The cut may have been unlucky, so that a second one is tried.
        quarters = [part for half in halves for part in _halves(points, corners, half.part)]
        if not _is_help(quarters, whole.disk):
            return [whole.disk], []
    if not halves:
        return [], [whole.part.face_ids]
    disks: list[Disk] = []
    left: list[IntArray] = []
    for half in halves:
        more_disks, more_left = _flat_disks(points, corners, half, most_l2)
        disks += more_disks
        left += more_left
    return disks, left


def _is_help(pieces: Sequence[_Attempt], whole: Disk) -> bool:
    """Whether dividing a part lowers its stretch, as it does where the surface curves.

    A piece that could not be flattened does not count against it, since it is divided further.
    """
    if not pieces:
        return False
    excess = 0.0
    for piece in pieces:
        if piece.disk is None:
            return True
        excess += piece.disk.area * (piece.disk.l2**2 - 1.0)
    return excess <= _HELP * whole.area * (whole.l2**2 - 1.0)


def _attempt(points: FloatArray, corners: IntArray, part: Part) -> _Attempt:
    """Flatten all faces together, unless too many of them overlap."""
    half_edges = np.flatnonzero(part.opposite >= 0).astype(np.int32)
    across = part.opposite[half_edges]
    # Corners become one vertex if the faces between them are connected: each vertex has one fan.
    vertices = merged_labels(
        part.opposite.size, half_edges, next_half_edges(across).astype(np.int32)
    )
    _, first = np.unique(vertices, return_index=True)
    places = points[corners[part.face_ids]]
    faces: IntArray = vertices.reshape(-1, 3)
    flat = flatten(places.reshape(-1, 3)[first], faces)
    failed = _Attempt(part=part, disk=None)
    if flat is None or not math.isfinite(flat.l2):
        return failed
    if not flat.injective:
        layers = overlap_layers(
            flat.uvs[faces], np.zeros(len(faces), np.int32), depth=OVERLAP_DEPTH
        )
        if (layers > 0).mean() > _MOST_OVERLAP:
            return failed
    area = float(surface_areas(places).sum())
    disk = Disk(face_ids=part.face_ids, faces=faces, uvs=flat.uvs, area=area, l2=flat.l2)
    return _Attempt(part=part, disk=disk)


def _halves(points: FloatArray, corners: IntArray, part: Part) -> list[_Attempt]:
    """Two or three parts of similar size; none if there are too few faces."""
    n_faces = len(part.face_ids)
    if n_faces < _FEWEST_FACES:
        return []
    whole = np.zeros(n_faces, dtype=np.int32)
    for n_parts in (2, 4, 8):  # if a second part does not grow, several smaller ones may
        labels = divide_parts(
            points,
            corners[part.face_ids],
            part.opposite,
            whole,
            part_faces=-(-n_faces // n_parts),
            whole_faces=0,
        )
        if labels.any():
            break
    else:
        return []
    halves = split_parts(part.opposite, labels)
    return [
        _attempt(
            points,
            corners,
            Part(face_ids=part.face_ids[half.face_ids], opposite=half.opposite),
        )
        for half in halves
    ]
