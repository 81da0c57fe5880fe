"""Mappings where they are undefined: finite coordinates, and no smeared face."""

import numpy as np

import texbake


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


def test_scale_by_a_power_of_two_changes_no_bit(mapping_case):
    case = mapping_case.make()
    larger = case.mesh.replace(positions=case.mesh.positions * 2.0**20)
    ours, theirs = (texbake.unwrap(m, **case.options).corner_uvs() for m in (larger, case.mesh))
    np.testing.assert_array_equal(ours, theirs)
