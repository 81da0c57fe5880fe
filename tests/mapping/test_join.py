"""Charts joined, and charts cut until none is stretched beyond a bound: bounds and borders hold."""

import math

import numpy as np
import pytest

from tests.models import model, real
from texbake import Mesh, distortion
from texbake.mapping.atlas.charts import Charts, ChartSurface
from texbake.mapping.atlas.flatten import flatten
from texbake.mapping.atlas.joining.bound import bound_charts
from texbake.mapping.atlas.joining.join import join_charts
from texbake.mapping.atlas.joining.pieces import hull_area
from texbake.mapping.corner_uvs import signed_areas, surface_areas
from texbake.mapping.overlap import find_overlaps
from texbake.mapping.stretch import face_stretch
from texbake.mapping.unwrap import unwrap
from texbake.mesh.shapes import cube, icosphere, plane


def surface(mesh, regions=None):
    return ChartSurface(points=mesh.positions, faces=mesh.faces, regions=regions)


def one_chart(mesh, uvs, **more):
    charts = {"uvs": uvs, "faces": mesh.faces, "chart_ids": np.zeros(len(uvs), dtype=np.int32)}
    return Charts(**charts | more)


def charts_by(labels, mesh):
    """Flatten each group of faces alone, with the vertices that they share by index."""
    uvs, chart_ids = [np.empty((0, 2))], [np.empty(0, dtype=np.int32)]
    uv_faces = np.empty_like(mesh.faces)
    for chart, label in enumerate(np.unique(labels)):
        own = labels == label
        vertices, flat_faces = np.unique(mesh.faces[own], return_inverse=True)
        local = flat_faces.reshape(-1, 3).astype(np.int32)
        flat = flatten(mesh.positions[vertices], local)
        assert flat is not None and flat.injective
        uv_faces[own] = local + sum(map(len, uvs))
        uvs.append(flat.uvs)
        chart_ids.append(np.full(len(vertices), chart, dtype=np.int32))
    return Charts(uvs=np.concatenate(uvs), faces=uv_faces, chart_ids=np.concatenate(chart_ids))


def checked(mesh, charts):
    """Measure charts once each face is in one, upright, on nothing, with its area in space."""
    corners = charts.uvs[charts.faces]
    ids = charts.chart_ids[charts.faces]
    assert (ids == ids[:, :1]).all()
    assert (signed_areas(corners) > 0.0).all()
    for chart in range(charts.n_charts):
        own = ids[:, 0] == chart
        assert not find_overlaps(corners[own]).overlapping.any()
        area = surface_areas(mesh.positions[mesh.faces[own]]).sum()
        assert signed_areas(corners[own]).sum() == pytest.approx(area, rel=1e-12)
    # What shares coordinates is what hangs together: nothing else counts as a chart.
    apart = charts.uvs + 10.0 * charts.chart_ids[:, None]
    measured = distortion(mesh.replace(uvs=apart, uv_faces=charts.faces))
    assert measured.n_charts == charts.n_charts
    return measured


def worst(measured):
    return max(chart.stretch.l2 for chart in measured.charts)


def joined(mesh, charts, regions=None, **bounds):
    """Join charts of any size and shape, within bounds, and check the result."""
    anything = {"most_l2": 1.01, "most_share": 1.0, "most_waste": math.inf}
    found = join_charts(surface(mesh, regions), charts, **anything | bounds)
    return found, checked(mesh, found)


def tube(n_around, n_along):
    """Closed ring of quads, each cut in two: a prism, developable along any of its edges."""
    angles = 2.0 * math.pi * np.arange(n_around) / n_around
    heights = np.linspace(0.0, 2.0, n_along + 1)
    points = np.array([[math.cos(a), math.sin(a), z] for z in heights for a in angles])
    ids = np.arange(len(points)).reshape(n_along + 1, n_around)
    low, high = ids[:-1], ids[1:]
    quads = np.stack([low, np.roll(low, -1, 1), np.roll(high, -1, 1), high], axis=-1)
    return Mesh(positions=points, faces=quads[..., [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3))


def octants(mesh):
    """Eight parts of a mesh about the origin."""
    centers = mesh.positions[mesh.faces].mean(axis=1)
    return ((centers > 0.0) @ [1, 2, 4]).astype(np.int32)


@pytest.mark.parametrize(
    ("mesh", "labels"),
    [
        (cube(), np.repeat(np.arange(6), 2)),
        (cube(), np.arange(12)),
        (tube(32, 4), np.arange(256) // 2 % 32 // 4),
    ],
    ids=["sides", "faces", "strips"],
)
def test_developable_charts_unfold_into_one(mesh, labels):
    found, measured = joined(mesh, charts_by(labels, mesh), most_l2=1.0001)
    assert found.n_charts == 1
    assert measured.stretch.l2 == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize(("most_length", "n_charts"), [(math.inf, 1), (1.15, 3), (0.8, 4)])
def test_a_strip_is_joined_up_to_the_length_that_is_allowed(most_length, n_charts):
    # 8 squares in a row: as long as 2.83 sides of a square with their area.
    strip = plane(8, 1).replace(positions=plane(8, 1).positions * [8.0, 1.0, 0.0])
    charts = charts_by(np.arange(16, dtype=np.int32) // 2, strip)
    found, _ = joined(strip, charts, most_l2=1.0001, most_length=most_length)
    ids = range(found.n_charts)
    longest = max(np.ptp(found.uvs[found.chart_ids == k], axis=0).max() for k in ids)
    assert longest <= most_length * math.sqrt(8.0)
    assert found.n_charts >= n_charts
    assert (found.n_charts == 1) == (n_charts == 1)


@pytest.mark.parametrize("most_l2", [1.0, 1.01, 1.03, 1.1])
def test_the_stretch_of_the_mesh_keeps_its_bound(most_l2):
    mesh = icosphere(3)
    charts = charts_by(octants(mesh), mesh)
    before = checked(mesh, charts).stretch.l2
    found, measured = joined(mesh, charts, most_l2=most_l2, most_share=0.3, most_waste=0.25)
    # Rounding of sums over 1,280 faces.
    assert measured.stretch.l2 <= max(before, most_l2) + 1e-12
    # Nothing with a vertex of the sphere inside lies flat without any stretch.
    assert (found.n_charts < 8) == (most_l2 > 1.0)


def test_charts_may_stretch_more_to_remove_a_costly_seam():
    mesh = icosphere(3)
    centers = mesh.positions[mesh.faces].mean(axis=1)
    own = centers[:, 2] > 0.8
    cap = Mesh(positions=mesh.positions, faces=mesh.faces[own])
    charts = charts_by(centers[own, 0] > 0.0, cap)
    whole = charts_by(np.zeros(cap.n_faces), cap)
    most_l2 = (checked(cap, charts).stretch.l2 + checked(cap, whole).stretch.l2) / 2.0
    for weight, n_charts in ((1.0, 2), (3.0, 1)):
        weights = np.full((cap.n_faces, 3), weight)
        found = join_charts(surface(cap), charts, weights=weights, most_l2=most_l2, most_share=1.0)
        assert found.n_charts == n_charts


def test_a_chart_keeps_its_own_bound():
    mesh = icosphere(3)
    charts = charts_by(octants(mesh), mesh)
    _, measured = joined(mesh, charts, most_l2=1.5, most_chart_l2=1.05)
    assert worst(measured) <= 1.05 + 1e-9


def test_no_chart_takes_more_than_its_share():
    mesh = plane(8, 8)
    found, measured = joined(mesh, charts_by(np.arange(mesh.n_faces), mesh), most_share=0.25)
    assert max(chart.area for chart in measured.charts) <= 0.25 + 1e-12
    assert found.n_charts < 16


def test_a_snake_is_cut_into_compact_charts():
    # A ring of squares, all but closed: its hull has a hole of more than half its area.
    n = 12
    grid = plane(n, n)
    centers = grid.positions[grid.faces].mean(axis=1)
    outside = (np.abs(centers[:, :2] - 0.5) > 0.5 - 2.0 / n).any(axis=1)
    outside &= ~((centers[:, 0] > 1.0 - 2.0 / n) & (np.abs(centers[:, 1] - 0.5) < 1.0 / n))
    ring = Mesh(positions=grid.positions, faces=grid.faces[outside])
    charts = charts_by(np.zeros(ring.n_faces, dtype=np.int32), ring)
    found, _ = joined(ring, charts, most_waste=0.3)
    assert 1 < found.n_charts <= 8
    ids = range(found.n_charts)
    hulls = sum(hull_area(found.uvs[found.chart_ids == chart]) for chart in ids)
    assert hulls <= 1.3 * surface_areas(ring.positions[ring.faces]).sum()


def test_no_chart_crosses_regions():
    mesh = plane(8, 8)
    regions = (mesh.positions[mesh.faces].mean(axis=1)[:, 0] > 0.5).astype(np.int32)
    found, _ = joined(mesh, charts_by(np.arange(mesh.n_faces), mesh), regions)
    ids = found.chart_ids[found.faces[:, 0]]
    assert found.n_charts == 2
    assert not set(ids[regions == 0]) & set(ids[regions == 1])


def fan(n_faces, flipped=lambda _: False):
    """Triangles about one edge."""
    angles = 0.3 * np.arange(n_faces)
    outer = np.stack([np.cos(angles), np.sin(angles), np.full(n_faces, 0.5)], axis=1)
    faces = [[1, 0, i + 2] if flipped(i) else [0, 1, i + 2] for i in range(n_faces)]
    return Mesh(positions=np.concatenate([[[0, 0, 0], [0, 0, 1]], outer]), faces=faces)


@pytest.mark.parametrize(("mesh", "n_charts"), [
    (fan(5, lambda i: i % 2 == 0), 5),
    (fan(2), 2),  # both walk the edge in one direction: opposite windings
    (fan(2, lambda i: i == 0), 1),
])  # fmt: skip
def test_only_two_faces_of_one_winding_are_joined(mesh, n_charts):
    found, _ = joined(mesh, charts_by(np.arange(mesh.n_faces), mesh), most_l2=1.5)
    assert found.n_charts == n_charts


def cap(height):
    """Part of the unit sphere above a height, in one chart."""
    sphere = icosphere(3)
    faces = sphere.faces[(sphere.positions[sphere.faces, 2] > height).all(axis=1)]
    used, flat = np.unique(faces, return_inverse=True)
    return Mesh(positions=sphere.positions[used], faces=flat.reshape(-1, 3).astype(np.int32))


@pytest.mark.parametrize("max_stretch", [1.2, 1.02, 1.005, 1.001])
def test_every_chart_of_a_cap_holds_the_bound(max_stretch):
    mesh = cap(-0.4)
    flat = flatten(mesh.positions, mesh.faces)
    assert flat.l2 > 1.02
    charts = bound_charts(surface(mesh), one_chart(mesh, flat.uvs), max_stretch=max_stretch)
    # Rounding of sums over 900 faces.
    assert worst(checked(mesh, charts)) <= max_stretch + 1e-12
    assert charts.notes == ()
    assert (charts.n_charts > 1) == (max_stretch < flat.l2)


def test_a_bound_next_to_1_leaves_no_vertex_inside_a_chart():
    mesh = cap(0.8)
    flat = flatten(mesh.positions, mesh.faces)
    charts = bound_charts(surface(mesh), one_chart(mesh, flat.uvs), max_stretch=1.0 + 1e-7)
    assert worst(checked(mesh, charts)) <= 1.0 + 1.1e-7
    # Faces about a vertex of the sphere lack 0.03 rad or more of a full turn, but a polygon that
    # is cut in m triangles, without a vertex inside, has m + 2 vertices and lies flat.
    assert len(charts.uvs) == mesh.n_faces + 2 * charts.n_charts


def test_a_bad_layout_is_relaxed_and_not_cut_and_a_good_one_kept():
    mesh = plane(6, 6)
    good, squeezed = one_chart(mesh, np.array(mesh.uvs)), one_chart(mesh, np.array(mesh.uvs) ** 2)
    assert bound_charts(surface(mesh), good, max_stretch=1.01) is good
    charts = bound_charts(surface(mesh), squeezed, max_stretch=1.0001)
    assert charts.n_charts == 1
    assert worst(checked(mesh, charts)) <= 1.0001


def test_a_face_too_thin_to_flatten_is_kept():
    square = plane()
    positions = np.concatenate([square.positions, [[0.5, -1e-300, 0.0]]])
    mesh = Mesh(positions=positions, faces=np.concatenate([square.faces, [[0, 4, 1]]]))
    uvs = np.concatenate([positions[:4, :2] * [1.0, 3.0], [[0.5, -0.5]]])
    charts = bound_charts(surface(mesh), one_chart(mesh, uvs), max_stretch=1.01)
    assert all("too thin" in note for note in charts.notes)
    assert np.isfinite(charts.uvs).all() and charts.solid.all()


@pytest.mark.parametrize("change", ["join", "bound"])
def test_faces_without_a_chart_stay_at_a_point_of_their_vertex(change):
    mesh = plane(4, 4)
    faces = mesh.faces.copy()
    faces[5] = faces[5, 0]
    charts = one_chart(mesh, np.array(mesh.uvs) ** 2, faces=faces, n_ignored=1)
    if change == "join":
        found = join_charts(surface(mesh), charts, most_l2=1.1, most_share=1.0)
    else:
        found = bound_charts(surface(mesh), charts, max_stretch=1.001)
    point = found.faces[5, 0]
    assert (found.faces[5] == point).all() and found.n_ignored == 1
    assert point in found.faces[found.solid][(mesh.faces == mesh.faces[5, 0])[found.solid]]


@pytest.mark.parametrize("quality", ["fast", "good"])
@pytest.mark.parametrize("name", real("meshes/1002_tray_bottom.STL", "pairs/spot/low.obj"))
def test_no_face_is_crushed(name, quality):
    mesh = unwrap(model(name), quality=quality)
    # Charts are measured at their own scale, the mesh at one for all.
    assert face_stretch(mesh).greatest.max() < 5.5
