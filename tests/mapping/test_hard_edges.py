"""Charts end at hard edges and at sharp ones, where asked."""

import numpy as np
import pytest

from texbake import Mesh, OptionError, UnwrapOptions, check, unwrap
from texbake.mapping.seams import chart_ids, regions_between
from texbake.mapping.unwrap import unwrap_with_report
from texbake.mesh.shapes import plane


def roof(degrees):
    """A square that is folded along its middle: faces of both sides meet at an angle."""
    flat = plane(8, 8)
    half = np.radians(degrees) / 2.0
    positions = flat.positions - np.array([0.5, 0.5, 0.0])
    positions[:, 2] = -np.abs(positions[:, 0]) * np.tan(half)
    return Mesh(positions=positions, faces=flat.faces)


def with_normals(mesh, until=np.inf):
    """Smooth normals on either side of the middle, that differ along it up to a height."""
    side = mesh.positions[mesh.faces].mean(axis=1)[:, 0] > 0.0
    normals = np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [-0.6, 0.0, 0.8]])
    corners = mesh.positions[mesh.faces]
    on_edge = (np.abs(corners[:, :, 0]) < 1e-9) & (corners[:, :, 1] < until)
    faces = np.where(on_edge, np.where(side, 1, 2)[:, None], 0)
    return mesh.replace(normals=normals, normal_faces=faces.astype(np.int32))


def sides_of(mesh):
    return mesh.positions[mesh.faces].mean(axis=1)[:, 0] > 0.0


@pytest.mark.parametrize("quality", ["fast", "good", "best"])
def test_charts_end_at_hard_edges(quality):
    mesh = with_normals(roof(10.0))
    plain = unwrap(mesh, quality=quality, size=128)
    cut = unwrap(mesh, quality=quality, size=128, seams_at_hard_edges=True)
    assert len(set(chart_ids(plain))) == 1
    left, right = (set(chart_ids(cut)[side]) for side in (~sides_of(mesh), sides_of(mesh)))
    assert not left & right
    found = [{one.name for one in check(mesh, mesh_).findings} for mesh_ in (plain, cut)]
    assert ["hard-edges-without-seam" in names for names in found] == [True, False]


@pytest.mark.parametrize(("angle", "is_cut"), [(9.0, True), (11.0, False)])
def test_charts_end_at_sharp_edges(angle, is_cut):
    mesh = roof(10.0)
    ids, right = chart_ids(unwrap(mesh, size=128, seam_angle=angle)), sides_of(mesh)
    assert (not set(ids[~right]) & set(ids[right])) == is_cut


def test_regions_stay_divided():
    mesh = roof(10.0)
    given = (mesh.positions[mesh.faces].mean(axis=1)[:, 1] > 0.0).astype(np.int32)
    regions, n_within = regions_between(mesh, hard_edges=True, angle=5.0, regions=given)
    assert n_within == 0
    assert len(set(zip(regions, given, sides_of(mesh), strict=True))) == 4
    assert regions.max() == 3


def test_an_edge_that_ends_within_the_surface_is_told():
    mesh = with_normals(roof(10.0), until=0.01)
    done, report = unwrap_with_report(
        mesh, options=UnwrapOptions(size=128, seams_at_hard_edges=True)
    )
    assert len(set(chart_ids(done))) == 1
    assert "5 hard edges have no seam, because they end within a chart" in report.notes


def test_without_normals_nothing_is_divided():
    assert regions_between(roof(10.0), hard_edges=True, angle=None) == (None, 0)


def test_kept_charts_are_not_cut():
    with pytest.raises(OptionError, match="seam_angle: charts that are kept are not cut"):
        UnwrapOptions(keep=True, seam_angle=30.0)
