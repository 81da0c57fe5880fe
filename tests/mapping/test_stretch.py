import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from texbake.mapping.stretch import face_stretch, stretch_by_group
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import plane


def triangle_soup(seed: int, n: int = 20) -> Mesh:
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
def test_singular_values_are_those_of_the_matrix_from_texture_to_surface(seed: int) -> None:
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


def test_groups_are_summed_up_by_area() -> None:
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


def test_only_groups_with_a_mirrored_face_are_infinite() -> None:
    mesh = plane(2, 1)
    assert mesh.uvs is not None
    uvs = np.concatenate([mesh.uvs, [[0.0, 0.0], [0.0, 1.0], [1.0, 0.0]]])
    uv_faces = np.array(mesh.uv_faces)
    uv_faces[0] = [6, 7, 8]  # clockwise
    found = face_stretch(mesh.replace(uvs=uvs, uv_faces=uv_faces))
    stretch = stretch_by_group(found, np.array([0, 1, 1, 1]))
    assert found.mirrored.tolist() == [True, False, False, False]
    assert [np.isinf(s.l2) for s in stretch] == [True, False]
    assert stretch[0].to_json()["l2"] is None
    assert all(np.isfinite(s.l2) for s in stretch_by_group(found, np.arange(4), turned=True))
