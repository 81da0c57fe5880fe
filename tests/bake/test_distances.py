"""How far rays must reach."""

from __future__ import annotations

import numpy as np

from texbake.bake.bake import bake
from texbake.bake.options import BakeOptions
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import plane


def test_a_peak_that_is_no_faces_first_corner_is_reached() -> None:
    """A coarse tent over the square: its top is the last corner of each of its faces."""
    low = plane()
    corners = low.positions[[0, 1, 3, 2]] if len(low.positions) == 4 else low.positions
    around = corners[
        np.argsort(np.arctan2(*(corners[:, :2] - corners[:, :2].mean(axis=0)).T[::-1]))
    ]
    high = Mesh(
        positions=np.vstack([around, [*around.mean(axis=0), 0.0, 0.0, 0.3]]),
        faces=np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]], dtype=np.int32),
    )
    result = bake(high, low, BakeOptions(size=32))
    assert result.report.front is not None
    assert result.report.front >= 0.3
    assert result.report.texels_missed == 0
