import numpy as np

from texbake.rendering.effects.points import steps_along_surface, steps_along_texture


def test_one_step_along_the_texture_is_one_unit_of_it():
    corners = np.random.default_rng(1).normal(size=(200, 3, 2))
    steps = steps_along_texture(corners).reshape(-1, 2, 2)
    edges = corners[:, 1:] - corners[:, :1]
    areas = np.abs(np.linalg.det(edges))
    found = steps @ edges
    # Relative to how flat the triangle is.
    np.testing.assert_array_less(
        np.abs(found - np.eye(2)).max(axis=(1, 2)), 1e-14 * (1 + 10 / areas)
    )


def test_steps_along_the_surface_are_unit_perpendicular_and_turn_with_it():
    corners = np.random.default_rng(2).normal(size=(200, 3, 3))
    edges = corners[:, 1:] - corners[:, :1]
    along, across = np.moveaxis(steps_along_surface(corners).reshape(-1, 2, 2) @ edges, 1, 0)
    normals = np.cross(edges[:, 0], edges[:, 1])
    areas = np.linalg.norm(normals, axis=1)
    good = areas > 0.1
    assert good.sum() > 150
    np.testing.assert_allclose(np.linalg.norm(along[good], axis=1), 1.0, atol=1e-13)
    np.testing.assert_allclose(
        np.cross(along, across)[good], (normals / areas[:, None])[good], atol=1e-12
    )


def test_triangles_without_area_have_no_steps():
    line = np.array([[(0.0, 0.0), (1.0, 1.0), (2.0, 2.0)], [(3.0, 1.0)] * 3])
    assert not steps_along_texture(line).any()
    flat = np.concatenate([line, np.zeros((2, 3, 1))], axis=2)
    assert not steps_along_surface(flat).any()
    # So small that its area is below float64's range.
    assert not steps_along_texture(1e-200 * np.array([[(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)]])).any()
