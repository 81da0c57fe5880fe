"""Formats of float32 refuse meshes whose vertices would fall together in it."""

import numpy as np
import pytest

from texbake.errors import MeshError
from texbake.mesh.files import read_mesh, write_mesh
from texbake.mesh.shapes import icosphere


@pytest.mark.parametrize("suffix", [".glb", ".stl", ".usda", " quantized.glb"])
@pytest.mark.parametrize("scale", [1e-50, 1e-45, 1e39, 1e50])
def test_sizes_that_float32_does_not_hold(suffix, scale, tmp_path):
    ball = icosphere(2)
    options = {"quantize": True} if "quantized" in suffix else {}
    with pytest.raises(MeshError, match="float32"):
        write_mesh(
            ball.replace(positions=ball.positions * scale), tmp_path / f"ball{suffix}", **options
        )
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("suffix", [".glb", ".stl", ".usda"])
@pytest.mark.parametrize("scale", [1e-37, 1.0, 1e37])
def test_sizes_that_float32_holds(suffix, scale, tmp_path):
    ball = icosphere(2)
    write_mesh(ball.replace(positions=ball.positions * scale), tmp_path / f"ball{suffix}")
    back = read_mesh(tmp_path / f"ball{suffix}")
    np.testing.assert_allclose(back.bounds, ball.bounds * scale, rtol=1e-6)


def test_a_place_too_far_away_for_stl(tmp_path):
    ball = icosphere(2)
    far = ball.replace(positions=ball.positions + 1e8)
    with pytest.raises(MeshError, match=r"would leave 1 of its 162 vertices.*move it first"):
        write_mesh(far, tmp_path / "ball.stl")
    write_mesh(far, tmp_path / "ball.glb")  # its node has the place


def test_one_place_stays_one(tmp_path):
    """What is degenerate before is no matter of float32."""
    point = icosphere(0)
    point = point.replace(positions=np.full_like(point.positions, 1.0 / 3.0))
    write_mesh(point, tmp_path / "point.stl")
    written = read_mesh(tmp_path / "point.stl")
    assert written.n_faces == point.n_faces
    assert (written.positions == np.float32(1.0 / 3.0)).all()
