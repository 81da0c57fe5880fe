import numpy as np
import pytest

from texbake import Mesh, read_mesh, write_mesh
from texbake.mesh.files.conversion import srgb_colors
from texbake.mesh.shapes import icosphere

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


def test_triangles_of_polygons_are_in_the_order_of_the_file(read):
    mesh = read(SQUARE + "v 0.5 2 0\nf 1 2 3 5 4\nf 1 2 3\n")
    assert mesh.faces.tolist() == [[0, 1, 3], [2, 4, 3], [3, 1, 2], [0, 1, 2]]
    assert mesh.uvs is None and mesh.normals is None
    assert mesh.face_groups is None


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_line_ends_blanks_comments_and_byte_order_mark(read, end):
    lines = ["\ufeff# by hand", "", "\tv 0 0 0 # origin", "v  1\t0 0 ", "v 1 1e0 0", "f 1 2 3"]
    mesh = read(end.join(lines))
    assert mesh.positions.tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0]]
    assert mesh.faces.tolist() == [[0, 1, 2]]


def test_backslash_continues_a_statement_but_no_comment(read):
    mesh = read("# C:\\\nv 0 0 \\\n0\nv 1 0\\\r\n 0 # C:\\\nv 1 1 0\nf 1 \\\n 2 \\\n\\\n3\nf 3 2 1")
    assert mesh.positions.tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0]]
    assert mesh.faces.tolist() == [[0, 1, 2], [2, 1, 0]]


def test_separate_indices_of_each_kind(read):
    text = SQUARE + "vt 0.25 0.5\nvt 1 0 0\nvt 0.75\nvn 0 0 1\nvn 0 1 0\nf 1/3/2 2/1/1 3/2/2\n"
    mesh = read(text)
    assert mesh.uvs.tolist() == [[0.25, 0.5], [1, 0], [0.75, 0]]
    assert mesh.uv_faces.tolist() == [[2, 0, 1]]
    assert mesh.normals.tolist() == [[0, 0, 1], [0, 1, 0]]
    assert mesh.normal_faces.tolist() == [[1, 0, 1]]


@pytest.mark.parametrize(
    ("corner", "has_uvs", "has_normals"),
    [("%d", 0, 0), ("%d/%d", 1, 0), ("%d//%d", 0, 1), ("%d/%d/%d", 1, 1), ("%d/", 0, 0)],
)
def test_forms_of_corners(read, corner, has_uvs, has_normals):
    corners = " ".join(corner % ((i,) * corner.count("%d")) for i in (1, 2, 3))
    mesh = read(SQUARE + "vt 0 0\nvt 1 0\nvt 1 1\nvn 1 0 0\nvn 0 1 0\nvn 0 0 1\nf " + corners)
    assert mesh.faces.tolist() == [[0, 1, 2]]
    assert (mesh.uv_faces is not None) == has_uvs
    assert (mesh.normal_faces is not None) == has_normals
    for array in (mesh.uv_faces, mesh.normal_faces):
        assert array is None or array.tolist() == [[0, 1, 2]]


def test_negative_indices_count_back_from_their_line(read):
    mesh = read(
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nf -3/-1 -2/-1 -1/-1\n"
        "v 5 5 5\nv 6 5 5\nv 6 6 5\nvt 1 1\nf -3/-1 -2/-2 -1/-1\n"
    )
    assert mesh.faces.tolist() == [[0, 1, 2], [3, 4, 5]]
    assert mesh.uv_faces.tolist() == [[0, 0, 0], [1, 0, 1]]


def test_corners_without_coordinates_among_others_that_have_them(read):
    mesh = read(SQUARE + "vt 0.5 0.5\nvn 0 0 1\nf 1/1 2/1 3/1\nf 1//1 3//1 4//1\n")
    assert mesh.uvs.tolist() == [[0.5, 0.5], [0, 0]]
    assert mesh.uv_faces.tolist() == [[0, 0, 0], [1, 1, 1]]
    assert mesh.normals.tolist() == [[0, 0, 1], [0, 0, 0]]
    assert mesh.normal_faces.tolist() == [[1, 1, 1], [0, 0, 0]]


def test_colors(read):
    mesh = read("v 0 0 0 0.5 0.25 1\nv 1 0 0\nv 1 1 0 7\nf 1 2 3")  # the third has a weight
    np.testing.assert_allclose(srgb_colors(mesh.colors), [[0.5, 0.25, 1], *[[1, 1, 1]] * 2], 1e-6)
    mesh = read("v 0 0 0 255 0 51\nv 1 0 0 0 0 0\nv 1 1 0\nf 1 2 3")
    expected = [[1, 0, 0.2], [0, 0, 0], [1, 1, 1]]
    np.testing.assert_allclose(srgb_colors(mesh.colors), expected, 1e-6, 1e-7)
    mesh = read("v 0 0 0 1 0 0 .5\nv 1 0 0 0 1 0\nv 1 1 0 0 0 1 1\nf 1 2 3")
    assert mesh.colors.tolist() == [[1, 0, 0, 0.5], [0, 1, 0, 1], [0, 0, 1, 1]]


def test_a_weight_is_not_a_coordinate(read):
    mesh = read("v 0 0 0 2\nv 2 0 0 2.0\nv 2 2 0 1\nf 1 2 3")
    assert mesh.positions[1].tolist() == [2, 0, 0]
    assert mesh.colors is None


def test_groups_and_objects(read):
    text = SQUARE + (
        "f 1 2 3\n"
        "o Körper  mit Raum \nf 1 2 3\n"
        "g arm\nusemtl skin\nf 1 2 3 4\n"
        "o head\nf 1 2 3\n"
        "g head\nf 1 2 3\n"
        "g\nf 1 2 3\n"
        "o Körper  mit Raum\nf 1 2 3\n"
        "g never used\n"
    )
    mesh = read(text)
    names = ("default", "Körper  mit Raum", "Körper  mit Raum/arm", "head")
    assert mesh.group_names == names
    assert mesh.face_groups.tolist() == [0, 1, 2, 2, 3, 3, 3, 1]


def test_materials_are_groups_where_there_are_no_others(read):
    mesh = read(SQUARE + "mtllib a.mtl\nusemtl a\nf 1 2 3\nusemtl b\nf 1 3 4\nusemtl a\nf 1 2 4\n")
    assert (mesh.group_names, mesh.face_groups.tolist()) == (("a", "b"), [0, 1, 0])


def test_name_that_is_not_utf8(read):
    assert read(SQUARE.encode() + b"g caf\xe9\nf 1 2 3\n").group_names == ("café",)


def test_unknown_statements_are_skipped(read):
    mesh = read("mtllib x\ns off\nvp 1 2\n" + SQUARE + "l 1 2\np 1\nfoo bar\n### f 9\nf 1 2 3\n")
    assert mesh.faces.tolist() == [[0, 1, 2]]


def test_round_trip_of_groups_and_colors(tmp_path):
    rng = np.random.default_rng(0)
    mesh = Mesh(
        positions=rng.normal(size=(9, 3)), faces=np.arange(9).reshape(3, 3),
        colors=rng.random((9, 4), dtype=np.float32), face_groups=[0, 1, 0],
        group_names=("a b/ç", "back\\"),
    )  # fmt: skip
    write_mesh(mesh, tmp_path / "mesh.obj")
    again = read_mesh(tmp_path / "mesh.obj")
    assert again.group_names == mesh.group_names
    assert again.face_groups.tolist() == [0, 1, 0]
    assert again.colors.tobytes() == mesh.colors.tobytes()


def test_more_lines_than_a_band(tmp_path):
    # Bands are read side by side; rows, corners and backward indices must not mix.
    n = 100_000
    rng = np.random.default_rng(3)
    positions = rng.normal(size=(n, 3))
    faces = rng.integers(0, n, (n, 3))
    text = "".join(f"v {x!r} {y!r} {z!r}\n" for x, y, z in positions.tolist())
    text += "".join(f"f {a} {b} {c}\n" for a, b, c in (faces - n).tolist())
    (tmp_path / "mesh.obj").write_text(text)
    mesh = read_mesh(tmp_path / "mesh.obj")
    assert mesh.positions.tobytes() == positions.tobytes()
    np.testing.assert_array_equal(mesh.faces, faces)


_CUBE = "".join(f"v {i & 1} {i >> 1 & 1} {i >> 2}\n" for i in range(8))
_SIDES = "f 1 2 6 5\nf 2 4 8 6\nf 4 3 7 8\nf 3 1 5 7\n"
_LIDS = ("f 5 6 8 7\n", "f 1 3 4 2\n")


@pytest.mark.parametrize("statements, n_normals", [
    ("{1}{2}{0}", None),
    ("s 1\n{0}{1}{2}", None),
    ("s off\n{0}{1}{2}", 6),
    ("s 0\n{0}{1}{2}", 6),
    ("{0}{1}{2}s 2\n", 6),  # nothing follows the group
    ("s 1\n{0}s 2\n{1}s 3\n{2}", 10),
    ("f\ns 1\n{0}f\ns 2\n{1}s 3\nf\n{2}f\n", 10),  # faces without corners
    ("s 1\n{0}s off # lids\n{1}{2}", 10),
    ("s 7\n{0}{1}s 8\n{2}", 9),
    ("{1}s 1\n{0}{2}", 9),
    ("o a\ns 1\n{0}usemtl m\n{1}g b\ns 2\n{2}", 9),
])  # fmt: skip
def test_edges_between_smoothing_groups_are_hard(read, statements, n_normals):
    text = _CUBE + statements.format(_SIDES, *_LIDS)
    mesh = read(text)
    assert (None if mesh.normals is None else len(mesh.normals)) == n_normals
    if n_normals == 10:  # the lids are flat, and the sides share normals that are level
        assert sorted(set(np.abs(mesh.normals[:, 2]).round(9))) == [0.0, 1.0]


def test_normals_of_the_file_go_before_smoothing_groups(read):
    assert len(read(SQUARE + "vn 0 0 1\ns off\nf 1//1 2 3\nf 1 3 4\n").normals) == 2


def test_a_finely_curved_surface_without_groups_stays_smooth(tmp_path):
    for level, is_smooth in ((2, False), (5, True)):
        path = tmp_path / f"{level}.obj"
        write_mesh(icosphere(level), path)
        path.write_text(path.read_text().replace("s 1\n", "s off\n"))
        assert (read_mesh(path).normals is None) == is_smooth


@pytest.mark.parametrize("statement", ["usemtl {}\n", "g {}\n", "o {}\n"])
def test_smoothing_groups_name_no_groups(read, statement):
    polygons = zip("sab", (_SIDES, *_LIDS), strict=True)
    parts = [statement.format(name) + faces for name, faces in polygons]
    plain = read(_CUBE + "".join(parts))
    smoothed = read(_CUBE + "s 1\n" + "s 2\n".join(parts))
    assert smoothed.group_names == plain.group_names == ("s", "a", "b")
    assert smoothed.group_objects == plain.group_objects
    np.testing.assert_array_equal(smoothed.face_groups, plain.face_groups)
