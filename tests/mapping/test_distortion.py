"""Stretch, charts and tiles, against singular values and figures by hand."""

import json
import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from texbake import Mesh, distortion
from texbake.errors import UvError
from texbake.mapping.stretch import face_stretch, stretch_by_group
from texbake.mesh.shapes import cube, plane


def mapped(mesh, matrix):
    return mesh.replace(uvs=mesh.uvs @ np.transpose(matrix))


def squares_of_scales(*scales):
    """Unit squares side by side in space, and in the texture each scaled by its own factor."""
    square = plane()
    positions = [square.positions + np.array([2.0 * i, 0.0, 0.0]) for i in range(len(scales))]
    uvs = [square.uvs * scale + np.array([20.0 * i, 0.0]) for i, scale in enumerate(scales)]
    faces = np.concatenate([square.faces + 4 * i for i in range(len(scales))])
    return Mesh(
        positions=np.concatenate(positions), faces=faces, uvs=np.concatenate(uvs), uv_faces=faces
    )


@given(st.floats(0.0, 6.3), st.floats(-3.0, 3.0), st.floats(-6.0, 6.0))
def test_similarities_have_no_distortion(angle, log_size, log_texture):
    mesh = plane(3, 2)
    cos, sin = math.cos(angle), math.sin(angle)
    mesh = mapped(mesh, np.array([[cos, -sin], [sin, cos]]) * 10.0**log_texture)
    mesh = mesh.replace(positions=mesh.positions * 10.0**log_size)
    found = distortion(mesh)
    # 1e-9: the rotation is exact to 1e-16, and squares of 1 ± 1e-16 stay that near to 1.
    assert found.stretch.l2 == pytest.approx(1.0, abs=1e-9)
    assert found.stretch.linf == pytest.approx(1.0, abs=1e-9)
    assert found.stretch.symmetric_dirichlet == pytest.approx(4.0, abs=1e-9)
    # A rounding of 1e-16 in a + c is one of 1e-8 in the ratio where Γ and γ are equal.
    assert found.stretch.quasi_conformal == pytest.approx(1.0, abs=1e-7)
    assert found.stretch.angle == pytest.approx(0.0, abs=1e-9)
    assert found.stretch.area == pytest.approx(0.0, abs=1e-9)
    assert found.n_mirrored == found.n_degenerate == found.n_collapsed == found.n_overlapping == 0


def test_two_charts_of_unlike_size():
    # Areas 1 and 4 in the texture, 1 and 1 in space: σ² = 2/5 and 8/5 once totals are equal.
    found = distortion(squares_of_scales(1.0, 2.0), size=100)
    small, large = 0.4, 1.6
    assert found.stretch.l2 == pytest.approx(math.sqrt((1.0 / small + 1.0 / large) / 2.0))
    assert found.stretch.linf == pytest.approx(1.0 / math.sqrt(small))
    assert found.stretch.symmetric_dirichlet == pytest.approx(
        small + 1.0 / small + large + 1.0 / large
    )
    assert found.stretch.quasi_conformal == pytest.approx(1.0)
    assert found.stretch.area == pytest.approx(
        (small + 1.0 / small - 2.0 + large + 1.0 / large - 2.0) / 2.0
    )
    assert [found.charts[i].stretch.l2 for i in (0, 1)] == pytest.approx(
        [1.0 / math.sqrt(small), 1.0 / math.sqrt(large)]
    )
    assert found.n_charts == 2
    assert found.fill == pytest.approx(5.0)
    # 100 and 200 texels per unit.
    assert found.texel_density == pytest.approx(math.sqrt((100.0**2 + 200.0**2) / 2.0))
    assert found.texel_density_variation == pytest.approx(50.0 / 150.0)


def test_faces_without_area_are_counted_and_left_out():
    mesh = Mesh(
        positions=[[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 0]],
        faces=[[0, 1, 2], [0, 2, 3], [0, 4, 2], [0, 1, 1], [0, 1, 2]],
        uvs=[[0, 0], [1, 0], [1, 1], [0, 1], [0.2, 0.3]],
        uv_faces=[[0, 1, 2], [0, 2, 3], [0, 4, 2], [0, 1, 2], [4, 4, 4]],
    )
    found = distortion(mesh)
    assert (found.n_measured, found.n_degenerate, found.n_collapsed) == (2, 2, 1)
    assert found.stretch.l2 == pytest.approx(1.0)
    assert found.n_charts == 1


def test_a_wide_texture_is_measured_in_square_texels():
    mesh = mapped(plane(), [[0.5, 0.0], [0.0, 1.0]])
    assert distortion(mesh, size=(2048, 1024)).stretch.l2 == pytest.approx(1.0)
    assert distortion(mesh, size=1024).stretch.quasi_conformal == pytest.approx(2.0)


def test_two_charts_and_the_worst_faces_are_named():
    mesh = squares_of_scales(1.0, 2.0)
    found = distortion(mesh, size=100)
    first, second = found.charts
    assert (first.chart, first.n_faces, first.n_mirrored) == (0, 2, 0)
    assert (first.area, first.fill) == pytest.approx((1.0, 1.0))
    assert (second.area, second.fill) == pytest.approx((1.0, 4.0))
    assert (first.texel_density, second.texel_density) == pytest.approx((100.0, 200.0))
    # Each alone is an undistorted square.
    assert (first.l2_alone, second.l2_alone) == pytest.approx((1.0, 1.0))
    assert [face.face for face in found.worst_faces] == [0, 1, 2, 3]
    assert [face.chart for face in found.worst_faces] == [0, 0, 1, 1]
    assert found.worst_faces[0].l2 == pytest.approx(1.0 / math.sqrt(0.4))
    assert found.worst_faces[0].linf == pytest.approx(1.0 / math.sqrt(0.4))


def test_no_more_than_ten_faces_are_named_and_they_are_the_worst():
    mesh = plane(10, 1)
    # Columns ever narrower in the texture.
    bent = mesh.replace(uvs=np.stack([np.sqrt(mesh.uvs[:, 0]), mesh.uvs[:, 1]], axis=1))
    found = distortion(bent)
    assert len(found.worst_faces) == 10
    # u = √x has the derivative 1 / (2 √x): stretch grows with x.
    centers = mesh.positions[mesh.faces].mean(axis=1)[:, 0]
    assert {face.face for face in found.worst_faces} == set(np.argsort(-centers)[:10].tolist())
    assert [face.l2 for face in found.worst_faces] == sorted(
        (face.l2 for face in found.worst_faces), reverse=True
    )


def test_one_mirrored_face_among_many():
    mesh = plane(4, 4)
    # A face amid the others laid beside them, its corners the other way round.
    mirrored = mesh.uvs[mesh.uv_faces[12]] * np.array([-1.0, 1.0]) + np.array([3.0, 0.0])
    uv_faces = mesh.uv_faces.copy()
    uv_faces[12] = [25, 26, 27]
    uvs = np.concatenate([mesh.uvs, mirrored])
    found = distortion(mesh.replace(uvs=uvs, uv_faces=uv_faces))
    assert (found.n_mirrored, found.n_charts, found.n_tiles) == (1, 2, 2)
    assert math.isinf(found.stretch.l2)
    assert found.turned_stretch.l2 == pytest.approx(1.0)
    assert found.turned_stretch.symmetric_dirichlet == pytest.approx(4.0)
    assert [math.isinf(chart.stretch.l2) for chart in found.charts] == [False, True]
    assert [chart.n_mirrored for chart in found.charts] == [0, 1]
    sides = mesh.positions[mesh.faces[12]] - np.roll(mesh.positions[mesh.faces[12]], 1, axis=0)
    assert found.seam_length == pytest.approx(np.linalg.norm(sides, axis=1).sum())


def test_tiles_of_faces():
    mesh = squares_of_scales(1.0, 1.0)  # at u 0 and 20
    found = distortion(mesh)
    assert (found.n_tiles, found.fill, found.packing_efficiency) == pytest.approx((2, 2.0, 1.0))


def test_everything_is_written_as_json():
    found = distortion(mapped(plane(), [[-1.0, 0.0], [0.0, 1.0]]))
    written = json.loads(json.dumps(found.to_json(), allow_nan=False))
    assert written["charts"][0]["l2"] is None and written["charts"][0]["l2_alone"] is None
    assert written["charts"][0]["n_faces"] == 2
    assert written["turned_stretch"]["l2"] == pytest.approx(1.0)
    assert written["worst_faces"][0]["mirrored"] is True
    assert {"seam_length", "fill", "packing_efficiency", "n_overlapping", "n_unsure"} <= set(
        written
    )


def test_errors():
    with pytest.raises(UvError, match="no texture coordinates"):
        distortion(cube())
    with pytest.raises(UvError, match="none of its faces has an area both"):
        distortion(mapped(plane(), np.zeros((2, 2))))
    line = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0]], dtype=float)
    faces = np.array([[0, 1, 2]], dtype=np.int32)
    with pytest.raises(UvError, match=r"none of its faces has an area; .* texbake info"):
        distortion(Mesh(positions=line, faces=faces, uvs=line[:, :2], uv_faces=faces))


def triangle_soup(seed, n=20):
    """Triangles of any shape, upright and mirrored ones, none of them thin."""
    random = np.random.default_rng(seed)
    angles = random.uniform(0.0, 2.0 * np.pi, (n, 1)) + np.array([0.0, 2.0, 4.0])
    flat = np.stack([np.cos(angles), np.sin(angles)], axis=2) * random.uniform(0.5, 2, (n, 3, 1))
    frames = np.linalg.qr(random.normal(size=(n, 3, 3)))[0][:, :, :2]
    corners = np.einsum("fij,fcj->fci", frames, flat) + random.normal(size=(n, 1, 3))
    maps = random.normal(size=(n, 2, 2)) + 0.3 * np.eye(2)
    uvs = np.einsum("fij,fcj->fci", maps, flat) + random.normal(size=(n, 1, 2))
    each = np.arange(3 * n, dtype=np.int32).reshape(-1, 3)
    return Mesh(positions=corners.reshape(-1, 3), faces=each, uvs=uvs.reshape(-1, 2), uv_faces=each)


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_singular_values_are_those_of_the_matrix_from_texture_to_surface(seed):
    mesh = triangle_soup(seed)
    found = face_stretch(mesh)
    corners, uvs = mesh.positions[mesh.faces], mesh.corner_uvs()
    edges_uv = np.stack([uvs[:, 1] - uvs[:, 0], uvs[:, 2] - uvs[:, 0]], axis=2)
    edges = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=2)
    expected = np.linalg.svd(edges @ np.linalg.inv(edges_uv), compute_uv=False)
    area = np.linalg.norm(np.cross(edges[:, :, 0], edges[:, :, 1]), axis=1).sum()
    expected *= np.sqrt(np.abs(np.linalg.det(edges_uv)).sum() / area)
    # 1e-6: the inverse loses what the coordinates of a face nearly without area lack.
    assert found.greatest == pytest.approx(expected[:, 0], rel=1e-6)
    assert found.least == pytest.approx(expected[:, 1], rel=1e-6)
    assert np.array_equal(found.mirrored, np.linalg.det(edges_uv) < 0.0)
    assert found.l2 == pytest.approx(np.sqrt((expected**2).sum(axis=1) / 2.0), rel=1e-6)


def test_groups_are_summed_up_by_area():
    mesh = triangle_soup(1)
    found = face_stretch(mesh)
    groups = np.arange(20) % 3
    for group, stretch in enumerate(stretch_by_group(found, groups, turned=True)):
        own = groups == group
        weights = found.areas[own] / found.areas[own].sum()
        squares = found.greatest[own] ** 2 + found.least[own] ** 2
        inverses = found.greatest[own] ** -2.0 + found.least[own] ** -2.0
        assert stretch.l2 == pytest.approx(np.sqrt((squares * weights).sum() / 2.0))
        assert stretch.linf == found.greatest[own].max()
        assert stretch.symmetric_dirichlet == pytest.approx(((squares + inverses) * weights).sum())
        ratios = found.greatest[own] / found.least[own]
        assert stretch.quasi_conformal == pytest.approx((ratios * weights).sum())


def test_only_groups_with_a_mirrored_face_are_infinite():
    mesh = plane(2, 1)
    uvs = np.concatenate([mesh.uvs, [[0.0, 0.0], [0.0, 1.0], [1.0, 0.0]]])
    uv_faces = np.array(mesh.uv_faces)
    uv_faces[0] = [6, 7, 8]  # clockwise
    found = face_stretch(mesh.replace(uvs=uvs, uv_faces=uv_faces))
    stretch = stretch_by_group(found, np.array([0, 1, 1, 1]))
    assert found.mirrored.tolist() == [True, False, False, False]
    assert [np.isinf(s.l2) for s in stretch] == [True, False]
    assert stretch[0].to_json()["l2"] is None
    assert all(np.isfinite(s.l2) for s in stretch_by_group(found, np.arange(4), turned=True))
