"""The demo."""

from pathlib import Path

import numpy as np
import pytest

from texbake import DemoOptions, OptionError, demo, read_mesh
from texbake.mesh.shapes import orange


def test_the_demo_is_the_whole_job_on_an_orange(tmp_path: Path) -> None:
    result = demo(tmp_path, DemoOptions(triangles=20_000, faces=200, size=256))
    assert result.files["high"] == tmp_path / "orange_high.ply"
    np.testing.assert_array_equal(read_mesh(result.files["high"]).faces, orange(20_000).faces)
    assert result.files["mesh"] == tmp_path / "orange_low.obj"
    assert all(path.is_file() for path in result.files.values())
    assert result.stages[0].name == "make the orange"
    assert result.comparison.mapped.mean_deg < 0.5 * result.comparison.bare.mean_deg


def test_an_orange_of_a_few_triangles_is_none() -> None:
    with pytest.raises(OptionError, match="triangles: 999"):
        DemoOptions(triangles=999)
