"""When a comparison warns that maps make an asset worse."""

from dataclasses import replace

import numpy as np
import pytest

from texbake import Mesh, RenderOptions, compare
from texbake.jobs.comparison import VISIBLE_DEG, comparison_warnings


@pytest.mark.parametrize(
    ("farther_deg", "warnings"), [(-1, 0), (0, 0), (VISIBLE_DEG / 2, 0), (2 * VISIBLE_DEG, 1)]
)
def test_warning_where_maps_are_seen_to_be_worse(farther_deg: float, warnings: int) -> None:
    mesh = Mesh(positions=np.eye(3), faces=np.array([[0, 1, 2]]))
    same = compare(mesh, mesh, options=RenderOptions(width=16, height=16))
    assert comparison_warnings(same) == []
    bare = replace(same.bare, mean_deg=5.0)
    mapped = replace(same.mapped, mean_deg=5.0 + farther_deg)
    found = comparison_warnings(replace(same, bare=bare, mapped=mapped))
    assert len(found) == warnings
    assert all("further from the high-poly mesh than without maps" in line for line in found)
