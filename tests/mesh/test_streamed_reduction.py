"""A mesh that is reduced in pieces while its file is read: as close, as closed, as colored."""

from dataclasses import replace

import numpy as np
import pytest

from texbake import Mesh, SimplifyOptions, read_mesh, surface_distance, write_mesh
from texbake.mesh.shapes import grid_sphere, uv_sphere
from texbake.mesh.streamed import reduction, source
from texbake.mesh.topology import find_edges
from texbake.mesh.weld import weld_rows
from texbake.verbs.simplify import simplify_file

OPTIONS = SimplifyOptions(n_faces=500)


@pytest.fixture(autouse=True)
def _small_pieces(monkeypatch):
    monkeypatch.setattr(source, "ROWS_PER_BLOCK", 1_000)
    monkeypatch.setattr(reduction, "AT_ONCE", 9_000)


def bumpy(n=100):
    ball = uv_sphere(n, n, lambda a, b: 1 + 0.05 * np.sin(5 * a) * np.sin(7 * b))
    return Mesh(positions=ball.positions, faces=ball.faces)


def simplified(mesh, folder, options=OPTIONS, suffix=".ply", **given):
    """What is left of a mesh in pieces, and the report on it."""
    path = folder / f"mesh{suffix}"
    write_mesh(mesh, path)
    options = replace(options, max_memory="1M")
    done = simplify_file(path, folder / "low.ply", options, **given)
    assert done.report.n_faces_before == mesh.n_faces
    return read_mesh(folder / "low.ply"), done.report


def n_open_edges(mesh):
    edges = find_edges(weld_rows(mesh.positions)[mesh.faces])
    return int(np.count_nonzero(edges.boundary)) + int(np.count_nonzero(edges.non_manifold))


@pytest.mark.parametrize("suffix", [".ply", ".stl"])
@pytest.mark.parametrize("quality", ["fast", "best"])
def test_a_closed_surface_stays_closed_and_close(tmp_path, suffix, quality):
    mesh, options = bumpy(), replace(OPTIONS, quality=quality)
    low, report = simplified(mesh, tmp_path, options, suffix)
    assert "in pieces, which were first reduced to" in report.notes[0]
    assert (low.n_faces, n_open_edges(low)) == (500, 0)
    whole = simplify_file(tmp_path / f"mesh{suffix}", tmp_path / "whole.ply", options).report
    assert whole.notes == ()
    distance = surface_distance(mesh, low).rms
    assert distance < 1.15 * whole.distance.rms
    assert report.distance.rms == pytest.approx(distance, rel=0.05)


def test_threads_change_nothing(tmp_path):
    files = []
    for threads in (1, 3):
        simplified(bumpy(), tmp_path, threads=threads)
        files.append((tmp_path / "low.ply").read_bytes())
    assert files[0] == files[1]


def test_an_open_surface_keeps_its_outline(tmp_path):
    sheet = grid_sphere(120, 120)
    low_half = sheet.positions[sheet.faces][:, :, 1].max(axis=1) < 0.3
    sheet = Mesh(positions=sheet.positions, faces=sheet.faces[low_half])
    low, _ = simplified(sheet, tmp_path)
    np.testing.assert_allclose(low.bounds, sheet.bounds, atol=0.01)
    edges = find_edges(weld_rows(low.positions)[low.faces])
    assert 0 < np.count_nonzero(edges.boundary) < 120 and not edges.non_manifold.any()


def test_parts_far_apart_and_faces_in_any_order(tmp_path):
    ball = bumpy()
    positions = np.vstack([ball.positions, ball.positions + np.array([300.0, 0.0, 0.0])])
    faces = np.vstack([ball.faces, ball.faces + np.int32(ball.n_vertices)])
    faces = np.random.default_rng(0).permutation(faces)
    low, _ = simplified(Mesh(positions=positions, faces=faces), tmp_path)
    assert (low.n_faces, n_open_edges(low)) == (500, 0)
    np.testing.assert_allclose(low.bounds[1, 0] - low.bounds[0, 0], 302.0, atol=0.2)


@pytest.mark.parametrize(("at_once", "most"), [(9_000, 0.04), (1 << 20, 0.01)])
def test_doubled_faces_and_faces_without_area(tmp_path, monkeypatch, at_once, most):
    """Copies in one piece count once; in different pieces, they become surfaces that differ."""
    monkeypatch.setattr(reduction, "AT_ONCE", at_once)
    ball = bumpy()
    flat = np.repeat(ball.faces[:500, :1], 3, axis=1)
    faces = np.vstack([ball.faces, flat, ball.faces])
    low, _ = simplified(Mesh(positions=ball.positions, faces=faces), tmp_path)
    assert low.n_faces <= 500
    assert surface_distance(ball, low).rms < most


def test_a_surface_around_the_mesh_keeps_the_note_on_the_pieces(tmp_path):
    ball = bumpy()
    holes = Mesh(positions=ball.positions, faces=ball.faces[np.arange(ball.n_faces) % 7 > 0])
    _, report = simplified(holes, tmp_path, replace(OPTIONS, topology="simplify"))
    assert "closed surface around" in report.notes[0] and "in pieces" in report.notes[1]


def test_colors_follow_and_hard_edges_stay(tmp_path):
    """Two halves of a ball, with vertices of their own where they meet."""
    ball = bumpy()
    sides = (ball.positions[ball.faces][:, :, 1].mean(axis=1) > 0.0).astype(np.int32)
    faces = ball.faces + ball.n_vertices * sides[:, None]
    of_vertices = np.repeat([0.0, 1.0], ball.n_vertices)
    mesh = Mesh(
        positions=np.vstack([ball.positions, ball.positions]),
        faces=faces,
        colors=np.repeat(np.float32(of_vertices)[:, None], 3, axis=1),
        normals=np.stack([0.0 * of_vertices, 2.0 * of_vertices - 1.0, 0.0 * of_vertices], axis=1),
        normal_faces=faces,
    )
    low, report = simplified(mesh, tmp_path)
    assert "in pieces" in report.notes[0]
    up = low.normals[low.normal_faces][:, :, 1]
    assert set(np.unique(up)) == {-1.0, 1.0}
    assert (up == up[:, :1]).all()
    is_inside = np.abs(low.positions[low.faces][:, :, 1]) > 1e-6  # a place has one color
    np.testing.assert_array_equal(2.0 * low.colors[low.faces][is_inside, 0] - 1.0, up[is_inside])
    assert n_open_edges(low) == 0


def test_texture_coordinates_and_errors_need_the_whole_mesh(tmp_path):
    for mesh, options in ((uv_sphere(60, 60), OPTIONS), (bumpy(30), SimplifyOptions(error="5%"))):
        _, report = simplified(mesh, tmp_path, options)
        assert [note for note in report.notes if "read whole, which exceeds `max_memory`" in note]
