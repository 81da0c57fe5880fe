"""Charts of a mesh, cut by xatlas in a process of its own.

xatlas compares areas and lengths with absolute thresholds, so it is given points in a frame that
depends neither on the size nor on the place of the model, large enough that no threshold is ever
met by a face that is not degenerate. The points are snapped to a grid, so that rounding in the
model's own coordinates does not reach it.

Based on: Jonathan Young, xatlas, 2018 (a fork of thekla_atlas by Ignacio Castano).
"""

from __future__ import annotations

import os
import subprocess
import sys
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path

import numpy as np

from texbake.errors import DependencyError, UnwrapError
from texbake.mapping.atlas.charts import Charts
from texbake.mapping.atlas.mend import GRID_CELLS, mended_charts
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import FloatArray, Mesh

_WORKER = Path(__file__).with_name("cut_worker.py")

# Boundaries between cells are put off the middle by this fraction of a cell, so that coordinates
# on a regular raster (binary or decimal) do not lie on them, where the last bit would decide.
_GRID_PHASE = 0.3090169943749474  # (sqrt(5) - 1) / 4

# Longest side of the box that xatlas sees. It takes areas below 1.2e-7 for zero; at this size that
# is two cells of the grid, and real meshes come apart in the same charts as at any size from 16 to
# 1024, while at 1 they do not.
_WORKING_SIZE = 256.0

_SECONDS_TO_START = 60.0
_SECONDS_A_FACE = 0.01  # 30 times what 82,000 triangles take


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
    charts = mended_charts(points, mesh.faces, faces, uvs, chart_ids)
    if charts is None:
        raise UnwrapError(
            f"{mesh.name}: none of its {mesh.n_faces} faces has an area; "
            "look for what is wrong with: texbake info"
        )
    return charts


def snapped_points(mesh: Mesh) -> FloatArray:
    """(V, 3) float64: positions in the unit cube about the origin, on a grid of 2^-20.

    The longest side of the bounding box is 1. Meshes that differ in scale or place have equal
    points as far as their positions carry them.
    """
    # Positions that no face uses may lie anywhere, also where numbers overflow.
    with np.errstate(over="ignore"):
        local = np.clip(LocalFrame.around(mesh).to_local(mesh.positions), -1.0, 1.0)
    used = local[mesh.faces.ravel()]
    longest = float((used.max(axis=0) - used.min(axis=0)).max())
    cells = local * (GRID_CELLS / longest if longest > 0.0 else 0.0)
    return np.asarray(np.rint(cells - _GRID_PHASE) / GRID_CELLS)


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
            "simplify it first, or allow more time (timeout)"
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
