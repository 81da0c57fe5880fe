import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from texbake.mapping.atlas.cutting.repair import repair_charts
from texbake.mapping.corner_uvs import signed_areas
from texbake.mapping.overlap import find_overlaps
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import plane

NO_CHART = 2**32 - 1


def repaired(mesh, uvs, chart_ids):
    return repair_charts(
        mesh.positions[mesh.faces], mesh.faces.astype(np.uint32), np.asarray(uvs, dtype=np.float32),
        np.asarray(chart_ids, dtype=np.uint32),
    )  # fmt: skip


@given(
    st.floats(0.2, 5.0), st.floats(0.2, 5.0), st.floats(-2.0, 2.0), st.booleans(),
    st.floats(-50.0, 50.0),
)  # fmt: skip
def test_a_linear_map_of_a_flat_chart_is_undone(a, b, shear, mirror, offset):
    mesh = plane(4, 3)
    matrix = np.array([[a, shear], [0.0, b]]) @ np.diag([-1.0 if mirror else 1.0, 1.0])
    charts = repaired(mesh, mesh.uvs @ matrix.T + offset, np.zeros(mesh.n_vertices))
    flat, space = (
        np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        for corners in (charts.uvs[charts.faces], mesh.positions[mesh.faces])
    )
    # An edge has two ends, each rounded to float32 in u and v before the map is undone.
    rounding = 2.0**-24 * (np.abs(matrix).sum(axis=1).max() + abs(offset))
    undone = np.linalg.norm(np.linalg.inv(matrix), ord=2)
    assert flat == pytest.approx(space, abs=2.0 * math.sqrt(2.0) * rounding * undone + 1e-12)
    assert (signed_areas(charts.uvs[charts.faces]) > 0.0).all()
    assert charts.n_mirrored == mirror
    assert (charts.n_charts, charts.n_ignored, charts.n_split) == (1, 0, 0)


def test_every_chart_gets_its_own_map():
    square = plane()
    both = np.concatenate([square.faces, square.faces + 4])
    mesh = Mesh(positions=np.concatenate([square.positions, square.positions * 0.5]), faces=both)
    uvs = np.concatenate([square.uvs * [3.0, 1.0], square.uvs * [-1.0, 7.0]])
    charts = repaired(mesh, uvs, np.repeat([5, 3], 4))
    assert (charts.n_charts, charts.n_mirrored) == (2, 1)
    areas = signed_areas(charts.uvs[charts.faces])
    assert areas == pytest.approx([0.5, 0.5, 0.125, 0.125], rel=1e-6)


def test_no_chart_at_all():
    assert repaired(plane(), np.zeros((4, 2)), np.full(4, NO_CHART)) is None


def test_faces_of_a_chart_without_area_become_charts_of_their_own():
    for uvs in np.zeros((4, 2)), plane().uvs * [1.0, 0.0]:
        charts = repaired(plane(), uvs, np.zeros(4))
        assert charts is not None and charts.n_charts == 2
        assert signed_areas(charts.uvs[charts.faces]) == pytest.approx([0.5, 0.5], rel=1e-12)


def test_a_folded_face_is_laid_out_for_itself():
    mesh = plane(3, 3)
    uvs = mesh.uvs.copy()
    uvs[0] = uvs[5] + (uvs[5] - uvs[0]) * 0.3  # the corner, beyond the diagonal
    charts = repaired(mesh, uvs, np.zeros(mesh.n_vertices))
    corners = charts.uvs[charts.faces]
    assert (signed_areas(corners) > 0.0).all()
    # Faces of one chart do not overlap; those of different charts may, before they are packed.
    face_charts = charts.chart_ids[charts.faces[:, 0]]
    for chart in range(charts.n_charts):
        assert not find_overlaps(corners[face_charts == chart]).overlapping.any()
    assert charts.n_split == charts.n_charts - 1 > 0
    assert charts.n_ignored == 0


def test_a_chart_that_lies_on_itself_is_taken_apart():
    # Two squares one above the other, joined by a face that stands upright between them.
    square = plane()
    positions = np.concatenate([square.positions, square.positions + np.array([0, 0, 1.0])])
    faces = np.concatenate([square.faces, square.faces + 4])
    charts = repaired(
        Mesh(positions=positions, faces=faces), np.tile(square.uvs, (2, 1)), np.zeros(8)
    )
    assert (charts.n_charts, charts.n_split) == (2, 1)
    assert charts.chart_ids[charts.faces[:, 0]].tolist() == [0, 0, 1, 1]


def test_a_mirrored_sliver_becomes_a_point():
    width = 2.0**-20
    mesh = Mesh(
        positions=[[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.5, -width, 0]], faces=[[0, 1, 2], [0, 3, 1]]
    )
    charts = repaired(mesh, [[0, 0], [1, 0], [0, 1], [0.5, width]], np.zeros(4))
    assert (charts.n_charts, charts.n_ignored, charts.n_split) == (1, 1, 0)
    assert len(set(charts.faces[1].tolist())) == 1
