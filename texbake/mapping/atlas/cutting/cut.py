"""A mesh cut into charts: parts that are disks are flattened whole, the rest is cut by xatlas.

Points are first snapped to a grid, in a frame that depends neither on the size nor on the position
of the model, so that rounding in the model's coordinates does not affect the charts.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec

import numpy as np

from texbake.errors import DependencyError, UnwrapError
from texbake.mapping.atlas.charts import Charts, gather_charts
from texbake.mapping.atlas.cutting.disks import disk_charts
from texbake.mapping.atlas.cutting.parts import (
    connected_parts,
    divide_parts,
    face_batches,
    split_parts,
)
from texbake.mapping.atlas.cutting.repair import GRID_CELLS
from texbake.mapping.atlas.cutting.xatlas_charts import xatlas_charts
from texbake.mapping.seams import opposite_half_edges
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.mesh.topology import degenerate_faces
from texbake.mesh.weld import weld_rows

# A mesh of at most `_SMALL_MESH` faces is left to xatlas, which is fast enough then; in a larger
# one, parts of fewer than `_SMALL_PIECE` faces are.
_SMALL_MESH = 500
_SMALL_PIECE = 100

# Faces left to xatlas are cut in batches of about this many: xatlas takes 0.3 s for 5,000 faces and
# 3 s for 20,000.
_BATCH_FACES = 3_000

# Boundaries between cells are shifted by this fraction of a cell, so that coordinates on a regular
# raster (binary or decimal) do not lie on them, where the last bit would decide.
_GRID_PHASE = 0.3090169943749474  # (sqrt(5) - 1) / 4


@dataclass(frozen=True, kw_only=True)
class _Quality:
    """How large charts get.

    Attributes
    ----------
    part_faces : int
        Faces of the parts that a large connected piece is divided into before flattening.
    whole_faces : int
        Faces of the largest piece that is not divided.
    most_l2 : float
        Largest stretch at which a part becomes one chart.
    """

    part_faces: int
    whole_faces: int
    most_l2: float


_QUALITIES = {
    "fast": _Quality(part_faces=4_000, whole_faces=6_000, most_l2=1.06),
    "good": _Quality(part_faces=6_000, whole_faces=9_000, most_l2=1.005),
    "best": _Quality(part_faces=10_000, whole_faces=15_000, most_l2=1.06),
}


def cut_charts(
    mesh: Mesh,
    *,
    points: FloatArray | None = None,
    quality: str = "good",
    timeout: float | None = None,
    regions: IntArray | None = None,
    threads: int | None = None,
    advance: Callable[[int], None] | None = None,
) -> Charts:
    """Cut a mesh into charts and flatten them.

    Parameters
    ----------
    mesh : Mesh
        Non-manifold edges, duplicate and degenerate faces are allowed. A degenerate face gets one
        coordinate for its three corners, if possible of a chart that it touches.
    points : (V, 3) float64, optional
        The points of `snap_points`; None to compute them.
    quality : str
        `fast`, `good` or `best`: how large charts get, and how much they may stretch.
    timeout : float, optional
        Seconds after which xatlas is stopped on a batch; None allows 60 s plus 10 ms per face.
    regions : (F,) int32, optional
        Faces of different regions never share a chart.
    threads : int, optional
        Largest number of threads, and of xatlas processes; None for one per processor. The charts
        are the same for any number.
    advance : callable, optional
        Called with the number of faces just done.

    Returns
    -------
    Charts
        The notes say where xatlas failed and faces were cut by their normals.

    Raises
    ------
    UnwrapError
        No face has an area.
    DependencyError
        xatlas is not installed, or does not load.
    """
    if find_spec("xatlas") is None:
        raise DependencyError("xatlas: it is not installed; install it with: pip install xatlas")
    points = snap_points(mesh) if points is None else points
    pieces: list[tuple[IntArray, Charts]] = []
    if mesh.n_faces <= _SMALL_MESH and (regions is None or (regions == regions[0]).all()):
        batches = [np.arange(mesh.n_faces, dtype=np.int32)]
    else:
        if regions is None:
            regions = np.zeros(mesh.n_faces, dtype=np.int32)
        corners = weld_rows(points, threads=threads)[mesh.faces]
        pieces, batches = _laid_flat(
            points, corners, regions, _QUALITIES[quality], threads, advance
        )
        advance = None  # all faces have been counted
    more, notes = xatlas_charts(
        points, mesh.faces, batches, timeout=timeout, threads=threads, advance=advance
    )
    if not pieces + more:
        raise UnwrapError(_why_nothing(mesh))
    return gather_charts(mesh.faces, pieces + more, notes)


def _laid_flat(
    points: FloatArray,
    corners: IntArray,
    regions: IntArray,
    quality: _Quality,
    threads: int | None,
    advance: Callable[[int], None] | None,
) -> tuple[list[tuple[IntArray, Charts]], list[IntArray]]:
    """Charts of the parts that are disks, and batches of the other faces."""
    solid = (corners != np.roll(corners, 1, axis=1)).all(axis=1)
    opposite = opposite_half_edges(corners, solid=solid, regions=regions)
    labels = divide_parts(
        points,
        corners,
        opposite,
        connected_parts(opposite),
        part_faces=quality.part_faces,
        whole_faces=quality.whole_faces,
    )
    small = np.bincount(labels)[labels] < _SMALL_PIECE
    pieces, left = disk_charts(
        points,
        corners,
        split_parts(opposite, np.where(small | ~solid, -1, labels)),
        most_l2=quality.most_l2,
        threads=threads,
        advance=advance,
    )
    rest = small & solid
    rest[left] = True
    batches = [
        batch
        for part in split_parts(opposite, np.where(rest, 0, -1))
        for batch in face_batches(points, corners, part, part_faces=_BATCH_FACES, regions=regions)
    ]
    return pieces, batches


def snap_points(mesh: Mesh) -> FloatArray:
    """(V, 3) float64: positions in the unit cube about the origin, on a grid of 2^-20.

    The longest side of the bounding box is 1. Meshes that differ only in scale or position have
    equal points, as far as the precision of their positions allows.
    """
    # Unused positions may lie anywhere, also where numbers overflow.
    with np.errstate(over="ignore"):
        local = np.clip(LocalFrame.around(mesh).to_local(mesh.positions), -1.0, 1.0)
    used = local[mesh.faces.ravel()]
    longest = float((used.max(axis=0) - used.min(axis=0)).max())
    cells = local * (GRID_CELLS / longest if longest > 0.0 else 0.0)
    return np.asarray(np.rint(cells - _GRID_PHASE) / GRID_CELLS)


def _why_nothing(mesh: Mesh) -> str:
    if degenerate_faces(mesh).all():
        return (
            f"{mesh.name}: none of its {mesh.n_faces} faces has an area; "
            "look for the cause with: texbake info"
        )
    return (
        f"{mesh.name}: each of its {mesh.n_faces} faces is narrower than 4 millionths of the size "
        "of the mesh; remove parts that lie far away, or split the mesh"
    )
