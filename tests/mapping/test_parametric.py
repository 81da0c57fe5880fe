import numpy as np
import pytest

from texbake.errors import OptionError, UvError
from texbake.mapping.classical.planar import parametric
from texbake.mapping.corner_uvs import with_coordinates
from texbake.mapping.options import UnwrapOptions
from texbake.mesh.shapes import cube, plane, uv_sphere


def test_without_a_map_coordinates_are_the_parameters_bit_by_bit() -> None:
    mesh = uv_sphere(6, 9)
    found = parametric(mesh, UnwrapOptions(method="parametric"))
    assert np.array_equal(found.corners, mesh.corner_uvs())
    assert found.tallies == {}


def test_the_linear_map_is_that_of_its_six_numbers() -> None:
    mesh = plane(3, 5)  # (u, v) = (x, y)
    linear = (2.0, -1.0, 0.25, 0.5, 3.0, -7.0)
    found = parametric(mesh, UnwrapOptions(method="parametric", linear=linear))
    x, y, _ = np.moveaxis(mesh.positions[mesh.faces], 2, 0)
    assert np.array_equal(found.corners[..., 0], 2.0 * x - y + 0.25)
    assert np.array_equal(found.corners[..., 1], 0.5 * x + 3.0 * y - 7.0)


def test_seams_of_the_parameters_stay_as_they_are() -> None:
    mesh = uv_sphere(6, 9)
    linear = (3.0, 0.0, 0.1, 0.0, 0.7, 0.0)
    found = parametric(mesh, UnwrapOptions(method="parametric", linear=linear))
    mapped = with_coordinates(mesh, found.corners)
    assert len(mapped.uvs) == len(mesh.uvs)


def test_a_map_that_flattens_is_allowed() -> None:
    flat = UnwrapOptions(method="parametric", linear=(1.0, 0.0, 0.0, 0.0, 0.0, 0.5))
    assert (parametric(plane(2, 2), flat).corners[..., 1] == 0.5).all()


def test_a_mesh_without_parameters_is_an_error() -> None:
    with pytest.raises(UvError, match="no texture coordinates"):
        parametric(cube(), UnwrapOptions(method="parametric"))


def test_coordinates_that_overflow_are_one_error() -> None:
    mesh = plane().replace(uvs=plane().uvs * 1e200)
    options = UnwrapOptions(method="parametric", linear=(1e200, 0.0, 0.0, 0.0, 1.0, 0.0))
    with pytest.raises(OptionError, match="that are not finite"):
        parametric(mesh, options)
