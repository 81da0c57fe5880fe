"""Sheets that lie on a surface stay above it when both are simplified."""

import numpy as np
import pytest

from tests.models import joined
from texbake.mesh.compose import excerpt
from texbake.mesh.decals import Decals
from texbake.mesh.distance import sample_points
from texbake.mesh.objects import joined_objects
from texbake.mesh.options import QUALITIES
from texbake.mesh.part_sizes import EnlargedParts
from texbake.mesh.shapes import icosphere
from texbake.mesh.simplify import simplify_with_report
from texbake.mesh.topology import face_components
from texbake.mesh.triangle_tree import TriangleTree


def labeled_ball(height):
    """A ball with two round labels at a height over it, or inside where that is negative."""
    ball, sheet = icosphere(5), icosphere(5)
    middles = sheet.positions[sheet.faces].mean(axis=1)
    labels = [excerpt(sheet, middles @ axis > 0.85) for axis in ([1.0, 0.0, 0.0], [0.0, -0.6, 0.8])]
    labels = [x.replace(positions=(1.0 + height) * x.positions) for x in labels]
    return joined_objects(joined(ball, *labels))


@pytest.mark.parametrize("quality", QUALITIES)
@pytest.mark.parametrize("height", [0.001, 0.003, 0.01, -0.003])
@pytest.mark.parametrize("are_enlarged", [False, True])
def test_labels_stay_on_their_side_of_a_ball(height, quality, are_enlarged):
    mesh = labeled_ball(height)
    enlarged = EnlargedParts.of(mesh)
    assert enlarged.mesh is not mesh
    source = enlarged.mesh if are_enlarged else mesh
    parts = enlarged if are_enlarged else None
    low, _ = simplify_with_report(source, mesh.n_faces // 40, quality=quality, parts=parts)
    parts, n_parts = face_components(low.faces, low.n_vertices)
    assert n_parts == 3
    ball = parts == np.argmax(np.bincount(parts))
    tree = TriangleTree.build(low.positions, low.faces[ball])
    places = sample_points(low.positions, low.faces[~ball], 5_000)
    distances, ids, shares = tree.closest_points(places)
    below = (low.positions[low.faces[ball][ids]] * shares[..., None]).sum(axis=1)
    heights = np.sign(((places - below) * below).sum(axis=1))
    heights = np.sign(height) * heights * distances
    assert (heights > -1e-9).mean() > 0.999
    assert heights.min() > -1e-3
    assert np.linalg.norm(low.positions, axis=1).max() < 1.0 + height + 0.1


def test_a_label_on_a_label_lies_above_it_whichever_comes_first():
    def cap(least, radius, level):
        ball = icosphere(level)
        part = excerpt(ball, ball.positions[ball.faces].mean(axis=1)[:, 0] > least)
        return part.replace(positions=radius * part.positions)

    mesh = joined_objects(joined(cap(0.95, 1.01, 5), cap(0.7, 1.005, 5), icosphere(5)))
    low = joined_objects(joined(cap(0.95, 0.99, 5), cap(0.7, 0.985, 5), icosphere(5)))
    raised = Decals(mesh).raised(low)
    parts, _ = face_components(raised.faces, raised.n_vertices)
    radii = [np.linalg.norm(raised.positions[raised.faces[parts == i]], axis=-1) for i in (0, 1, 2)]
    assert radii[0].min() > radii[1].max() > radii[1].min() > 1.002
