"""Charts joined: developable surfaces become one chart, and bounds and borders are kept."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from texbake.mapping.atlas.charts import Charts, ChartSurface
from texbake.mapping.atlas.flatten import flatten
from texbake.mapping.atlas.joining.join import join_charts
from texbake.mapping.atlas.joining.pieces import hull_area
from texbake.mapping.corner_uvs import signed_areas, surface_areas
from texbake.mapping.distortion import distortion
from texbake.mapping.overlap import overlapping_faces
from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.mesh.shapes import cube, icosphere, plane


def surface(points: FloatArray, faces: IntArray) -> ChartSurface:
    return ChartSurface(points=points, faces=faces)


def charts_by(labels: IntArray, points: FloatArray, faces: IntArray) -> Charts:
    """Flatten each group of faces alone, with the vertices that they share by index."""
    uvs, chart_ids = [np.empty((0, 2))], [np.empty(0, dtype=np.int32)]
    uv_faces = np.empty_like(faces)
    for chart, label in enumerate(np.unique(labels)):
        own = labels == label
        vertices, flat_faces = np.unique(faces[own], return_inverse=True)
        local = flat_faces.reshape(-1, 3).astype(np.int32)
        flat = flatten(points[vertices], local)
        assert flat is not None
        assert flat.injective
        uv_faces[own] = local + sum(map(len, uvs))
        uvs.append(flat.uvs)
        chart_ids.append(np.full(len(vertices), chart, dtype=np.int32))
    return Charts(
        uvs=np.concatenate(uvs),
        faces=uv_faces,
        chart_ids=np.concatenate(chart_ids),
    )


def check(points: FloatArray, faces: IntArray, charts: Charts) -> None:
    """Every face lies in one chart, upright, on nothing of its chart, which has its area."""
    corners = charts.uvs[charts.faces]
    ids = charts.chart_ids[charts.faces]
    assert (ids == ids[:, :1]).all()
    assert (signed_areas(corners) > 0.0).all()
    for chart in range(charts.n_charts):
        own = ids[:, 0] == chart
        assert not overlapping_faces(corners[own]).any()
        area = surface_areas(points[faces[own]]).sum()
        assert signed_areas(corners[own]).sum() == pytest.approx(area, rel=1e-12)
    # What shares coordinates is what hangs together: nothing else counts as a chart.
    apart = charts.uvs + 10.0 * charts.chart_ids[:, None]
    mesh = Mesh(positions=points, faces=faces, uvs=apart, uv_faces=charts.faces)
    assert distortion(mesh).n_charts == charts.n_charts


def l2_of(points: FloatArray, faces: IntArray, charts: Charts) -> float:
    mesh = Mesh(positions=points, faces=faces, uvs=charts.uvs, uv_faces=charts.faces)
    return distortion(mesh).stretch.l2


def tube(n_around: int, n_along: int) -> tuple[FloatArray, IntArray]:
    """Closed ring of quads, each cut in two: a prism, developable along any of its edges."""
    angles = 2.0 * math.pi * np.arange(n_around) / n_around
    heights = np.linspace(0.0, 2.0, n_along + 1)
    points = np.array([[math.cos(a), math.sin(a), z] for z in heights for a in angles])
    ids = np.arange(len(points)).reshape(n_along + 1, n_around)
    low, high = ids[:-1], ids[1:]
    quads = np.stack([low, np.roll(low, -1, 1), np.roll(high, -1, 1), high], axis=-1)
    return points, quads[..., [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3).astype(np.int32)


def octants(mesh: Mesh) -> IntArray:
    """Eight parts of a mesh about the origin."""
    centers = mesh.positions[mesh.faces].mean(axis=1)
    return ((centers > 0.0) @ [1, 2, 4]).astype(np.int32)


def test_the_sides_of_a_cube_unfold_into_one_chart() -> None:
    mesh = cube()
    for labels in (np.repeat(np.arange(6), 2), np.arange(12)):
        charts = charts_by(labels, mesh.positions, mesh.faces)
        joined = join_charts(
            surface(mesh.positions, mesh.faces),
            charts,
            most_l2=1.0001,
            most_share=1.0,
            most_waste=math.inf,
        )
        check(mesh.positions, mesh.faces, joined)
        assert joined.n_charts == 1
        assert l2_of(mesh.positions, mesh.faces, joined) == pytest.approx(1.0, abs=1e-6)


def test_the_strips_of_a_tube_unroll_once() -> None:
    points, faces = tube(32, 4)
    labels = (np.arange(len(faces)) // 2 % 32 // 4).astype(np.int32)
    charts = charts_by(labels, points, faces)
    assert charts.n_charts == 8
    joined = join_charts(surface(points, faces), charts, most_l2=1.0001, most_share=1.0)
    check(points, faces, joined)
    assert joined.n_charts == 1
    assert l2_of(points, faces, joined) == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize(("most_length", "n_charts"), [(math.inf, 1), (1.15, 3), (0.8, 4)])
def test_a_strip_is_joined_up_to_the_length_that_is_allowed(
    most_length: float, n_charts: int
) -> None:
    # 8 squares in a row: as long as 2.83 sides of a square with their area.
    flat = plane(8, 1)
    points = flat.positions * [8.0, 1.0, 0.0]
    charts = charts_by(np.arange(16, dtype=np.int32) // 2, points, flat.faces)
    joined = join_charts(
        surface(points, flat.faces), charts, most_l2=1.0001, most_share=1.0, most_length=most_length
    )
    check(points, flat.faces, joined)
    longest = max(
        np.ptp(joined.uvs[joined.chart_ids == k], axis=0).max() for k in range(joined.n_charts)
    )
    assert longest <= most_length * math.sqrt(8.0)
    assert joined.n_charts >= n_charts
    assert (joined.n_charts == 1) == (n_charts == 1)


@pytest.mark.parametrize("most_l2", [1.0, 1.01, 1.03, 1.1])
def test_the_stretch_of_the_mesh_keeps_its_bound(most_l2: float) -> None:
    mesh = icosphere(3)
    charts = charts_by(octants(mesh), mesh.positions, mesh.faces)
    before = l2_of(mesh.positions, mesh.faces, charts)
    joined = join_charts(
        surface(mesh.positions, mesh.faces), charts, most_l2=most_l2, most_share=0.3
    )
    check(mesh.positions, mesh.faces, joined)
    # Rounding of sums over 1,280 faces.
    assert l2_of(mesh.positions, mesh.faces, joined) <= max(before, most_l2) + 1e-12
    # Nothing with a vertex of the sphere inside lies flat without any stretch.
    assert (joined.n_charts < 8) == (most_l2 > 1.0)


def joined_in_any_shape(mesh: Mesh, charts: Charts, **bounds: float) -> Charts:
    return join_charts(
        surface(mesh.positions, mesh.faces), charts, most_share=1.0, most_waste=math.inf, **bounds
    )


def test_a_chart_keeps_its_own_bound() -> None:
    mesh = icosphere(3)
    charts = charts_by(octants(mesh), mesh.positions, mesh.faces)
    joined = joined_in_any_shape(mesh, charts, most_l2=1.5, most_chart_l2=1.05)
    packed = Mesh(positions=mesh.positions, faces=mesh.faces, uvs=joined.uvs, uv_faces=joined.faces)
    assert max(chart.stretch.l2 for chart in distortion(packed).charts) <= 1.05 + 1e-9


def test_no_chart_takes_more_than_its_share() -> None:
    mesh = plane(8, 8)
    charts = charts_by(np.arange(mesh.n_faces), mesh.positions, mesh.faces)
    joined = join_charts(surface(mesh.positions, mesh.faces), charts, most_l2=1.01, most_share=0.25)
    check(mesh.positions, mesh.faces, joined)
    areas = np.bincount(
        joined.chart_ids[joined.faces[:, 0]], surface_areas(mesh.positions[mesh.faces])
    )
    assert areas.max() <= 0.25 + 1e-12
    assert joined.n_charts < 16


def test_a_snake_is_cut_into_compact_charts() -> None:
    # A ring of squares, all but closed: its hull has a hole of more than half its area.
    n = 12
    grid = plane(n, n)
    centers = grid.positions[grid.faces].mean(axis=1)
    outside = (np.abs(centers[:, :2] - 0.5) > 0.5 - 2.0 / n).any(axis=1)
    outside &= ~((centers[:, 0] > 1.0 - 2.0 / n) & (np.abs(centers[:, 1] - 0.5) < 1.0 / n))
    faces = grid.faces[outside]
    charts = charts_by(np.zeros(len(faces), dtype=np.int32), grid.positions, faces)
    joined = join_charts(
        surface(grid.positions, faces), charts, most_l2=1.01, most_share=1.0, most_waste=0.3
    )
    check(grid.positions, faces, joined)
    assert 1 < joined.n_charts <= 8
    ids = range(joined.n_charts)
    hulls = sum(hull_area(joined.uvs[joined.chart_ids == chart]) for chart in ids)
    assert hulls <= 1.3 * surface_areas(grid.positions[faces]).sum()


def test_no_chart_crosses_regions() -> None:
    mesh = plane(8, 8)
    centers = mesh.positions[mesh.faces].mean(axis=1)
    regions = (centers[:, 0] > 0.5).astype(np.int32)
    charts = charts_by(np.arange(mesh.n_faces), mesh.positions, mesh.faces)
    joined = join_charts(
        ChartSurface(points=mesh.positions, faces=mesh.faces, regions=regions),
        charts,
        most_l2=1.01,
        most_share=1.0,
    )
    check(mesh.positions, mesh.faces, joined)
    assert joined.n_charts == 2
    ids = joined.chart_ids[joined.faces[:, 0]]
    assert len(set(ids[regions == 0]) & set(ids[regions == 1])) == 0


def fan(n_faces: int, flipped: Callable[[int], bool] = lambda _: False) -> Mesh:
    """Triangles about one edge."""
    angles = 0.3 * np.arange(n_faces)
    outer = np.stack([np.cos(angles), np.sin(angles), np.full(n_faces, 0.5)], axis=1)
    faces = [[1, 0, i + 2] if flipped(i) else [0, 1, i + 2] for i in range(n_faces)]
    return Mesh(positions=np.concatenate([[[0, 0, 0], [0, 0, 1]], outer]), faces=faces)


@pytest.mark.parametrize(
    ("mesh", "n_charts"),
    [
        (fan(5), 5),
        (fan(5, lambda i: i % 2 == 0), 5),
        (fan(2), 2),  # both walk the edge in one direction: opposite windings
        (fan(2, lambda i: i == 0), 1),
    ],
)
def test_only_two_faces_of_one_winding_are_joined(mesh: Mesh, n_charts: int) -> None:
    charts = charts_by(np.arange(mesh.n_faces), mesh.positions, mesh.faces)
    joined = join_charts(
        surface(mesh.positions, mesh.faces),
        charts,
        most_l2=1.5,
        most_share=1.0,
        most_waste=math.inf,
    )
    check(mesh.positions, mesh.faces, joined)
    assert joined.n_charts == n_charts


def test_faces_without_a_chart_stay_without() -> None:
    mesh = plane(2, 1)
    charts = charts_by(np.arange(4), mesh.positions, mesh.faces)
    faces = charts.faces.copy()
    faces[3] = faces[0, 1]  # a point of the first chart
    kept = charts.faces[:3].ravel()
    thinned = Charts(
        uvs=charts.uvs[kept],
        faces=np.concatenate([np.arange(9, dtype=np.int32).reshape(3, 3), [[1, 1, 1]]]).astype(
            np.int32
        ),
        chart_ids=charts.chart_ids[kept],
        n_ignored=1,
    )
    joined = join_charts(surface(mesh.positions, mesh.faces), thinned, most_l2=1.1, most_share=1.0)
    assert len(set(joined.faces[3].tolist())) == 1
    assert joined.faces[3, 0] == joined.faces[0, 1]
    assert joined.n_ignored == 1
    assert joined.n_charts == 2 - int((joined.chart_ids[joined.faces[:3, 0]] == 0).all())
