import numpy as np
import pytest

from texbake.core import core
from texbake.mapping.atlas.charts import single_face_charts
from texbake.mapping.atlas.cutting.cut import cut_charts, surface_of
from texbake.mapping.atlas.edge_weights import _turning as turning_of, edge_weights
from texbake.mapping.atlas.halves import Halves, image_costs
from texbake.mapping.atlas.joining.join import join_charts
from texbake.mapping.atlas.joining.straighten import straighten_charts
from texbake.mapping.overlap import find_overlaps
from texbake.mapping.seams import seam_edges, seam_length
from texbake.mapping.unwrap import unwrap
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import cube, icosphere, plane, uv_sphere
from texbake.mesh.symmetry import MirrorPlane
from texbake.mesh.topology import opposite_half_edges


def border_of(mesh, labels):
    """Length of the border between labels, and the middles of its edges."""
    opposite = opposite_half_edges(mesh.faces)
    edges = np.flatnonzero(opposite >= 0)
    edges = edges[labels[edges // 3] < labels[opposite[edges] // 3]]
    ends = (
        mesh.positions[mesh.faces.ravel()[edges]],
        mesh.positions[np.roll(mesh.faces, -1, axis=1).ravel()[edges]],
    )
    return float(np.linalg.norm(ends[1] - ends[0], axis=1).sum()), (ends[0] + ends[1]) / 2.0


def straightened(mesh, labels, weights=None, width=1.0):
    weights = np.ones((mesh.n_faces, 3)) if weights is None else weights
    labels = labels.astype(np.int32)
    core.straighten_borders(
        mesh.positions, mesh.faces, opposite_half_edges(mesh.faces), weights, width, labels
    )
    return labels


def centers(mesh):
    return mesh.positions[mesh.faces].mean(axis=1)


def test_a_sawtooth_becomes_a_line():
    mesh = plane(24, 24)
    x, y = centers(mesh)[:, :2].T
    labels = x + 0.12 * np.sin(20.0 * y) > 0.5
    assert border_of(mesh, labels)[0] > 2.4
    # The ends stay, one step apart.
    assert border_of(mesh, straightened(mesh, labels))[0] == pytest.approx(1.0 + 1.0 / 24.0)


def test_a_closed_border_becomes_shorter_and_stays_closed():
    mesh = plane(24, 24)
    x, y = (centers(mesh)[:, :2] - 0.5).T
    labels = np.hypot(x, y) < 0.25 + 0.06 * np.sin(12.0 * np.arctan2(y, x))
    now = straightened(mesh, labels, width=0.2)
    assert border_of(mesh, now)[0] < 0.85 * border_of(mesh, labels)[0]
    assert np.count_nonzero(now) > 0.3 * np.count_nonzero(labels)


def test_a_border_follows_cheap_edges_and_keeps_off_forbidden_ones():
    mesh = plane(24, 24)
    x = centers(mesh)[:, 0]
    corners = mesh.positions[mesh.faces]
    middles = (corners + np.roll(corners, -1, axis=1)) / 2.0
    weights = np.where(np.abs(middles[..., 0] - 14 / 24) < 1e-9, 0.2, 1.0)
    _, places = border_of(mesh, straightened(mesh, x > 0.5, weights))
    assert np.mean(np.abs(places[:, 0] - 14 / 24) < 1e-9) > 0.7
    weights = np.where(np.abs(middles[..., 1] - 0.5) < 0.1, np.inf, 1.0)
    forbidden = straightened(mesh, x > 0.5, weights)
    assert np.array_equal(forbidden, x > 0.5)  # there is no other way across


@pytest.mark.parametrize("quality", ["fast", "good", "best"])
def test_charts_with_straight_borders_do_not_overlap(quality):
    mesh = icosphere(5)
    surface = surface_of(mesh)
    charts = cut_charts(mesh, surface, quality=quality, weights=np.ones((mesh.n_faces, 3)))
    now = straighten_charts(surface, charts, edge_weights(surface).weights)
    before, after = (mesh.replace(uvs=each.uvs, uv_faces=each.faces) for each in (charts, now))
    assert now.n_charts == charts.n_charts
    assert seam_length(after) <= seam_length(before)
    apart = now.uvs + 4.0 * np.stack([now.chart_ids, now.chart_ids], axis=1)
    assert not find_overlaps(apart[now.faces]).overlapping.any()


def test_hard_edges_are_cheap_and_diagonals_of_polygons_are_not_cut():
    mesh = cube()
    mesh = mesh.replace(polygon_of=(np.arange(mesh.n_faces) // 2).astype(np.int32))
    weights = edge_weights(surface_of(mesh)).weights
    diagonals = np.isinf(weights)
    assert np.count_nonzero(diagonals) == mesh.n_faces
    assert (weights[~diagonals] < 0.5).all()
    flat = surface_of(plane(4, 4))
    inner = flat.joints[2] >= 0
    for joined in (True, False):
        assert (
            edge_weights(flat, joined=joined).weights.ravel() == np.where(inner, 3.0, 1.0)
        ).all()


def test_charts_that_cannot_improve_stay():
    mesh = cube()
    surface = surface_of(mesh)
    charts = join_charts(surface, single_face_charts(surface.points, mesh.faces), most_l2=1.001)
    now = straighten_charts(surface, charts, edge_weights(surface).weights)
    cuts = (seam_edges(mesh.replace(uvs=each.uvs, uv_faces=each.faces)) for each in (charts, now))
    assert np.array_equal(*cuts)


def test_seams_are_cheap_where_little_light_comes():
    mesh = plane(32, 32, lambda x, y: 2.0 * np.abs(x - 0.5))  # a groove along x = 1/2
    surface = surface_of(mesh)
    bottom = (np.abs(surface.points[mesh.faces].mean(axis=1)[:, 0]) < 0.05).ravel()
    rim = (np.abs(surface.points[mesh.faces].mean(axis=1)[:, 0]) > 0.2).ravel()
    alike, hidden = (edge_weights(surface, hide=hide, joined=False).weights for hide in (0.0, 1.0))
    inner = surface.joints[2].reshape(-1, 3) >= 0
    assert (alike[rim] == np.where(inner, 3.0, 1.0)[rim]).all()
    assert 1.5 * hidden[bottom].mean() < hidden[rim].mean()


@pytest.mark.parametrize(
    ("height", "waves", "hidden"),
    [(0.1, 3, False), (0.2, 3, True), (0.5, 4, True)],
    ids=["longer", "not longer", "longer, but deep in the shade"],
)
def test_by_default_cuts_are_hidden_unless_that_makes_them_longer(height, waves, hidden):
    mesh = uv_sphere(
        24, 48, lambda theta, phi: 1.0 + height * np.sin(waves * theta) * np.cos(waves * phi)
    )
    uvs = {hide: unwrap(mesh, size=128, hide_seams=hide).uvs for hide in (None, 0.0, 0.5)}
    assert np.array_equal(uvs[None], uvs[0.5]) == hidden
    assert not any(np.array_equal(uvs[0.0], uvs[hide]) for hide in (None, 0.5))


def test_a_surface_turns_at_bumps_and_not_where_it_is_flat_or_creased():
    bumps = plane(
        48, 48, lambda x, y: np.where(x < 0.4, 0.02 * np.sin(60.0 * x) * np.sin(60.0 * y), 0.0)
    )
    surface = surface_of(bumps)
    x = surface.points[bumps.faces].mean(axis=1)[:, 0]
    _, bent, turning = turning_of(surface.points, surface.corners)
    assert bent[x < -0.2].mean() > 0.2 and turning[x < -0.2].mean() > 0.1
    assert max(bent[x > 0.1].max(), turning[x > 0.1].max()) < 1e-6
    # A crease turns in one direction only.
    edge = surface_of(plane(48, 48, lambda x, y: 1.2 * np.abs(x - 0.5)))
    _, bent, turning = turning_of(edge.points, edge.corners)
    assert bent.max() > 0.1
    assert turning.max() < 1e-4  # the square root of the rounding of points to the grid


def face_at(direction, size):
    """A ball whose `direction` shows bumps: the eyes and nose of a face, mirrored about x = 0."""

    def radius(theta, phi):
        x, y, z = np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)
        ahead = y * direction[1] + z * direction[2]
        bumps = np.cos(14.0 * x) * np.cos(14.0 * (y * direction[2] - z * direction[1]))
        return 1.0 + size * bumps * np.clip(3.0 * (ahead - 0.6), 0.0, 1.0)

    return uv_sphere(48, 96, radius)


@pytest.mark.parametrize("direction", [(0, 0, 1), (0, -1, 0), (0, 0.6, -0.8)])
@pytest.mark.parametrize("is_known", [True, False], ids=["plane", "no plane"])
def test_seams_cost_most_in_front(direction, is_known):
    plain, seen = (surface_of(face_at(direction, size)) for size in (0.0, 0.12))
    middle = MirrorPlane(np.array([1.0, 0.0, 0.0]), 0.0, 0.0) if is_known else None
    alike, weights = (
        edge_weights(each, hide=0.5, plane=middle).weights.mean(axis=1) for each in (plain, seen)
    )
    ahead = seen.points[seen.faces].mean(axis=1) @ direction / 0.5
    # Around the bumps, not on them, which cost more anyway.
    near, back = (ahead > 0.3) & (ahead < 0.5), ahead < -0.3
    assert weights[near].mean() > 1.5 * weights[back].mean()
    assert alike[near].mean() == pytest.approx(alike[back].mean(), rel=0.02)


def test_a_border_moves_to_the_mirror_image_of_that_of_the_other_half():
    mesh = plane(24, 24)
    x, y = centers(mesh)[:, :2].T
    surface, sides = surface_of(mesh), np.where(x < 0.5, 1, -1)
    halves = Halves(MirrorPlane(np.array([1.0, 0.0, 0.0]), 0.0, 0.0), sides, None)
    labels = np.where(sides > 0, y > 0.3, y > 0.5)
    costs = image_costs(surface, halves, surface.joints[2], labels)
    labels[sides > 0] = True  # leaves the border of the other half alone
    _, places = border_of(mesh, straightened(mesh, labels, costs, width=0.5))
    inner = places[(places[:, 0] > 0.7) & (places[:, 0] < 0.8)]
    assert len(inner) and (np.abs(inner[:, 1] - 0.3) < 0.03).all()


@pytest.mark.parametrize("seed", [0, 50])  # in 50, the kernel moves such a face alone
def test_faces_without_area_stay_in_one_chart_each(seed):
    ball = icosphere(2)
    rng = np.random.default_rng(seed)
    points = np.round(ball.positions * rng.uniform(0.3, 2.0, 3) * 64.0) / 1024.0
    split = rng.permutation(ball.n_faces)[:106]
    a, b, c = ball.faces[split].T  # each becomes two faces, and one without area at a T-junction
    middle = ball.n_vertices + np.arange(len(split))
    points = np.concatenate([points, (points[a] + points[b]) / 2.0])
    pieces = [(a, middle, c), (middle, b, c), (a, b, middle)]
    faces = np.concatenate(
        [np.delete(ball.faces, split, axis=0), *(np.stack(each, axis=1) for each in pieces)]
    )
    mesh = Mesh(positions=points, faces=faces.astype(np.int32), name="slivers")
    surface = surface_of(mesh)
    weights = edge_weights(surface).weights
    charts = cut_charts(mesh, surface, quality="good", weights=weights)
    now = straighten_charts(surface, charts, weights)
    assert np.array_equal(now.solid, charts.solid)
