"""Charts of a mesh: xatlas in a process of its own, with what it leaves undone made good.

xatlas compares areas and lengths with absolute thresholds, so it is given points in a frame that
depends neither on the size nor on the place of the model, large enough that no threshold is ever
met by a face that is not degenerate. The points are snapped to a grid, so that rounding in the
model's own coordinates does not reach it.

It rounds the width and height of every chart up to whole texels, which stretches small charts, and
leaves some charts mirrored. Both are undone here: each chart gets the linear map that makes its
stretch even over all directions, and the area that its faces have in space.

Based on: Jonathan Young, xatlas, 2018 (a fork of thekla_atlas by Ignacio Castano).
"""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import dataclass
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path

import numpy as np
import numpy.typing as npt

from texbake.errors import DependencyError, UnwrapError
from texbake.mapping.areas import signed_areas, surface_areas
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import FloatArray, IntArray, Mesh

_WORKER = Path(__file__).with_name("charts_worker.py")

# Grid cells along the longest side of the bounding box. Positions that lie 1e6 sizes away from the
# origin carry 2^-33 of the size; with cells this much wider, hardly one coordinate in a thousand
# changes its cell by such a move.
_GRID_CELLS = 2.0**20

# Boundaries between cells are put off the middle by this fraction of a cell, so that coordinates
# on a regular raster (binary or decimal) do not lie on them, where the last bit would decide.
_GRID_PHASE = 0.3090169943749474  # (sqrt(5) - 1) / 4

# Longest side of the box that xatlas sees. It takes areas below 1.2e-7 for zero; at this size that
# is the area of a face four grid cells large, and the charts of real meshes are the same for
# sizes of 16 to 1024 while at 1 they are not.
_WORKING_SIZE = 256.0

_SECONDS_TO_START = 60.0
_SECONDS_A_FACE = 0.01  # 30 times what 82,000 triangles take

_NO_CHART = np.uint32(2**32 - 1)


@dataclass(frozen=True, kw_only=True, eq=False)
class Charts:
    """A mesh flattened in pieces, each laid out for itself about its own origin.

    Attributes
    ----------
    uvs : (T, 2) float64
        Coordinates, in the unit of `faces`' points: a chart has the area that its faces have in
        space.
    faces : (F, 3) int32
        Indices into `uvs`; the three are equal in a face that lies in no chart.
    chart_ids : (T,) int32
        Chart of each coordinate; charts are numbered from 0 without gaps.
    n_ignored : int
        Faces that lie in no chart, because they are degenerate on the grid.
    n_mirrored : int
        Charts that xatlas left mirrored and that were turned over.
    """

    uvs: FloatArray
    faces: IntArray
    chart_ids: IntArray
    n_ignored: int
    n_mirrored: int

    @property
    def n_charts(self) -> int:
        """Number of charts."""
        return int(self.chart_ids.max()) + 1


def cut_charts(mesh: Mesh, *, timeout: float | None = None) -> Charts:
    """Cut a mesh into charts and flatten each of them.

    Parameters
    ----------
    mesh : Mesh
        Non-manifold edges, duplicate and degenerate faces are taken as they come. A degenerate
        face gets one coordinate for its three corners, of a chart that it touches if there is one.
    timeout : float, optional
        Seconds after which xatlas is given up; None leaves 60 s and 10 ms a face.

    Raises
    ------
    UnwrapError
        xatlas crashed, took longer than `timeout`, or found no face with an area.
    """
    points = snapped_points(mesh)
    if timeout is None:
        timeout = _SECONDS_TO_START + _SECONDS_A_FACE * mesh.n_faces
    request = BytesIO()
    np.save(request, (points * _WORKING_SIZE).astype(np.float32))
    np.save(request, mesh.faces.astype(np.uint32))
    answer = BytesIO(_run_worker(request.getvalue(), timeout, mesh.name))
    faces, uvs, chart_ids = (np.load(answer) for _ in range(3))
    if not (chart_ids != _NO_CHART).any():
        raise UnwrapError(
            f"{mesh.name}: none of its {mesh.n_faces} faces has an area; "
            "look for what is wrong with: texbake info"
        )
    faces, uvs, chart_ids, n_ignored = _without_strays(mesh.faces, faces, uvs, chart_ids)
    uvs, n_mirrored = _evened(points[mesh.faces], faces, uvs, chart_ids)
    return Charts(
        uvs=uvs, faces=faces, chart_ids=chart_ids, n_ignored=n_ignored, n_mirrored=n_mirrored
    )


def snapped_points(mesh: Mesh) -> FloatArray:
    """(V, 3) float64: positions in the unit cube about the origin, on a grid of 2^-20.

    The longest side of the bounding box is 1. Meshes that differ in scale or place have equal
    points as far as their positions carry them.
    """
    local = LocalFrame.around(mesh).to_local(mesh.positions)
    used = local[mesh.faces.ravel()]
    longest = float((used.max(axis=0) - used.min(axis=0)).max())
    cells = local * (_GRID_CELLS / longest) if longest > 0.0 else local * 0.0
    # Positions that no face uses may lie anywhere, also where float32 overflows.
    cells = np.clip(cells, -_GRID_CELLS, _GRID_CELLS)
    return np.asarray(np.rint(cells - _GRID_PHASE) / _GRID_CELLS)


def _run_worker(request: bytes, timeout: float, name: str) -> bytes:
    """Send a request to a new worker process and return its answer; the process is gone then."""
    if find_spec("xatlas") is None:
        raise DependencyError("xatlas: it is not installed; install it with: pip install xatlas")
    # The same places to import from as here; -P keeps the modules beside the script out of them.
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    pipe = subprocess.PIPE
    process = subprocess.Popen(
        [sys.executable, "-P", str(_WORKER)], stdin=pipe, stdout=pipe, stderr=pipe, env=environment
    )
    try:
        answer, messages = process.communicate(request, timeout)
    except subprocess.TimeoutExpired:
        raise UnwrapError(
            f"{name}: xatlas has not cut it into charts in {timeout:.0f} s; "
            "simplify it first, or allow more time"
        ) from None
    finally:  # also for Ctrl-C
        if process.poll() is None:
            process.kill()
            process.communicate()
    if process.returncode != 0:
        said = messages.decode(errors="replace").strip().splitlines()
        raise UnwrapError(
            f"{name}: xatlas crashed (exit code {process.returncode}"
            f"{', ' + said[-1] if said else ''}); repair or simplify the mesh first"
        )
    return answer


def _without_strays(
    mesh_faces: IntArray,
    faces: npt.NDArray[np.uint32],
    uvs: npt.NDArray[np.float32],
    chart_ids: npt.NDArray[np.uint32],
) -> tuple[IntArray, FloatArray, IntArray, int]:
    """Drop coordinates that lie in no chart; faces that use them collapse to one that does.

    Returns faces, coordinates, chart ids and the number of faces that lie in no chart.
    """
    stray = (chart_ids[faces] == _NO_CHART).any(axis=1)
    kept, renumbered = np.unique(faces[~stray], return_inverse=True)
    new_faces = np.zeros(faces.shape, dtype=np.int32)
    new_faces[~stray] = renumbered.reshape(-1, 3)
    # The first coordinate that each vertex has in any chart: assigned last, so that it stays.
    at_vertex = np.full(int(mesh_faces.max()) + 1, -1, dtype=np.int32)
    at_vertex[mesh_faces[~stray].ravel()[::-1]] = new_faces[~stray].ravel()[::-1]
    touched = at_vertex[mesh_faces[stray]]
    anchor = np.where(touched >= 0, touched, np.int32(2**31 - 1)).min(axis=1, initial=2**31 - 1)
    new_faces[stray] = np.where(anchor < len(kept), anchor, 0)[:, None]
    _, new_chart_ids = np.unique(chart_ids[kept], return_inverse=True)
    return (
        new_faces,
        uvs[kept].astype(np.float64),
        new_chart_ids.astype(np.int32),
        int(stray.sum()),
    )


def _evened(
    corners: FloatArray, faces: IntArray, uvs: FloatArray, chart_ids: IntArray
) -> tuple[FloatArray, int]:
    """Give each chart the linear map that evens out its stretch; return also how many were mirrored.

    With J the Jacobian of a face from space to texture and A its area in space, H = Σ A J Jᵀ is a
    multiple of the identity where the chart is stretched alike in all directions, and H^(-1/2) is
    the linear map that makes it so; of all maps that keep areas it leaves the least Dirichlet energy.
    """
    n_charts = int(chart_ids.max()) + 1
    face_charts = chart_ids[faces[:, 0]]

    def total(values: FloatArray, ids: IntArray = face_charts) -> FloatArray:
        return np.bincount(ids, values, minlength=n_charts)

    counts = np.maximum(total(np.ones(len(uvs)), chart_ids), 1.0)
    means = np.stack([total(uvs[:, axis], chart_ids) / counts for axis in (0, 1)], axis=1)
    uvs = uvs - means[chart_ids]
    mirrored = total(signed_areas(uvs[faces])) < 0.0
    uvs[:, 0] *= np.where(mirrored, -1.0, 1.0)[chart_ids]

    edges, areas = corners[:, 1:] - corners[:, :1], surface_areas(corners)
    uv_edges = uvs[faces[:, 1:]] - uvs[faces[:, :1]]
    # J Jᵀ = U G⁻¹ Uᵀ with the edges U in texture and their Gram matrix G in space; |G| = 4 A².
    gram = np.einsum("fik,fjk->fij", edges, edges)
    with np.errstate(divide="ignore", invalid="ignore"):
        adjugates = np.stack([gram[:, 1, 1], -gram[:, 0, 1], -gram[:, 0, 1], gram[:, 0, 0]], axis=1)
        weights = np.where(areas[:, None] > 0.0, adjugates / (4.0 * areas[:, None]), 0.0)
    moments = np.einsum("fik,fij,fjl->fkl", uv_edges, weights.reshape(-1, 2, 2), uv_edges)
    h = np.stack([total(moments[:, i, j]) for i in (0, 1) for j in (0, 1)], axis=1)
    maps = _inverse_square_roots(h.reshape(-1, 2, 2))
    uvs = np.einsum("tij,tj->ti", maps[chart_ids], uvs)

    flat_areas = total(signed_areas(uvs[faces]))
    with np.errstate(divide="ignore", invalid="ignore"):
        scales = np.where(flat_areas > 0.0, np.sqrt(total(areas) / flat_areas), 0.0)
    return uvs * scales[chart_ids, None], int(mirrored.sum())


def _inverse_square_roots(matrices: FloatArray) -> FloatArray:
    """H^(-1/2) of symmetric positive (n, 2, 2) matrices; the identity for one that is singular."""
    root_det = np.sqrt(np.maximum(np.linalg.det(matrices), 0.0))
    traces = np.trace(matrices, axis1=1, axis2=2)
    with np.errstate(divide="ignore", invalid="ignore"):
        # Cayley and Hamilton: H^(1/2) = (H + √|H| 1) / √(tr H + 2 √|H|).
        roots = (matrices + root_det[:, None, None] * np.eye(2)) / np.sqrt(traces + 2.0 * root_det)[
            :, None, None
        ]
        adjugates = np.trace(roots, axis1=1, axis2=2)[:, None, None] * np.eye(2) - roots
        inverses = adjugates / root_det[:, None, None]
    singular = ~(root_det > 1e-12 * traces)  # a chart of 1 : 1e12 has no second direction
    inverses[singular] = np.eye(2)
    return inverses
