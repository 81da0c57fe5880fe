"""Procedures baked into a texture, compared with the procedures themselves."""

import dataclasses

import numpy as np
import pytest

from texbake.baking.texels import SampleGrid
from texbake.baking.texture.canvas import greatest_lengths, sample_steps
from texbake.baking.texture.options import SolidOptions
from texbake.baking.texture.solid import bake_solid
from texbake.errors import MeshError, OptionError, UvError
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import plane, uv_sphere
from texbake.texture.procedures import evaluate

Array = np.ndarray


def centers(size):
    """Positions of texel centers on a plane that fills the unit square."""
    y, x = (np.mgrid[:size, :size] + 0.5) / size
    return np.stack([x.ravel(), 1.0 - y.ravel(), np.zeros(size * size)], axis=1)


@pytest.mark.parametrize("procedure", ["noise", "marble", "wood", "worley"])
def test_a_texel_takes_the_value_at_its_point(procedure):
    size = 32
    options = SolidOptions(procedure=procedure, scale=3.0, size=size, samples=1)
    result = bake_solid(plane(4, 2), options)  # corners at corners of texels: nothing is snapped
    footprint = np.full(size * size, 3.0 / size, np.float32)
    expected = evaluate(procedure, centers(size) * 3.0, footprint, parameters={})
    # Points go through the local frame, and are off by some units of 2^-53.
    np.testing.assert_allclose(result.values.reshape(expected.shape), expected, atol=2e-6)
    assert result.report.texels_covered == size * size
    assert result.report.texels_unseen == 0
    assert not result.report.warnings


def test_a_checker_has_cells_of_8_texels():
    # Cells of 8 texels; a footprint of a quarter texel blurs their edges by half that each way.
    options = SolidOptions(
        procedure="checker", parameters={"dimensions": 2}, scale=4.0, size=32, samples=16
    )
    values = bake_solid(plane(), options).values[:, :, 0]
    row, column = np.mgrid[:32, :32]
    inner = (row % 8 % 7 > 0) & (column % 8 % 7 > 0)
    odd = (column // 8 + (31 - row) // 8) % 2
    first = values[31 - 3, 3]
    assert first in (0.0, 1.0)
    np.testing.assert_array_equal(values[inner], np.where(odd, 1.0 - first, first)[inner])


def test_a_ramp_of_one_color_gives_that_color():
    options = SolidOptions(procedure="marble", colors=((0.2, 0.4, 0.6),), size=16)
    values = bake_solid(uv_sphere(8, 8), options).values
    np.testing.assert_allclose(values, np.broadcast_to((0.2, 0.4, 0.6), values.shape), atol=1e-6)


def test_a_ramp_maps_the_values_of_the_procedure():
    plain = SolidOptions(procedure="noise", scale=5.0, size=16, samples=1)
    colored = dataclasses.replace(plain, colors=((0.0, 1.0, 0.5), (1.0, 0.0, 0.5)))
    value, color = bake_solid(plane(), plain).values, bake_solid(plane(), colored).values
    expected = np.concatenate([value, 1 - value, np.full_like(value, 0.5)], axis=2)
    np.testing.assert_allclose(color, expected, atol=1e-6)


def test_scaling_the_mesh_changes_nothing_by_default():
    mesh = uv_sphere(12, 16)
    options = SolidOptions(procedure="granite", size=64)
    large = mesh.replace(positions=mesh.positions * 1024.0)
    one, two = bake_solid(mesh, options), bake_solid(large, options)
    np.testing.assert_array_equal(one.values, two.values)
    assert one.report.scale == (1.0, 1.0, 1.0)
    np.testing.assert_array_equal(
        one.values, bake_solid(mesh, dataclasses.replace(options, scale=1.0)).values
    )
    assert two.report.scale == (2.0**-10,) * 3


def test_sample_steps_of_a_stretched_plane():
    # A plane 6 wide and 2 high on a texture of 3 x 4 samples: 2 and 0.5 per sample.
    mesh = plane().replace(positions=plane().positions * (6.0, 2.0, 1.0))
    steps = sample_steps(mesh, mesh.positions[mesh.faces], SampleGrid(3, 4, 1))
    np.testing.assert_allclose(steps[:, :, 0], [[2, 0, 0]] * 2, atol=1e-12)
    np.testing.assert_allclose(steps[:, :, 1], [[0, -0.5, 0]] * 2, atol=1e-12)
    np.testing.assert_allclose(greatest_lengths(steps), 2.0)
    rng = np.random.default_rng(1)
    random = rng.standard_normal((20, 3, 2))
    np.testing.assert_allclose(
        greatest_lengths(random), [np.linalg.svd(m)[1][0] for m in random], rtol=1e-12
    )


def test_wrong_input_is_one_clear_error():
    bare = Mesh(positions=[[0, 0, 0], [1, 0, 0], [0, 1, 0]], faces=[[0, 1, 2]], name="a.obj")
    with pytest.raises(UvError, match=r"a\.obj: it has no texture coordinates"):
        bake_solid(bare)
    for wrong in (
        {"parameters": {"speed": 1}},
        {"scale": 0.0},
        {"scale": (1.0, 2.0)},
        {"colors": ()},
        {"colors": ((0.0, 1.0),)},
    ):
        name = next(iter(wrong)).replace("parameters", "speed")
        with pytest.raises(OptionError, match=name):
            SolidOptions(**wrong)


def test_a_mesh_too_small_to_be_scaled_is_refused():
    tiny = plane()
    tiny = tiny.replace(positions=tiny.positions * 1e-310)
    with pytest.raises(MeshError, match="too small for a procedure; scale it up"):
        bake_solid(tiny, SolidOptions(size=8))


def test_points_and_widths_beyond_float64_count_as_0():
    mesh = plane()
    far = mesh.replace(positions=mesh.positions * 1e300)
    options = SolidOptions(procedure="checker", size=4, samples=1, scale=1e300)
    at_0 = evaluate("checker", [[0.0, 0.0, 0.0]]).item()
    assert (bake_solid(far, options).values == at_0).all()
