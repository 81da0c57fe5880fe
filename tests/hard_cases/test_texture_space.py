"""Which face owns a texel, by exact counts, and mappings where they are undefined."""

import numpy as np
import pytest

import texbake
from texbake.baking.texels import NO_FACE, UNIT, SampleGrid, rasterize_uv, snap_uvs
from texbake.errors import UvError


def covers(corners, points):
    """(F, n) whether a face covers points by the top-left rule, in Python's integers."""
    corners = np.vectorize(int, otypes=[object])(corners)  # exact, however large
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    doubles = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    inside = np.ones((len(corners), len(points)), bool)
    sign = np.where(doubles < 0, -1, 1)
    for tail, head in ((a, b), (b, c), (c, a)):
        dx, dy = sign * (head[:, 0] - tail[:, 0]), sign * (head[:, 1] - tail[:, 1])
        edge = dx[:, None] * (points[:, 1] - tail[:, 1:2]) - dy[:, None] * (
            points[:, 0] - tail[:, :1]
        )
        owned = ((dy < 0) | ((dy == 0) & (dx > 0)))[:, None]
        inside &= ((edge > 0) | ((edge == 0) & owned)).astype(bool)
    return inside & (doubles != 0).astype(bool)[:, None]


@pytest.mark.parametrize(("width", "height", "per_side"), [(16, 16, 1), (7, 13, 2), (1, 1, 4)])
def test_samples_have_the_owner_of_exact_arithmetic(textured_case, width, height, per_side):
    mesh = textured_case.make()
    grid = SampleGrid(width, height, per_side)
    try:
        snapped = snap_uvs(mesh, grid)
    except UvError:
        # Then no face may cover a sample: refused, never an empty map.
        corners = np.rint(mesh.corner_uvs() * [grid.n_columns, grid.n_rows] * UNIT)
        y, x = np.mgrid[: grid.n_rows, : grid.n_columns].reshape(2, -1) * UNIT + UNIT // 2
        assert not covers(corners, np.stack([x, y], axis=1).astype(object)).any()
        return
    owners, n_overlaps = rasterize_uv(snapped, grid)
    y, x = np.mgrid[: grid.n_rows, : grid.n_columns].reshape(2, -1) * UNIT + UNIT // 2
    covered = covers(snapped.corners, np.stack([x, y], axis=1).astype(object))
    expected = np.where(covered.any(axis=0), covered.argmax(axis=0), NO_FACE)
    np.testing.assert_array_equal(owners.ravel(), expected)
    assert n_overlaps == np.count_nonzero(covered.sum(axis=0) > 1)


def test_a_needle_owns_its_share_where_samples_are_dense(case_named):
    """What a face owns tends to its area: each step of the samples brings it closer."""
    mesh = case_named("needle thinner than a texel").make()
    edges = mesh.corner_uvs()[-1, 1:] - mesh.corner_uvs()[-1, 0]
    area = abs(np.linalg.det(edges)) / 2.0
    errors = []
    for per_side in (1, 4, 16, 64):
        grid = SampleGrid(64, 64, per_side)
        owners, _ = rasterize_uv(snap_uvs(mesh, grid), grid)
        share = np.count_nonzero(owners == mesh.n_faces - 1) / owners.size
        errors.append(abs(share / area - 1.0))
    assert errors[-1] < 0.02 and errors == sorted(errors, reverse=True)


def test_coordinates_are_finite_and_no_face_is_smeared(mapping_case):
    case = mapping_case.make()
    mapped = texbake.unwrap(case.mesh, **case.options)
    corners = mapped.corner_uvs()
    assert np.isfinite(corners).all()
    assert (np.ptp(corners, axis=1).max(axis=0) <= case.widest).all()


def test_a_cap_of_1e_9_about_the_pole_keeps_its_angles(case_named):
    """Closed form: t is the angle from the pole over π, which is 0 by the arc cosine."""
    case = case_named("arccos at its ends").make()
    mapped = texbake.unwrap(case.mesh, **case.options)
    rim = mapped.corner_uvs()[:6, :2, 1]
    np.testing.assert_allclose((1.0 - rim) * np.pi, 1e-9, rtol=1e-6)
