"""Where on a triangle a ray meets it, in float64."""

import numpy as np

from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import Mesh
from texbake.raycast.moller_trumbore import refine_kernel
from texbake.raycast.rays import RayHits

WALL = Mesh(positions=[[0, 0, 0], [0, 1, 0], [0, 0, 1]], faces=[[0, 1, 2]])


def refined(origin, direction):
    """Intersect the wall with one ray that a float32 caster takes for a hit."""
    found = RayHits.misses(1)
    found.faces[0] = 0
    frame = LocalFrame(np.zeros(3), 1.0)
    frame.center.flags.writeable = False
    direction = np.array([direction]) / np.linalg.norm(direction)
    refine_kernel(
        (WALL.positions, WALL.faces, frame.center, frame.scale),
        (np.array([origin]), direction, np.full(1, 4.0)),
        (found.faces, found.barycentrics, found.distances),
    )
    return found.barycentrics[0], found.distances[0], np.array(origin) + found.distances * direction


def test_a_ray_across_meets_the_plane_where_a_closed_form_says():
    weights, distance, _ = refined([3.0, 0.25, 1.0], [-3.0, 0.0, -0.5])
    np.testing.assert_allclose(weights, [0.25, 0.5], rtol=1e-15)
    np.testing.assert_allclose(distance, np.hypot(3.0, 0.5), rtol=1e-15)


def test_a_ray_along_the_triangle_stays_on_it():
    # It drifts away from the wall, whose plane it has met ten units before its start.
    weights, distance, point = refined([1e-8, 0.25, 2.0], [1e-9, 0.0, -1.0])
    assert (weights >= 0).all()
    assert weights.sum() <= 1
    np.testing.assert_allclose(distance, 2.0 - weights[1], rtol=1e-12)
    np.testing.assert_allclose(point[0], [0.0, *weights], atol=1e-7)
