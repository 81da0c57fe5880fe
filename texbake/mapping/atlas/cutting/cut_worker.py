"""The child process that runs xatlas: it reads meshes from stdin and writes their charts to stdout.

`xatlas_charts.py` runs it as a script, which loads next to nothing of texbake, so that it starts in
little more time than numpy takes to load.

In: V and F, uint64; points (V, 3) float32; faces (F, 3) uint32.
Out: T and F, uint64; coordinates (T, 2) float32, in texels of xatlas' own atlas; chart ids (T,)
uint32, which are 2^32 - 1 for coordinates without a chart; faces (F, 3) uint32. T and F are 0 if
there are no charts.
"""

from __future__ import annotations

import math
import os
import signal
import sys
from typing import BinaryIO

# An interrupt is handled by the parent process, which then ends this one.
signal.signal(signal.SIGINT, signal.SIG_IGN)

import numpy as np  # noqa: E402
import numpy.typing as npt  # noqa: E402

from texbake.child import end_with_parent  # noqa: E402
from texbake.core import portable_math as pm  # noqa: E402

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


def cut(points: npt.NDArray[np.float32], faces: npt.NDArray[np.uint32]) -> bytes:
    """Cut a mesh into charts and flatten them; the module describes the answer."""
    area = _surface_area(points, faces)
    if area == 0.0:
        return bytes(16)
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
        return bytes(16)
    _, chart_faces, uvs = atlas.get_mesh(0)
    _, chart_ids = atlas.get_mesh_vertex_assignment(0)
    texels = uvs * np.array([atlas.width, atlas.height], np.float32)
    counts = np.array([len(uvs), len(chart_faces)], np.uint64)
    arrays = (counts, texels, chart_ids.astype(np.uint32), chart_faces.astype(np.uint32))
    return b"".join(array.tobytes() for array in arrays)


def _surface_area(points: npt.NDArray[np.float32], faces: npt.NDArray[np.uint32]) -> float:
    corners = points[faces].astype(np.float64)
    crosses = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return float(pm.norm(crosses, axis=1).sum()) / 2.0


def _answer(requests: BinaryIO, answers: BinaryIO) -> bool:
    """Answer one request; return whether there was one."""
    head = requests.read(8)
    if len(head) < 8:
        return False
    request = requests.read(int.from_bytes(head, "little"))
    n_points, n_faces = np.frombuffer(request, np.uint64, 2).tolist()
    points = np.frombuffer(request, np.float32, 3 * n_points, 16).reshape(-1, 3)
    faces = np.frombuffer(request, np.uint32, 3 * n_faces, 16 + 12 * n_points).reshape(-1, 3)
    answer = cut(points, faces)
    answers.write(len(answer).to_bytes(8, "little") + answer)
    answers.flush()
    return True


def main() -> None:
    """Answer requests until there are no more."""
    end_with_parent()  # also while xatlas hangs
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a library prints must not get into an answer
    while _answer(sys.stdin.buffer, answers):
        pass
    # Skips the tear-down of the interpreter and libraries, which have nothing left to do.
    os._exit(0)


if __name__ == "__main__":
    main()
