"""Sheets that lie on a surface stay above it when both are simplified."""

import numpy as np
import pytest

from tests.models import joined
from texbake.mesh.compose import excerpt
from texbake.mesh.distance import sample_points
from texbake.mesh.objects import joined_objects
from texbake.mesh.options import QUALITIES
from texbake.mesh.shapes import icosphere
from texbake.mesh.simplify import simplify
from texbake.mesh.topology import face_components
from texbake.mesh.triangle_tree import TriangleTree


def labeled_ball(height):
    """A ball with two round labels at a height over it."""
    ball, sheet = icosphere(5), icosphere(5)
    middles = sheet.positions[sheet.faces].mean(axis=1)
    labels = [excerpt(sheet, middles @ axis > 0.85) for axis in ([1.0, 0.0, 0.0], [0.0, -0.6, 0.8])]
    labels = [x.replace(positions=(1.0 + height) * x.positions) for x in labels]
    return joined_objects(joined(ball, *labels))


@pytest.mark.parametrize("quality", QUALITIES)
@pytest.mark.parametrize("height", [0.001, 0.003, 0.01])
def test_labels_stay_above_a_ball(height, quality):
    mesh = labeled_ball(height)
    low = simplify(mesh, mesh.n_faces // 40, quality=quality)
    parts, n_parts = face_components(low.faces, low.n_vertices)
    assert n_parts == 3
    ball = parts == np.argmax(np.bincount(parts))
    tree = TriangleTree.build(low.positions, low.faces[ball])
    places = sample_points(low.positions, low.faces[~ball], 5_000)
    distances, ids, shares = tree.closest_points(places)
    below = (low.positions[low.faces[ball][ids]] * shares[..., None]).sum(axis=1)
    heights = np.sign(((places - below) * below).sum(axis=1))
    heights = heights * distances
    assert (heights > -1e-9).mean() > 0.999
    assert heights.min() > -1e-3
    assert np.linalg.norm(low.positions, axis=1).max() < 1.0 + height + 0.1
