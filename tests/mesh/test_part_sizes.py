"""Small parts are enlarged to be simplified, and go back to size and place."""

import numpy as np

from texbake.mesh.compose import join_meshes
from texbake.mesh.part_sizes import EnlargedParts
from texbake.mesh.shapes import uv_sphere
from texbake.mesh.simplify import simplify_with_report


def balls(*sizes):
    ball = uv_sphere(24, 48)
    parts = [
        ball.replace(positions=ball.positions * size + np.array([3.0 * i, 5.0, -2.0]))
        for i, size in enumerate(sizes)
    ]
    return join_meshes(parts)


def test_a_part_as_large_as_the_model_stays_as_it_is():
    mesh = balls(1.0)
    assert EnlargedParts.of(mesh).mesh is mesh


def test_parts_come_back_to_their_place_and_the_distance_is_that_of_the_model():
    mesh = balls(1.0, 0.1, 0.01)
    enlarged = EnlargedParts.of(mesh)
    low, report = simplify_with_report(enlarged.mesh, 1200, parts=enlarged)
    # `fast` keeps vertices; enlarging rounds them.
    apart = np.abs(low.positions[:, None] - mesh.positions).max(axis=2).min(axis=1)
    assert apart.max() < 1e-12
    assert report.distance.diagonal == mesh.diagonal
    plain, _ = simplify_with_report(mesh, 1200)
    counts, without = (np.bincount(each.face_groups) for each in (low, plain))
    assert counts[1] > 1.5 * without[1] and counts[2] > 1.5 * without[2]
