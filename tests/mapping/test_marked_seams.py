"""Seams that a person marked: charts are cut there, and nowhere else if that is possible."""

import numpy as np
import pytest

from texbake.errors import FileFormatError, OptionError
from texbake.mapping.marked_seams import marked_edges, read_seams
from texbake.mapping.options import UnwrapOptions
from texbake.mapping.seams import chart_ids, seam_edges
from texbake.mapping.unwrap import unwrap, unwrap_together, unwrap_with_report
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import plane, uv_sphere


def bare(mesh):
    return mesh.replace(uvs=None, uv_faces=None)


def edges_of(mesh, marked):
    faces, corners = np.nonzero(marked)
    return np.stack([mesh.faces[faces, corners], mesh.faces[faces, (corners + 1) % 3]], axis=1)


def meridian(mesh):
    """(E, 2) edges of a sphere from pole to pole, in the plane z = 0, x > 0."""
    on = np.flatnonzero((np.abs(mesh.positions[:, 2]) < 1e-9) & (mesh.positions[:, 0] > -1e-9))
    on = on[np.argsort(mesh.positions[on, 1], kind="stable")]
    pairs = np.stack([on[:-1], on[1:]], axis=1)
    steps = mesh.positions[pairs[:, 1]] - mesh.positions[pairs[:, 0]]
    return pairs[np.linalg.norm(steps, axis=1) > 1e-9]


def torus(n=24, m=16):
    """A torus whose texture coordinates are those of a sheet rolled up twice."""
    sheet = plane(n, m)
    u, v = 2.0 * np.pi * sheet.uvs.T
    ring = 2.0 + np.cos(v)
    points = np.stack([ring * np.cos(u), np.sin(v), ring * np.sin(u)], axis=1)
    return sheet.replace(
        positions=np.round(points, 9) + 0.0,
        faces=sheet.faces[:, ::-1].copy(),
        uv_faces=sheet.uv_faces[:, ::-1].copy(),
    )


def n_overlapping(report):
    return report.distortion.n_overlapping + report.distortion.n_mirrored


@pytest.mark.parametrize("quality", ["fast", "good", "best"])
def test_a_ball_is_cut_along_its_meridian_alone(quality):
    ball = bare(uv_sphere(24, 24))
    marked = marked_edges(ball, meridian(ball))
    result, report = unwrap_with_report(ball, seams=meridian(ball), quality=quality)
    assert np.array_equal(seam_edges(result), marked)
    assert report.n_charts == 1 and report.notes == () and n_overlapping(report) == 0


def test_a_torus_becomes_a_sheet_or_a_tube_that_is_cut_open():
    loops = seam_edges(torus())
    sheet = unwrap(bare(torus()), seams=edges_of(torus(), loops))
    assert np.array_equal(seam_edges(sheet), loops)
    heights = torus().positions[torus().faces][:, :, 1]
    is_flat = np.abs(heights - np.roll(heights, -1, axis=1)) < 1e-9
    tube, report = unwrap_with_report(
        bare(torus()), seams=edges_of(torus(), loops & is_flat), quality="fast"
    )
    assert report.n_charts == 1 and n_overlapping(report) == 0
    assert (seam_edges(tube) >= (loops & is_flat)).all()


def test_a_piece_that_cannot_be_laid_flat_is_cut_and_noted():
    ball = bare(uv_sphere(16, 16))
    _, report = unwrap_with_report(ball, seams=np.empty((0, 2), int))
    assert report.n_charts == 2 and n_overlapping(report) == 0
    assert report.notes == (
        "the marked seams leave 1 piece, which became 2 charts: some pieces needed further cuts "
        "to be laid flat without overlaps",
    )


def test_the_seams_of_a_mesh_are_kept_and_its_charts_flattened_again():
    ball = uv_sphere(24, 48)
    stretched = ball.replace(uvs=ball.uvs * [0.2, 1.0])
    result, report = unwrap_with_report(stretched, keep_seams=True)
    assert np.array_equal(seam_edges(result), seam_edges(ball))
    assert report.n_charts == 1 and n_overlapping(report) == 0
    assert report.distortion.turned_stretch.l2 < 1.2
    again = unwrap(result, keep_seams=True)
    assert np.array_equal(chart_ids(again), chart_ids(result))


def test_a_layout_with_flipped_faces_is_flattened_again_between_its_seams():
    flat = unwrap(bare(uv_sphere(24, 24)), seams=meridian(uv_sphere(24, 24)))
    folded = np.abs(flat.uvs - [0.51, 0.0])
    result, report = unwrap_with_report(flat.replace(uvs=folded), keep_seams=True)
    assert report.n_charts == 1 and n_overlapping(report) == 0
    assert np.array_equal(seam_edges(result), seam_edges(flat))


def test_a_layout_without_area_still_has_seams():
    flat = unwrap(bare(uv_sphere(24, 24)), seams=meridian(uv_sphere(24, 24)))
    line = flat.replace(uvs=flat.uvs @ np.array([[1.0, 1.0], [1.0, 1.0]]))
    _, report = unwrap_with_report(line, keep_seams=True)
    assert report.n_charts == 1 and n_overlapping(report) == 0


def test_a_bound_on_stretch_cuts_further():
    ball = bare(uv_sphere(24, 24))
    _, report = unwrap_with_report(ball, seams=meridian(ball), max_stretch=1.02)
    assert report.n_charts > 1
    assert max(chart.stretch.l2 for chart in report.distortion.charts) <= 1.02 + 1e-6


def test_lines_of_a_file_are_the_edges_between_their_points(tmp_path):
    ball = bare(uv_sphere(24, 24))
    path, pairs = tmp_path / "seams.obj", meridian(ball)
    on = [*pairs[:, 0], pairs[-1, 1]]
    for chosen in (on, [on[0], on[len(on) // 2], on[-1]]):  # all of them; the shortest way between
        rows = ["v {!r} {!r} {!r}".format(*ball.positions[i].tolist()) for i in chosen]
        numbers = " ".join(str(i + 1) for i in range(len(chosen)))
        path.write_text("\n".join([*rows, f"l {numbers}"]))
        found = marked_edges(ball, read_seams(path, ball))
        assert np.array_equal(found, marked_edges(ball, pairs))


def test_a_way_avoids_the_diagonals_of_polygons(tmp_path):
    square = Mesh(
        positions=np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float),
        faces=np.array([[0, 1, 2], [0, 2, 3]], np.int32),
        polygon_of=np.zeros(2, np.int32),
    )
    (tmp_path / "s.obj").write_text("v 1 0 0\nv 0 1 0\nl -2 -1\n")
    assert len(read_seams(tmp_path / "s.obj", square)) == 2


@pytest.mark.parametrize(("text", "message"), [
    ("v 0 0 0\n", "has no lines"),
    ("v 0 1 0\nv 0 9 0\nl 1 2\n", r"no vertex of .* is at the point \(0, 9, 0\)"),
    ("v 0 1 0\nl 1 2\n", "line 2: a line needs two or more of the vertices above it"),
    ("v 0 1 0\nl 1\n", "line 2: a line needs two or more"),
    ("v 0 1 0\nl 1 x\n", "line 2: 'x' is not a number"),
    ("v 0 1\n", "line 1: it has 2 words; a vertex needs 3 numbers"),
])  # fmt: skip
def test_a_file_that_is_wrong_says_where(tmp_path, text, message):
    (tmp_path / "seams.obj").write_text(text)
    with pytest.raises(FileFormatError, match=message):
        read_seams(tmp_path / "seams.obj", uv_sphere(8, 8))


def test_parts_that_no_edges_join_have_no_way(tmp_path):
    one = bare(uv_sphere(8, 8))
    two = Mesh(
        positions=np.vstack([one.positions, one.positions + np.array([5.0, 0.0, 0.0])]),
        faces=np.vstack([one.faces, one.faces + one.n_vertices]).astype(np.int32),
    )
    (tmp_path / "seams.obj").write_text("v 0 1 0\nv 5 1 0\nl 1 2\n")
    with pytest.raises(FileFormatError, match=r"line 3: no edges of .* join two of its points"):
        read_seams(tmp_path / "seams.obj", two)


@pytest.mark.parametrize(("seams", "message"), [
    ([[0, 10**6]], "a vertex is 1000000; the vertices of .* are 0 to"),
    ([[-1, 2]], "a vertex is -1"),
    ([0, 1, 2], "the array has type int64 and shape .*; pass pairs of vertices"),
    ([[0.0, 1.0]], "the array has type float64"),
    ([[0, 50]], "no edge between its vertices 0 and 50"),
    ([[0, 1], [2]], "seams: it is not an array of numbers"),
])  # fmt: skip
def test_pairs_that_are_no_edges_are_refused(seams, message):
    with pytest.raises(OptionError, match=message):
        unwrap(bare(uv_sphere(8, 8)), seams=seams)


@pytest.mark.parametrize(("options", "message"), [
    ({"keep": True}, "charts that are kept are not cut"),
    ({"charts": "xatlas"}, "xatlas does not follow"),
    ({"method": "box"}, "the method box has no seams"),
])  # fmt: skip
def test_what_seams_do_not_go_with(options, message):
    with pytest.raises(OptionError, match="keep_seams"):
        UnwrapOptions(**options, keep_seams=True)
    with pytest.raises(OptionError, match=f"seams: {message}"):
        unwrap(uv_sphere(8, 8), seams=[[0, 1]], **options)


def test_each_mesh_has_its_seams():
    with pytest.raises(OptionError, match="seams: there are 2 for 1 mesh"):
        unwrap_together([uv_sphere(8, 8)], seams=[None, None])
