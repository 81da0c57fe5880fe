"""The child process that runs xatlas; `xatlas_charts.py` sends it meshes.

A request is points (V, 3) float32 and faces (F, 3) uint32. The answer is coordinates (T, 2)
float32, in texels of xatlas' own atlas; chart ids (T,) uint32, which are 2^32 - 1 for coordinates
without a chart; faces (F, 3) uint32; or None if there are no charts.
"""

from __future__ import annotations

import math
import sys
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.child import serve
from texbake.core import portable_math as pm

try:
    import xatlas
except ImportError as error:
    print(" ".join(str(error).split()), file=sys.stderr)
    sys.exit(3)  # _DOES_NOT_LOAD of `xatlas_charts.py`

# Texels of all charts together in xatlas' own packing. That packing is discarded, so that few are
# enough; more would be slow and cost precision in small charts, which are enlarged to whole texels.
_ATLAS_TEXELS = 256.0**2

# Most texels along the mesh. The packing takes very long for charts like long needles.
_MOST_TEXELS = 1024.0


def cut(mesh: tuple[npt.NDArray[np.float32], npt.NDArray[np.uint32]]) -> Any:
    """Cut a mesh into charts and flatten them; the module describes the answer."""
    points, faces = mesh
    area = _surface_area(points, faces)
    if area == 0.0:
        return None
    atlas = xatlas.Atlas()
    atlas.add_mesh(points, faces)
    packing = xatlas.PackOptions()
    packing.rotate_charts = False  # it transposes charts instead of rotating them
    packing.rotate_charts_to_axis = False  # texbake's own packer does that
    packing.bilinear = False
    longest = float(np.ptp(points, axis=0).max())
    packing.texels_per_unit = min(math.sqrt(_ATLAS_TEXELS / area), _MOST_TEXELS / longest)
    atlas.generate(xatlas.ChartOptions(), packing)
    if atlas.chart_count == 0:
        return None
    _, chart_faces, uvs = atlas.get_mesh(0)
    _, chart_ids = atlas.get_mesh_vertex_assignment(0)
    texels = uvs * np.array([atlas.width, atlas.height], np.float32)
    return texels.astype(np.float32), chart_ids.astype(np.uint32), chart_faces.astype(np.uint32)


def _surface_area(points: npt.NDArray[np.float32], faces: npt.NDArray[np.uint32]) -> float:
    corners = points[faces].astype(np.float64)
    crosses = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return float(pm.norm(crosses, axis=1).sum()) / 2.0


if __name__ == "__main__":
    serve(cut)
