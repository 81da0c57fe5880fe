import numpy as np
import pytest

from texbake.mesh.files.conversion import srgb_colors

VERTICES = "0 0 0\n1 0 0\n1 1 0.5\n0 1 0\n"
FACES = "3 0 1 2\n4 0 1 2 3\n"


@pytest.mark.parametrize("end", ["\n", "\r\n"])
@pytest.mark.parametrize(
    "head", ["OFF\n4 2 5\n", "OFF 4 2 0\n", "4 2 0\n", "# a\n\nOFF # b\n4 2\n"]
)
def test_heads_comments_and_polygons(read, head, end):
    text = head + "# vertices\n" + VERTICES + "\n" + FACES.replace("2\n", "2 # red\n", 1)
    mesh = read(text.replace("\n", end))
    assert mesh.positions.tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0.5], [0, 1, 0]]
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 1, 3], [1, 2, 3]]


def test_colors_of_faces_are_skipped_and_points_and_lines_give_no_triangle(read):
    faces = "3 0 1 2 255 0 0\n1 3\n3 0 2 3 0.5 0.5 0.5 1.0\n2 0 1\n0\n4 0 1 2 3 17\n"
    mesh = read("OFF\n4 6 0\n" + VERTICES + faces)
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3], [0, 1, 3], [1, 2, 3]]


def with_columns(columns):
    return "".join(f"{line} {columns}\n" for line in VERTICES.splitlines())


def test_colors_normals_and_texture_coordinates(read):
    mesh = read("COFF\n4 2 0\n" + with_columns("255 0 51 255") + FACES)
    np.testing.assert_allclose(srgb_colors(mesh.colors)[3], [1, 0, 0.2, 1], 1e-6, 1e-7)
    mesh = read("NOFF\n4 2 0\n" + with_columns("0 1 0") + FACES)
    assert mesh.normals[mesh.normal_faces].tolist() == [[[0, 1, 0]] * 3] * 3
    assert mesh.colors is None
    mesh = read("STCNOFF\n4 2 0\n" + with_columns("0 1 0 0.5 0.25 1 0.125 0.75") + FACES)
    assert mesh.corner_uvs().tolist() == [[[0.125, 0.75]] * 3] * 3
    np.testing.assert_allclose(srgb_colors(mesh.colors)[0], [0.5, 0.25, 1], 1e-6)
    assert mesh.normals[0].tolist() == [0, 1, 0]
