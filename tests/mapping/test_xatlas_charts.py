import numpy as np
import pytest

from texbake.mapping.atlas.cutting.xatlas_charts import plain_charts
from texbake.mapping.corner_uvs import signed_areas, surface_areas
from texbake.mapping.seams import chart_ids
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import cube, grid_sphere


def test_a_cube_comes_apart_in_its_sides():
    mesh = cube()
    faces, uvs, ids = plain_charts(mesh.positions, mesh.faces)
    assert np.bincount(ids).tolist() == [4] * 6
    assert signed_areas(uvs[faces]) == pytest.approx(np.full(12, 0.5))


def test_no_face_is_mirrored_or_squashed():
    mesh = grid_sphere(24, 48)
    faces, uvs, ids = plain_charts(mesh.positions, mesh.faces)
    ratios = signed_areas(uvs[faces]) / surface_areas(mesh.positions[mesh.faces])
    assert ratios.min() >= 0.5 - 1e-9  # the cosine of the cone
    assert ratios.max() <= 1.0 + 1e-9
    assert ids.max() + 1 <= 12


def test_charts_are_connected():
    mesh = grid_sphere(16, 32)
    faces, uvs, ids = plain_charts(mesh.positions, mesh.faces)
    found = chart_ids(mesh.replace(uvs=uvs, uv_faces=faces))
    assert found.max() == ids.max()


def test_faces_without_area_are_charts_of_their_own():
    mesh = Mesh(
        positions=[[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0]], faces=[[0, 1, 2], [0, 1, 3]]
    )
    faces, uvs, ids = plain_charts(mesh.positions, mesh.faces)
    assert np.isfinite(uvs).all()
    assert signed_areas(uvs[faces]).tolist() == [0.0, 0.5]
    assert len(np.unique(ids)) == 2
