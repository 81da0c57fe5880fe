"""Measured ray distances."""

from __future__ import annotations

import numpy as np

from texbake.baking.bake import bake
from texbake.baking.options import BakeOptions
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import plane


def test_rays_reach_a_peak_at_the_last_corners_of_faces() -> None:
    """A coarse tent over the square: its top is the last corner of each of its faces."""
    low = plane()
    least, greatest = low.bounds
    x, y = [least[0], greatest[0]], [least[1], greatest[1]]
    top = [(x[0] + x[1]) / 2, (y[0] + y[1]) / 2, 0.3]
    around = [[x[0], y[0], 0], [x[1], y[0], 0], [x[1], y[1], 0], [x[0], y[1], 0]]
    high = Mesh(
        positions=np.array([*around, top], dtype=np.float64),
        faces=np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]], dtype=np.int32),
    )
    result = bake(high, low, BakeOptions(size=32))
    assert result.report.front is not None
    assert result.report.front >= 0.3
    assert result.report.texels_missed == 0
