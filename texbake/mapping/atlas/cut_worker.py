"""The child process that runs xatlas: a mesh in on stdin, its charts out on stdout.

Run as a script, by `cut.py`, with nothing of texbake loaded, so that it starts in little more
than the time that numpy takes to load. xatlas is compiled code that may crash or never return on
hostile meshes; here it takes nothing else with it.

In: two arrays in the format of `numpy.save`: points (V, 3) float32, faces (F, 3) uint32.
Out: three: faces (F, 3) uint32, coordinates (T, 2) float32 in texels of xatlas' own atlas, chart
ids (T,) uint32, which are 2^32 - 1 for coordinates that lie in no chart.
"""

from __future__ import annotations

import os
import sys
from io import BytesIO

import numpy as np
import numpy.typing as npt
import xatlas

# Texels that all charts together are given in xatlas' own packing. Its result is thrown away, so
# that few are enough; more would make the packing slow and cost precision in small charts, which
# it blows up to whole texels.
_ATLAS_TEXELS = 256.0**2


def cut(points: npt.NDArray[np.float32], faces: npt.NDArray[np.uint32]) -> tuple[object, ...]:
    """Cut a mesh into charts and flatten them; see the module for what comes back."""
    area = _surface_area(points, faces)
    if area == 0.0:
        return _nothing()
    atlas = xatlas.Atlas()
    atlas.add_mesh(points, faces)
    packing = xatlas.PackOptions()
    packing.rotate_charts = False  # it transposes charts instead of rotating them
    packing.rotate_charts_to_axis = False  # done by the packer that comes after
    packing.bilinear = False
    packing.texels_per_unit = (_ATLAS_TEXELS / area) ** 0.5
    atlas.generate(xatlas.ChartOptions(), packing)
    if atlas.chart_count == 0:
        return _nothing()
    _, chart_faces, uvs = atlas.get_mesh(0)
    _, chart_ids = atlas.get_mesh_vertex_assignment(0)
    return chart_faces, uvs * np.array([atlas.width, atlas.height], np.float32), chart_ids


def _nothing() -> tuple[object, ...]:
    return np.empty((0, 3), np.uint32), np.empty((0, 2), np.float32), np.empty(0, np.uint32)


def _surface_area(points: npt.NDArray[np.float32], faces: npt.NDArray[np.uint32]) -> float:
    corners = points[faces].astype(np.float64)
    crosses = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return float(np.linalg.norm(crosses, axis=1).sum()) / 2.0


def main() -> None:
    """Answer one request."""
    answer = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a library prints must not get into the answer
    request = BytesIO(sys.stdin.buffer.read())
    arrays = BytesIO()  # numpy.save needs to know where in the file it is; a pipe cannot tell
    for array in cut(np.load(request), np.load(request)):
        np.save(arrays, np.asarray(array))
    answer.write(arrays.getvalue())
    answer.close()
    # Without the tear-down of interpreter and libraries, which has nothing left to do.
    os._exit(0)


if __name__ == "__main__":
    main()
