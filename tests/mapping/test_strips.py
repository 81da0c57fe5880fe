"""Long strips in an atlas: cables own texels, and take none from the rest of a mesh."""

import numpy as np
import pytest

from texbake import Mesh, atlas_points, unwrap
from texbake.mapping.corner_uvs import surface_areas
from texbake.mapping.unwrap import unwrap_with_report
from texbake.mesh.compose import join_meshes
from texbake.mesh.shapes import icosphere

N_CABLES, N_SIDES = 12, 6


def cables_and_ball(radius):
    """Cables of length 1, whose triangles are as long, and a ball with a fiftieth of their area."""
    angles = 2.0 * np.pi * np.arange(N_SIDES) / N_SIDES
    ring = radius * np.stack([np.cos(angles), np.sin(angles), 0.0 * angles], axis=1)
    one = np.arange(N_SIDES)
    two = (one + 1) % N_SIDES
    quads = np.stack([one, two, two + N_SIDES, one + N_SIDES], axis=1)
    faces = quads[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3).astype(np.int32)
    places = np.random.default_rng(5).random((N_CABLES, 2))
    tube = np.concatenate([ring, ring + np.array([0.0, 0.0, 1.0])])
    cables = [Mesh(positions=tube + np.append(place, 0.0), faces=faces) for place in places]
    ball = icosphere(2)
    return join_meshes([*cables, ball.replace(positions=ball.positions * np.sqrt(radius) / 3.0)])


@pytest.mark.parametrize("quality", ["fast", "good"])
def test_the_faces_of_thin_cables_own_texels(quality):
    mesh = cables_and_ball(2e-4)
    low, report = unwrap_with_report(mesh, size=256, padding=1, quality=quality)
    faces = atlas_points(low, 256).faces
    areas = surface_areas(mesh.positions[mesh.faces])
    unseen = np.ones(mesh.n_faces, dtype=bool)
    unseen[faces[faces >= 0]] = False
    assert areas[unseen].sum() < 0.01 * areas.sum()
    assert any("long strips" in note for note in report.notes)
    is_ball = np.arange(mesh.n_faces) >= 2 * N_SIDES * N_CABLES
    # Its share of the area of a texture that is half filled; 14 at the scale of whole cables.
    assert np.count_nonzero(is_ball[faces[faces >= 0]]) > 0.01 * 256**2


def test_a_strip_that_is_wide_enough_keeps_its_shape():
    mesh = cables_and_ball(2e-2)
    report = unwrap_with_report(mesh, size=1024, padding=1, quality="fast")[1]
    assert report.notes == ()
    assert report.distortion.stretch.l2 < 1.01


def test_charts_that_are_kept_or_bounded_keep_their_shape():
    mesh = cables_and_ball(2e-4)
    bounded = unwrap_with_report(mesh, size=256, padding=1, quality="fast", max_stretch=1.1)[1]
    assert bounded.distortion.stretch.l2 < 1.1
    kept = unwrap_with_report(unwrap(mesh, max_stretch=1.1), size=256, keep=True)[1]
    assert not kept.notes
