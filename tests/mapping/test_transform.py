from __future__ import annotations

import numpy as np
import pytest

from texbake import distortion, unwrap
from texbake.errors import UvError
from texbake.mapping.options import UnwrapOptions
from texbake.mapping.transform import at_density, transformed
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import icosphere, plane

POINTS = np.random.default_rng(5).random((40, 3, 2)) * 3 - 1


def test_nothing_asked_for_changes_no_bit() -> None:
    assert np.array_equal(transformed(POINTS, UnwrapOptions()), POINTS)


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"flip": "s"}, (0.75, 0.5)),
        ({"flip": "t"}, (0.25, 0.5)),
        ({"flip": "st"}, (0.75, 0.5)),
        ({"rotate": 90}, (0.5, 0.25)),
        ({"rotate": 180}, (0.75, 0.5)),
        ({"rotate": -90}, (0.5, 0.75)),
        ({"scale": 4}, (1.0, 2.0)),
        ({"scale": (2, -1)}, (0.5, -0.5)),
        ({"flip": "s", "rotate": 90, "scale": 2}, (1.0, 1.5)),  # in this order
    ],
)
def test_each_step_and_their_order(changes: dict[str, object], expected: object) -> None:
    point = np.array([[0.25, 0.5]])
    assert transformed(point, UnwrapOptions(**changes)).tolist() == [list(expected)]  # type: ignore[arg-type, call-overload]


def test_a_rotation_keeps_lengths_and_turns_counter_clockwise() -> None:
    turned = transformed(np.array([[1.5, 0.5]]), UnwrapOptions(rotate=30.0))
    assert turned == pytest.approx(np.array([[0.5 + np.sqrt(0.75), 1.0]]), abs=1e-15)


@pytest.mark.parametrize("size", [1024, (2048, 256)])
@pytest.mark.parametrize("method", ["planar", "atlas"])
def test_the_mesh_has_the_texel_density_asked_for(size: object, method: str) -> None:
    options = UnwrapOptions(method=method, size=size, texel_density=90.0)  # type: ignore[arg-type]
    mesh = plane(4, 4) if method == "planar" else icosphere(2)
    assert distortion(unwrap(mesh, options), size).texel_density == pytest.approx(90.0, rel=1e-3)  # type: ignore[arg-type]


def test_no_area_has_no_density() -> None:
    line = Mesh(positions=[[0, 0, 0], [1, 0, 0], [2, 0, 0]], faces=[[0, 1, 2]])
    with pytest.raises(UvError, match="no area"):
        at_density(line, np.zeros((1, 3, 2)), UnwrapOptions(texel_density=1.0))


def test_an_offset_is_added_last() -> None:
    mesh = plane(2, 2)
    moved = unwrap(mesh, method="parametric", scale=3.0, offset=(1.0, -2.0))
    assert moved.corner_uvs() == pytest.approx(mesh.corner_uvs() * 3.0 + [1.0, -2.0])
