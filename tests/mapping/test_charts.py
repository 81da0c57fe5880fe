import numpy as np
import pytest

from texbake import Mesh, unwrap
from texbake.errors import UvError
from texbake.mapping.atlas.charts import existing_charts
from texbake.mapping.corner_uvs import signed_areas, with_coordinates
from texbake.mapping.overlap import find_overlaps
from texbake.mapping.seams import chart_ids
from texbake.mapping.unwrap import unwrap_with_report
from texbake.mesh.shapes import cube, icosphere, plane


def stacked(mesh):
    return with_coordinates(mesh, np.tile([[0.0, 0], [0.5, 0], [0, 0.5]], (mesh.n_faces, 1, 1)))


def test_charts_keep_their_shapes_and_sizes():
    mesh = unwrap(icosphere(2), size=512)
    packed = unwrap(mesh, keep=True, size=(256, 512), padding=8)
    before, after = (m.corner_uvs() * s for m, s in ((mesh, [1, 2]), (packed, [1, 2])))
    # Square texels: the coordinates of the first were read as those of a texture of 256 x 512.
    ratios = np.linalg.norm(after[:, 1] - after[:, 0], axis=1) / np.linalg.norm(
        before[:, 1] - before[:, 0], axis=1
    )
    assert ratios == pytest.approx(ratios[0], rel=1e-9)
    assert np.array_equal(chart_ids(packed), chart_ids(mesh))


def test_overlapping_faces_are_moved_side_by_side():
    mesh = stacked(cube())
    assert find_overlaps(mesh.corner_uvs()).overlapping.all()
    packed, report = unwrap_with_report(mesh, keep=True)
    assert not find_overlaps(packed.corner_uvs()).overlapping.any()
    assert report.n_charts == 12


@pytest.mark.parametrize("turn", [0, 1, 2])
def test_two_faces_are_one_chart_among_many_single_faces(turn):
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])
    places = 2.0 * np.stack([*np.divmod(np.arange(1500), 50), np.zeros(1500)], axis=1)
    faces = np.concatenate(
        [
            [np.roll([1, 2, 0], turn) + 4 * i, np.roll([2, 1, 3], turn) + 4 * i]
            if i < 100
            else [[4 * i, 4 * i + 1, 4 * i + 2]]
            for i in range(1500)
        ]
    )
    mesh = Mesh(positions=(places[:, None] + corners).reshape(-1, 3), faces=faces)
    assert chart_ids(unwrap(mesh, quality="fast")).max() == 1499


def test_mirrored_charts_stay_mirrored():
    mesh = plane(2, 2)
    mirrored = with_coordinates(mesh, mesh.corner_uvs() * [-1.0, 1.0])
    assert (signed_areas(unwrap(mirrored, keep=True).corner_uvs()) < 0.0).all()


def test_charts_have_the_size_of_the_mesh():
    mesh = plane(3, 2)
    charts = existing_charts(mesh.replace(positions=2.0 * mesh.positions), (512, 512))
    assert np.abs(signed_areas(charts.uvs[charts.faces])).sum() == pytest.approx(1.0)


def test_there_must_be_coordinates_to_keep():
    with pytest.raises(UvError, match="no texture coordinates"):
        unwrap(cube(), keep=True)
    with pytest.raises(UvError, match="no area in the texture"):
        unwrap(with_coordinates(cube(), np.zeros((12, 3, 2))), keep=True)
