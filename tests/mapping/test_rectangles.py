"""Strips and tubes that become rectangles: where they do, and what they keep."""

from itertools import pairwise

import numpy as np
import pytest

import texbake as tb
from texbake.core import core
from texbake.errors import OptionError
from texbake.mapping.atlas.cutting.cut import surface_of
from texbake.mapping.atlas.rectangles import MOST_L2, tube_charts
from texbake.mapping.corner_uvs import signed_areas
from texbake.mapping.overlap import find_overlaps
from texbake.mapping.seams import chart_ids, seam_edges
from texbake.mapping.stretch import face_stretch
from texbake.mapping.unwrap import unwrap_with_report
from texbake.mesh.compose import join_meshes
from texbake.mesh.shapes import icosphere
from texbake.mesh.topology import opposite_half_edges


def grid(n_x, n_y):
    """Faces of a grid of squares, and its (n, 2) points from 0 to 1."""
    x, y = np.meshgrid(np.linspace(0.0, 1.0, n_x + 1), np.linspace(0.0, 1.0, n_y + 1))
    first = (np.arange(n_y)[:, None] * (n_x + 1) + np.arange(n_x)).ravel()
    quads = np.stack([first, first + 1, first + n_x + 2, first + n_x + 1], axis=1)
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.int32)
    return np.ascontiguousarray(faces), np.stack([x.ravel(), y.ravel()], axis=1)


def sector(angle, width):
    """A part of a flat ring of radius 1."""
    faces, at = grid(24, 4)
    radius, turn = 1.0 + width * (at[:, 1] - 0.5), angle * at[:, 0]
    points = np.stack([radius * np.sin(turn), radius * np.cos(turn), 0.0 * turn], axis=1)
    return tb.Mesh(positions=points, faces=faces[:, ::-1], name="sector")


def pipe(bend):
    """A pipe of 16 x 24 quads about an arc, open at its ends; and a seam along it."""
    faces, at = grid(16, 24)
    around, along = 2.0 * np.pi * at[:, 0], bend * (at[:, 1] - 0.5)
    out, up = 0.2 * np.cos(around), 0.2 * np.sin(around)
    radius = 4.0 / bend + out
    points = np.stack([radius * np.cos(along), radius * np.sin(along), up], axis=1)
    points, joined = np.unique(points.round(9), axis=0, return_inverse=True)
    seam = joined.ravel().reshape(25, 17)[:, 0]
    mesh = tb.Mesh(positions=points, faces=joined.ravel()[faces].astype(np.int32), name="pipe")
    return mesh, list(pairwise(seam.tolist()))


def box_fill(mesh):
    """Share of each chart in its bounding box."""
    ids, corners = chart_ids(mesh), mesh.corner_uvs()
    areas = np.bincount(ids, signed_areas(corners))
    boxes = [np.ptp(corners[ids == chart].reshape(-1, 2), axis=0).prod() for chart in set(ids)]
    return areas / boxes


def l2(mesh):
    found = face_stretch(mesh)
    return np.sqrt((found.areas * found.l2**2).sum() / found.areas.sum())


@pytest.mark.parametrize("quality", ["fast", "good"])
def test_a_bent_strip_becomes_a_rectangle_along_u_and_v(quality):
    mesh = sector(1.0, 0.3)
    changes = {"quality": quality, "seams": np.empty((0, 2), int), "size": 256}
    assert box_fill(tb.unwrap(mesh, **changes)).max() < 0.8
    straight = tb.unwrap(mesh, straighten=True, **changes)
    assert np.allclose(box_fill(straight), 1.0)
    assert (signed_areas(straight.corner_uvs()) > 0.0).all()
    assert 1.0 < l2(straight) < MOST_L2


def test_a_strip_that_would_stretch_too_much_keeps_its_layout():
    changes = {"seams": np.empty((0, 2), int), "size": 256}
    for mesh in (sector(2.5, 1.4), sector(0.2, 1.0)):  # bent too much; hardly longer than wide
        straight = tb.unwrap(mesh, straighten=True, **changes)
        assert np.array_equal(straight.uvs, tb.unwrap(mesh, **changes).uvs)
    mesh = sector(1.0, 0.3)
    bounded = tb.unwrap(mesh, straighten=True, max_stretch=1.001, **changes)
    assert np.array_equal(bounded.uvs, tb.unwrap(mesh, max_stretch=1.001, **changes).uvs)


def test_the_sides_of_a_seam_along_a_tube_match():
    mesh, seam = pipe(1.5)
    flat = tb.unwrap(mesh, seams=seam, straighten=True)
    assert np.allclose(box_fill(flat), 1.0)
    places = np.zeros((mesh.n_vertices, 2, 2))  # least and greatest (u, v) of each vertex
    corners = flat.corner_uvs().reshape(-1, 2)
    for way, (pick, start) in enumerate(((np.minimum, np.inf), (np.maximum, -np.inf))):
        places[:, way] = start
        pick.at(places[:, way], flat.faces.ravel(), corners)
    gaps = np.ptp(places[np.unique(seam)], axis=1)
    assert np.allclose(gaps.min(axis=1), 0.0, atol=1e-6)  # at the same place along the tube
    assert np.allclose(gaps.max(axis=1), gaps.max())


@pytest.mark.parametrize("quality", ["fast", "good"])
@pytest.mark.parametrize("bend", [1.5, 2.0 * np.pi])  # the last one is a torus
def test_tubes_are_cut_open_whole(quality, bend):
    mesh, _ = pipe(bend)
    flat = tb.unwrap(mesh, quality=quality, straighten=True)
    assert chart_ids(flat).max() + 1 == 2  # as long as all charts are wide, at most
    assert (signed_areas(flat.corner_uvs()) > 0.0).all()
    assert np.allclose(box_fill(flat), 1.0) and l2(flat) < MOST_L2


def twisted(closed):
    """A tube or a torus of 16 x 24 quads, whose diagonals run straight along it."""
    j, i = (each.ravel() for each in np.divmod(np.arange(24 * 16), 16))
    n_rings = 24 if closed else 25
    around = 2.0 * np.pi * np.add.outer(np.arange(n_rings), np.arange(16)).ravel() / 16.0
    along = np.repeat(np.arange(n_rings), 16) * (2.0 * np.pi / 24.0)
    if closed:
        radius = 4.0 + np.cos(around)
        points = [radius * np.cos(along), np.sin(around), radius * np.sin(along)]
    else:
        points = [np.cos(around), 2.3 * along, np.sin(around)]
    ring, right, turn = (j + 1) % n_rings * 16, (i + 1) % 16, 8 if closed else 0
    upper, upper_right = ((each - turn * (j == 23)) % 16 + ring for each in (i, right))
    corners = np.stack([16 * j + i, upper, upper_right, 16 * j + right], axis=1)
    faces = corners[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3).astype(np.int32)
    polygons = np.repeat(np.arange(24 * 16, dtype=np.int32), 2)
    return tb.Mesh(
        positions=np.stack(points, axis=1), faces=faces, polygon_of=polygons, name="twisted"
    )


@pytest.mark.parametrize("closed", [False, True], ids=["tube", "torus"])
def test_no_polygon_of_a_tube_is_cut(closed):
    mesh = twisted(closed)
    flat = tb.unwrap(mesh, straighten=True)
    assert np.allclose(box_fill(flat), 1.0)
    opposite = opposite_half_edges(mesh.faces)
    edges = np.flatnonzero(opposite >= 0)
    inner = edges[mesh.polygon_of[edges // 3] == mesh.polygon_of[opposite[edges] // 3]]
    assert len(inner) == mesh.n_faces
    assert not seam_edges(flat).ravel()[inner].any()


@pytest.mark.parametrize("height", [0.3, 0.8, 1.0, 1.3])
def test_short_tubes_are_unrolled_too(height):
    tube = tb.make("cylinder", sides=24, height=2.0 * np.pi * height).replace(
        uvs=None, uv_faces=None
    )
    assert len(tube_charts(surface_of(tube), MOST_L2)) == 1


def test_a_pipe_between_caps_is_a_tube_and_a_flat_ring_is_none():
    capped = tb.make("cylinder", sides=24, caps=True, height=4.0).replace(uvs=None, uv_faces=None)
    flat = tb.unwrap(capped, straighten=True)
    sizes = np.bincount(chart_ids(flat))
    assert sorted(sizes.tolist()) == [24, 24, 48]
    assert np.isclose(box_fill(flat)[sizes.argmax()], 1.0)
    ring = sector(2.0 * np.pi, 0.5)
    points, joined = np.unique(ring.positions.round(9), axis=0, return_inverse=True)
    ring = tb.Mesh(positions=points, faces=joined.ravel()[ring.faces], name="ring")
    assert tube_charts(surface_of(ring), MOST_L2) == []


def test_a_ribbon_is_unrolled_whole():
    flat = tb.unwrap(sector(1.5, 0.1), straighten=True)
    assert chart_ids(flat).max() + 1 == np.ceil(1.5 / np.sqrt(0.15) / 1.15)
    assert np.allclose(box_fill(flat), 1.0)


@pytest.mark.parametrize("changes", [{"protect": [0, 1]}, {"seams": []}, {"symmetry": "overlap"}])
def test_the_report_says_where_no_tube_is_unrolled(changes):
    _, report = unwrap_with_report(pipe(1.5)[0], straighten=True, quality="fast", **changes)
    assert any(note.startswith("no tube is unrolled where seams are") for note in report.notes)


@pytest.mark.parametrize("quality", ["good", "best"])
def test_other_parts_beside_a_tube_are_cut_as_ever(quality):
    tube, ball = pipe(1.5)[0], icosphere(2)
    both = join_meshes([ball, tube])
    flat = tb.unwrap(both, straighten=True, quality=quality)
    assert np.isclose(box_fill(flat)[chart_ids(flat)[-1]], 1.0)
    ids = chart_ids(flat)
    assert len(set(ids[ball.n_faces :])) == 1
    assert not np.isin(ids[: ball.n_faces], ids[-1]).any()
    assert (signed_areas(flat.corner_uvs()) > 0.0).all()
    assert not find_overlaps(flat.corner_uvs()).overlapping.any()


def test_fixed_vertices_stay_and_the_others_find_their_places():
    faces, at = grid(6, 4)
    points = np.column_stack([at * [3.0, 2.0], np.zeros(len(at))])
    fixed = ((at == 0.0) | (at == 1.0)).any(axis=1)
    uvs, figures = np.where(fixed[:, None], points[:, :2], 9.0), np.empty(3)
    assert core.flatten_within(points, faces, fixed, 50, 1e-6, uvs, figures)
    assert np.allclose(uvs - uvs[0], points[:, :2], atol=1e-4)
    assert np.allclose(figures, [1.0, 4.0, 1.0], atol=1e-4)
    uvs = np.ascontiguousarray(points[:, :2] * [-1.0, 1.0])
    assert not core.flatten_within(points, faces, fixed, 50, 1e-6, uvs, figures)


def test_kept_charts_are_not_straightened():
    with pytest.raises(OptionError, match="straighten: charts that are kept"):
        tb.UnwrapOptions(keep=True, straighten=True)
