"""Pockets: what counts as one, and how its mouth is closed."""

import numpy as np
import pytest

from texbake.mapping.atlas.choice import whole_bodies
from texbake.mapping.atlas.cutting.cut import cut_charts, surface_of
from texbake.mapping.atlas.cutting.pockets import close_mouths, find_pockets
from texbake.mapping.atlas.edge_weights import edge_weights
from texbake.mapping.atlas.joining.join import join_charts
from texbake.mapping.atlas.source import ChartSource
from texbake.mapping.options import UnwrapOptions
from texbake.mesh.mesh import Mesh
from texbake.progress import Stages

N_AROUND = 32


def turned(profile):
    """A closed surface about z; `profile` (k, 2): radii, 0 at the ends, and heights."""
    profile = np.asarray(profile, dtype=float)
    angles = 2.0 * np.pi * np.arange(N_AROUND) / N_AROUND
    rings = [
        np.column_stack([r * np.cos(angles), r * np.sin(angles), np.full(N_AROUND, z)])
        for r, z in profile[1:-1]
    ]
    ends = np.array([(0.0, 0.0, profile[0, 1]), (0.0, 0.0, profile[-1, 1])])
    n = len(rings) * N_AROUND
    faces = []
    for i in range(N_AROUND):
        j = (i + 1) % N_AROUND
        faces += [(n, j, i), (n + 1, n - N_AROUND + i, n - N_AROUND + j)]
        for ring in range(len(rings) - 1):
            a, b = ring * N_AROUND, (ring + 1) * N_AROUND
            faces += [(a + i, a + j, b + j), (a + i, b + j, b + i)]
    faces = np.array(faces, dtype=np.int32)
    return Mesh(positions=np.concatenate([*rings, ends]), faces=faces, name="turned")


def vase(mouth, depth):
    """A ball with a hollow as wide as its mouth, down from the top."""
    outer = np.linspace(-np.pi / 2.0, np.arccos(mouth), 40)
    ball = np.column_stack([np.cos(outer), np.sin(outer)])
    ball[0, 0] = 0.0
    rim = np.sqrt(1.0 - mouth**2)
    inner = np.linspace(0.0, np.pi / 2.0, 12)[1:]
    walls = np.column_stack([np.full(20, mouth), rim - np.linspace(0.02, depth, 20)])
    bottom = np.column_stack([mouth * np.cos(inner), rim - depth - mouth * np.sin(inner)])
    bottom[-1, 0] = 0.0
    return turned(np.concatenate([ball, walls, bottom]))


@pytest.mark.parametrize(("depth", "n_pockets"), [(0.1, 0), (1.2, 1)])
def test_a_deep_hollow_is_a_pocket_and_a_shallow_one_is_not(depth, n_pockets):
    mesh = vase(0.25, depth)
    surface = surface_of(mesh)
    pockets = find_pockets(surface, edge_weights(surface, hide=1.0).weights)
    assert pockets.max() == n_pockets
    centers = mesh.positions[mesh.faces].mean(axis=1)
    is_inside = np.hypot(*centers.T[:2]) < 0.251
    assert (is_inside | (centers[:, 2] < 0.0) | (pockets == 0)).all()


def test_a_pocket_and_the_surface_around_it_are_charts_of_their_own():
    mesh = vase(0.25, 1.2)
    surface = surface_of(mesh)
    weights = edge_weights(surface, hide=1.0).weights
    pockets = find_pockets(surface, weights)
    others = cut_charts(mesh, surface, weights=weights)
    charts = whole_bodies(surface, others, weights)[0]
    owners = charts.chart_ids[charts.faces[:, 0]]
    assert not set(owners[pockets == 0]) & set(owners[pockets == 1])
    assert len(set(owners[pockets == 1])) == 1


def test_charts_of_a_pocket_are_not_joined_to_those_around_it():
    mesh = vase(0.25, 1.2)
    source = ChartSource.of_mesh(mesh, UnwrapOptions(hide_seams=1.0), Stages(None))
    charts = cut_charts(mesh, source.apart, weights=source.weights)
    bounds = {"most_l2": 9.0, "most_chart_l2": 9.0, "most_share": 1.0, "most_waste": np.inf}
    for surface, is_apart in ((source.apart_as(charts), True), (source.surface, False)):
        joined = join_charts(surface, charts, **bounds)
        owners = joined.chart_ids[joined.faces[:, 0]]
        inside, outside = owners[source.pockets > 0], owners[source.pockets == 0]
        assert set(inside).isdisjoint(outside) == is_apart


@pytest.mark.parametrize("options", [{"quality": "fast"}, {"hide_seams": 0.0}])
def test_pockets_stay_where_charts_are_not_joined_and_where_seams_are_to_be_short(options):
    source = ChartSource.of_mesh(vase(0.25, 1.2), UnwrapOptions(**options), Stages(None))
    assert source.pockets is None and source.apart is source.surface


def test_closed_mouths_leave_no_border_and_keep_the_vertices_together():
    mesh = vase(0.25, 1.2)
    surface = surface_of(mesh)
    corners, _, opposite = surface.joints
    pockets = find_pockets(surface, edge_weights(surface, hide=1.0).weights)
    is_mouth = np.repeat(pockets, 3) != pockets[opposite // 3]
    out = np.flatnonzero(pockets == 0)
    numbers = np.full(len(corners), -1)
    numbers[out] = np.arange(len(out))
    own, across = is_mouth.reshape(-1, 3)[out].ravel(), opposite.reshape(-1, 3)[out].ravel()
    cut = np.where(own, -1, 3 * numbers[across // 3] + across % 3).astype(np.int32)
    points, closed, weights = close_mouths(
        surface.points[corners[out]], cut, np.ones(3 * len(out)), own
    )
    n_added = len(points) - len(out)
    assert n_added == np.count_nonzero(own) > 0
    assert (closed >= 0).all()
    np.testing.assert_array_equal(closed[closed], np.arange(len(closed)))
    ends = points.reshape(-1, 3), np.roll(points, -1, axis=1).reshape(-1, 3)
    np.testing.assert_allclose(ends[0], ends[1][closed], atol=1e-12)
    assert np.isinf(weights[3 * len(out) :].reshape(-1, 3)[:, 1:]).all()
    # A border of the surface itself stays open.
    same = close_mouths(surface.points[corners[out]], cut, np.ones(3 * len(out)), own & False)
    assert len(same[0]) == len(out)
