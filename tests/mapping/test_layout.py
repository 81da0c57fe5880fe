import numpy as np
import pytest

from texbake.errors import UvError
from texbake.mapping.layout import draw_layout
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import cube, plane


def triangle(*uvs: tuple[float, float]) -> Mesh:
    return Mesh(
        positions=[[0, 0, 0], [1, 0, 0], [0, 1, 0]],
        faces=[[0, 1, 2]],
        uvs=uvs,
        uv_faces=[[0, 1, 2]],
    )


def test_row_0_is_the_top_and_the_rest_is_light() -> None:
    picture = draw_layout(triangle((0, 0.5), (0.5, 1), (0, 1)), size=(80, 40))
    assert picture.shape == (40, 80, 3)
    assert picture.dtype == np.float32
    inside = picture[4, 4]  # the triangle is in the upper left corner
    background = picture[30, 60]
    assert np.ptp(background) == 0.0
    assert background.min() > 0.85
    assert np.ptp(inside) > 0.1
    assert (picture[21:, :] == background).all()
    assert ((picture >= 0.0) & (picture <= 1.0)).all()


def test_a_mirrored_face_is_red() -> None:
    corners = (0.1, 0.1), (0.9, 0.1), (0.1, 0.9)
    right, wrong = (draw_layout(triangle(*uvs), 64)[40, 20] for uvs in (corners, corners[::-1]))
    assert wrong[0] > 10.0 * wrong[1:].max()
    assert not right[0] > 10.0 * right[1:].max()


def test_a_chart_is_outlined_all_around_and_inner_edges_are_fainter() -> None:
    mesh = plane(1, 1)
    assert mesh.uvs is not None
    picture = draw_layout(mesh.replace(uvs=mesh.uvs * 0.5 + 0.25), 64)
    light = picture.sum(axis=2)
    inside, diagonal = light[25, 34], light[32, 31]
    borders = [light[16, 40], light[47, 24], light[40, 16], light[24, 47]]
    assert max(borders) < diagonal < inside


def test_charts_differ_in_color_and_the_same_comes_out_of_any_number_of_threads() -> None:
    corners = np.tile(plane().corner_uvs(), (6, 1, 1)) * 0.15
    corners += np.repeat(np.arange(6), 2)[:, None, None] * 0.16
    mesh = cube().replace(
        uvs=corners.reshape(-1, 2), uv_faces=np.arange(36, dtype=np.int32).reshape(-1, 3)
    )
    picture = draw_layout(mesh, 300, threads=1)
    centers = ((np.arange(6) * 0.16 + 0.05) * 300).astype(int)
    colors = picture[299 - centers, centers + 15]
    assert len(np.unique(colors.round(3), axis=0)) == 6
    assert draw_layout(mesh, 300, threads=3).tobytes() == picture.tobytes()


def test_faces_without_area_and_outside_the_square_are_left_out() -> None:
    blank = draw_layout(triangle((2, 2), (3, 2), (2, 3)), 32)
    assert np.ptp(blank) == 0.0
    assert np.ptp(draw_layout(triangle((-1, -1), (3, -1), (-1, 3)), 32)) > 0.0
    with pytest.raises(UvError):
        draw_layout(cube())
