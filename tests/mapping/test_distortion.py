import json
import math

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, strategies as st

from texbake.errors import UvError
from texbake.mapping.distortion import distortion
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import cube, plane


def mapped(mesh: Mesh, matrix: npt.ArrayLike) -> Mesh:
    """A mesh whose coordinates went through a linear map."""
    assert mesh.uvs is not None
    return mesh.replace(uvs=mesh.uvs @ np.transpose(matrix))


def squares_of_scales(*scales: float) -> Mesh:
    """Unit squares side by side in space, and in the texture each scaled by its own factor."""
    square = plane()
    positions = [square.positions + np.array([2.0 * i, 0.0, 0.0]) for i in range(len(scales))]
    assert square.uvs is not None
    uvs = [square.uvs * scale + np.array([20.0 * i, 0.0]) for i, scale in enumerate(scales)]
    faces = np.concatenate([square.faces + 4 * i for i in range(len(scales))])
    return Mesh(
        positions=np.concatenate(positions), faces=faces, uvs=np.concatenate(uvs), uv_faces=faces
    )


@given(st.floats(0.0, 6.3), st.floats(-3.0, 3.0), st.floats(-6.0, 6.0))
def test_similarities_have_no_distortion(angle: float, log_size: float, log_texture: float) -> None:
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


def test_twice_as_long_one_way() -> None:
    # σ = √2 and 1/√2 once areas are equal.
    found = distortion(mapped(plane(4, 4), [[2.0, 0.0], [0.0, 1.0]])).stretch
    assert found.l2 == pytest.approx(math.sqrt((2.0 + 0.5) / 2.0))
    assert found.linf == pytest.approx(math.sqrt(2.0))
    assert found.symmetric_dirichlet == pytest.approx(2.0 * (2.0 + 0.5))
    assert found.quasi_conformal == pytest.approx(2.0)
    assert found.angle == pytest.approx(2.0 + 0.5 - 2.0)
    assert found.area == pytest.approx(0.0, abs=1e-12)


@given(st.floats(0.01, 5.0))
def test_shear(k: float) -> None:
    # [[1, k], [0, 1]]: σ1 σ2 = 1 and σ1² + σ2² = 2 + k², whose roots are (√(k² + 4) ± k) / 2.
    greater = (math.sqrt(k * k + 4.0) + k) / 2.0
    found = distortion(mapped(plane(2, 2), [[1.0, k], [0.0, 1.0]])).stretch
    assert found.l2 == pytest.approx(math.sqrt((2.0 + k * k) / 2.0))
    assert found.linf == pytest.approx(greater)
    assert found.symmetric_dirichlet == pytest.approx(2.0 * (2.0 + k * k))
    assert found.quasi_conformal == pytest.approx(greater**2)


def test_two_charts_of_unlike_size() -> None:
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


def test_a_prism_unrolled_keeps_its_shape_and_has_one_seam() -> None:
    n, height = 12, 3.0
    angles = 2.0 * math.pi * np.arange(n) / n
    ring = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    low, high = (np.insert(ring, 2, z, axis=1) for z in (0.0, height))
    side = 2.0 * math.sin(math.pi / n)
    here = np.arange(n)
    after, columns = (here + 1) % n, here + 1
    faces = np.concatenate(
        [np.stack([here, after, n + after], 1), np.stack([here, n + after, n + here], 1)]
    )
    m = n + 1
    uv_faces = np.concatenate(
        [np.stack([here, columns, m + columns], 1), np.stack([here, m + columns, m + here], 1)]
    )
    u = np.arange(m) * side
    uvs = np.concatenate([np.stack([u, 0 * u], 1), np.stack([u, 0 * u + height], 1)]) / (n * side)
    found = distortion(
        Mesh(positions=np.concatenate([low, high]), faces=faces, uvs=uvs, uv_faces=uv_faces)
    )
    assert found.stretch.l2 == pytest.approx(1.0, abs=1e-12)
    assert found.stretch.symmetric_dirichlet == pytest.approx(4.0, abs=1e-12)
    assert found.seam_length == pytest.approx(height, rel=1e-12)
    assert found.n_charts == 1


def test_a_mirrored_face_has_infinite_stretch_and_finite_angles() -> None:
    found = distortion(mapped(plane(), [[-1.0, 0.0], [0.0, 1.0]]))
    assert found.n_mirrored == 2
    assert math.isinf(found.stretch.l2)
    assert math.isinf(found.stretch.linf)
    assert math.isinf(found.stretch.symmetric_dirichlet)
    assert found.stretch.quasi_conformal == pytest.approx(1.0)
    written = json.loads(json.dumps(found.to_json(), allow_nan=False))
    assert written["l2"] is None
    assert written["n_mirrored"] == 2


def test_faces_without_area_are_counted_and_left_out() -> None:
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


def test_a_wide_texture_is_measured_in_square_texels() -> None:
    mesh = mapped(plane(), [[0.5, 0.0], [0.0, 1.0]])
    assert distortion(mesh, size=(2048, 1024)).stretch.l2 == pytest.approx(1.0)
    assert distortion(mesh, size=1024).stretch.quasi_conformal == pytest.approx(2.0)


def test_two_charts_and_the_worst_faces_are_named() -> None:
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


def test_no_more_than_ten_faces_are_named_and_they_are_the_worst() -> None:
    mesh = plane(10, 1)
    assert mesh.uvs is not None
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


def test_one_mirrored_face_among_many() -> None:
    mesh = plane(4, 4)
    assert mesh.uvs is not None
    assert mesh.uv_faces is not None
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


def test_tiles_of_faces() -> None:
    mesh = squares_of_scales(1.0, 1.0)  # at u 0 and 20
    found = distortion(mesh)
    assert (found.n_tiles, found.fill, found.packing_efficiency) == pytest.approx((2, 2.0, 1.0))


def test_everything_is_written_as_json() -> None:
    found = distortion(mapped(plane(), [[-1.0, 0.0], [0.0, 1.0]]))
    written = json.loads(json.dumps(found.to_json(), allow_nan=False))
    assert written["charts"][0]["l2"] is None
    assert written["charts"][0]["l2_alone"] is None
    assert written["charts"][0]["n_faces"] == 2
    assert written["turned_stretch"]["l2"] == pytest.approx(1.0)
    assert written["worst_faces"][0]["mirrored"] is True
    assert {"seam_length", "fill", "packing_efficiency", "n_overlapping", "n_unsure"} <= set(
        written
    )


def test_errors() -> None:
    with pytest.raises(UvError, match="no texture coordinates"):
        distortion(cube())
    with pytest.raises(UvError, match="none of its faces has an area both"):
        distortion(mapped(plane(), np.zeros((2, 2))))
    line = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0]], dtype=float)
    faces = np.array([[0, 1, 2]], dtype=np.int32)
    with pytest.raises(UvError, match=r"none of its faces has an area; .* texbake info"):
        distortion(Mesh(positions=line, faces=faces, uvs=line[:, :2], uv_faces=faces))
