"""Charts cut until none is stretched beyond a bound."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from texbake.mapping.atlas.charts import Charts, ChartSurface
from texbake.mapping.atlas.flatten import flatten
from texbake.mapping.atlas.joining.bound import bound_charts
from texbake.mapping.corner_uvs import signed_areas, surface_areas
from texbake.mapping.distortion import Distortion, distortion
from texbake.mapping.overlap import overlapping_faces
from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.mesh.shapes import icosphere, plane


def surface(mesh: Mesh) -> ChartSurface:
    return ChartSurface(points=mesh.positions, faces=mesh.faces)


def one_chart(mesh: Mesh, uvs: FloatArray, faces: IntArray | None = None) -> Charts:
    return Charts(
        uvs=uvs,
        faces=mesh.faces if faces is None else faces,
        chart_ids=np.zeros(len(uvs), dtype=np.int32),
    )


def cap(height: float) -> Mesh:
    """Part of the unit sphere above a height, in one chart."""
    sphere = icosphere(3)
    faces = sphere.faces[(sphere.positions[sphere.faces, 2] > height).all(axis=1)]
    used, flat = np.unique(faces, return_inverse=True)
    return Mesh(positions=sphere.positions[used], faces=flat.reshape(-1, 3).astype(np.int32))


def checked(mesh: Mesh, charts: Charts) -> Distortion:
    """Measure charts, after making sure that they are sound and lose no face."""
    corners = charts.uvs[charts.faces]
    ids = charts.chart_ids[charts.faces]
    assert (ids == ids[:, :1]).all()
    assert (signed_areas(corners) > 0.0).all()
    for chart in range(charts.n_charts):
        assert not overlapping_faces(corners[ids[:, 0] == chart]).any()
    assert signed_areas(corners).sum() == pytest.approx(
        surface_areas(mesh.positions[mesh.faces]).sum(), rel=1e-12
    )
    apart = charts.uvs + 10.0 * charts.chart_ids[:, None]
    measured = distortion(mesh.replace(uvs=apart, uv_faces=charts.faces))
    assert measured.n_charts == charts.n_charts
    return measured


def worst(measured: Distortion) -> float:
    return max(chart.stretch.l2 for chart in measured.charts)


@pytest.mark.parametrize("max_stretch", [1.2, 1.02, 1.005, 1.001])
def test_every_chart_of_a_cap_holds_the_bound(max_stretch: float) -> None:
    mesh = cap(-0.4)
    flat = flatten(mesh.positions, mesh.faces)
    assert flat is not None
    assert flat.l2 > 1.02
    charts = bound_charts(surface(mesh), one_chart(mesh, flat.uvs), max_stretch=max_stretch)
    # Rounding of sums over 900 faces.
    assert worst(checked(mesh, charts)) <= max_stretch + 1e-12
    assert charts.notes == ()
    assert (charts.n_charts > 1) == (max_stretch < flat.l2)


def test_a_bound_next_to_1_leaves_no_vertex_inside_a_chart() -> None:
    mesh = cap(0.8)
    flat = flatten(mesh.positions, mesh.faces)
    assert flat is not None
    charts = bound_charts(surface(mesh), one_chart(mesh, flat.uvs), max_stretch=1.0 + 1e-7)
    assert worst(checked(mesh, charts)) <= 1.0 + 1.1e-7
    # Faces about a vertex of the sphere lack 0.03 rad or more of a full turn, but a polygon that
    # is cut in m triangles, without a vertex inside, has m + 2 vertices and lies flat.
    assert len(charts.uvs) == mesh.n_faces + 2 * charts.n_charts


def test_charts_that_hold_the_bound_stay_as_they_are() -> None:
    mesh = plane(4, 4)
    assert mesh.uvs is not None
    charts = one_chart(mesh, np.array(mesh.uvs))
    assert bound_charts(surface(mesh), charts, max_stretch=1.01) is charts


def test_a_bad_layout_is_relaxed_and_not_cut() -> None:
    mesh = plane(6, 6)
    assert mesh.uvs is not None
    squeezed = np.array(mesh.uvs) ** 2
    charts = bound_charts(surface(mesh), one_chart(mesh, squeezed), max_stretch=1.0001)
    assert charts.n_charts == 1
    assert worst(checked(mesh, charts)) <= 1.0001


def test_a_face_too_thin_to_flatten_is_reported() -> None:
    square = plane()
    positions = np.concatenate([square.positions, [[0.5, -1e-300, 0.0]]])
    mesh = Mesh(positions=positions, faces=np.concatenate([square.faces, [[0, 4, 1]]]))
    uvs = np.concatenate([positions[:4, :2] * [1.0, 3.0], [[0.5, -0.5]]])
    charts = bound_charts(surface(mesh), one_chart(mesh, uvs), max_stretch=1.01)
    assert len(charts.notes) <= 1
    assert all("too thin" in note for note in charts.notes)
    assert np.isfinite(charts.uvs).all()
    assert (charts.faces != charts.faces[:, :1]).any(axis=1).all()


def test_faces_without_a_chart_stay_without() -> None:
    mesh = plane(4, 4)
    assert mesh.uvs is not None
    faces = mesh.faces.copy()
    faces[5] = faces[5, 0]
    uvs = np.array(mesh.uvs) ** 2
    charts = replace(one_chart(mesh, uvs, faces), n_ignored=1)
    bounded = bound_charts(surface(mesh), charts, max_stretch=1.001)
    assert len(set(bounded.faces[5].tolist())) == 1
    assert bounded.n_ignored == 1
