"""When a comparison warns that maps make an asset worse."""

import math
from dataclasses import replace

import numpy as np
import pytest

from texbake import Mesh, RenderOptions, compare
from texbake.jobs.comparison import (
    SAME_DB,
    VISIBLE_DB,
    VISIBLE_DEG,
    VISIBLE_OUTLINE,
    comparison_warnings,
)

BARE = {"mean_deg": 5.0, "psnr_db": 30.0, "outline_mismatch": 0.02, "depth_mismatch": 0.1}


def warnings_for(bare, **changes):
    mesh = Mesh(positions=np.eye(3), faces=np.array([[0, 1, 2]]))
    same = compare(mesh, mesh, options=RenderOptions(width=16, height=16))
    assert comparison_warnings(same) == []
    maps = replace(same.mapped, **{**bare, **changes})
    changed = replace(same, bare=replace(same.bare, **bare), mapped=maps, maps=("normal map",))
    return comparison_warnings(changed)


@pytest.mark.parametrize("changes", [
    {},
    {"mean_deg": 4.0, "psnr_db": 33.0, "outline_mismatch": 0.0},
    {"mean_deg": 5.0 + VISIBLE_DEG / 2},
    {"psnr_db": 30.0 - VISIBLE_DB / 2},
    {"outline_mismatch": 0.02 + VISIBLE_OUTLINE / 2},
])  # fmt: skip
def test_no_warning_where_nobody_sees_a_difference(changes):
    assert warnings_for(BARE, **changes) == []


@pytest.mark.parametrize(("changes", "words"), [
    ({"mean_deg": 5.5}, "normals off by 5.50° and not 5.00°;"),
    ({"psnr_db": 28.0}, "PSNR 28.0 dB and not 30.0 dB;"),
    ({"outline_mismatch": 0.122}, "outline off by 12.2 % and not 2.0 %;"),
    ({"depth_mismatch": 0.2}, "depth off by 20.0 % and not 10.0 %;"),
    ({"mean_deg": 9.0, "psnr_db": 9.0}, "normals off by 9.00° and not 5.00°, PSNR 9.0 dB"),
])  # fmt: skip
def test_what_is_worse_is_named(changes, words):
    (line,) = warnings_for(BARE, **changes)
    assert line.startswith("with its normal map the asset is ")
    assert "further from the high-poly mesh than without maps: " + words in line


@pytest.mark.parametrize(("decibels", "n"), [(SAME_DB + 1.0, 0), (SAME_DB - 1.0, 1)])
def test_equal_pictures_stay_equal_where_the_rest_is_rounding(decibels, n):
    lines = warnings_for({**BARE, "psnr_db": math.inf}, psnr_db=decibels)
    assert len(lines) == n
    assert all("and not infinite" in line for line in lines)
