"""Which meshes are wrapped before they are simplified, and why."""

import numpy as np
import pytest
from skimage.filters import gaussian
from skimage.measure import euler_number, label

from tests.models import handles, level_surface
from texbake import Mesh, make, surface_distance
from texbake.core import core
from texbake.mesh.compose import join_meshes
from texbake.mesh.distance import face_areas
from texbake.mesh.shapes import cube, icosphere, plane
from texbake.mesh.topology import face_components, find_edges
from texbake.mesh.wrapping import reason_to_wrap, wraps

BALL = icosphere(4)


def with_more(mesh, positions, faces):
    return Mesh(
        positions=np.concatenate([mesh.positions, positions]),
        faces=np.concatenate([mesh.faces, np.asarray(faces) + mesh.n_vertices]),
        name="made.ply",
    )


def half(mesh):
    return mesh.replace(faces=mesh.faces[mesh.positions[mesh.faces].mean(axis=1)[:, 2] > 0.0])


DOUBLED = with_more(BALL, BALL.positions * 0.8, BALL.faces[:, ::-1])
# On each of 40 edges a third face stands upright.
_ROOTS = BALL.positions[BALL.faces[:40, :2]]
FINS = with_more(
    BALL,
    np.concatenate([_ROOTS, 1.2 * _ROOTS[:, :1]], axis=1).reshape(-1, 3),
    np.arange(120).reshape(-1, 3),
)


@pytest.mark.parametrize(
    "mesh",
    [BALL, make("torus"), plane(9, 9), half(BALL), half(DOUBLED), make("mobius"),
     with_more(BALL, cube().positions + 3.0, cube().faces)],
    ids=["ball", "torus", "plane", "bowl", "two bowls", "mobius", "two parts"],
)  # fmt: skip
def test_clean_and_open_surfaces_stay(mesh):
    assert reason_to_wrap(mesh, 100) is None


def test_an_inside_is_a_reason():
    # The inner ball has 0.64 of the area of the outer one: 39 % of the whole.
    assert reason_to_wrap(DOUBLED, 100).text == "39 % of its surface lies inside"
    closed, width, _ = next(wraps(DOUBLED, 100))
    assert find_edges(closed.faces).closed and width == 0.0
    assert np.linalg.norm(closed.positions, axis=1).min() > 0.99


def test_edges_of_three_faces_are_a_reason():
    n_torn = int(np.count_nonzero(find_edges(FINS.faces).non_manifold))
    assert n_torn == 0  # until vertices at one place are joined
    assert "edges have more than two faces" in reason_to_wrap(FINS, 100).text


def test_holes_of_a_body_are_filled():
    torn = icosphere(3).replace(faces=icosphere(3).faces[9:])
    closed, width, _ = next(wraps(torn, 4))
    assert find_edges(closed.faces).closed and width == 0.0


def foam(n=64, width=1.6):
    """A ball of noise, of a genus in the hundreds."""
    noise = gaussian(np.random.default_rng(3).standard_normal((n, n, n)), width)
    radii = np.linalg.norm(np.indices((n, n, n)) - (n - 1) / 2.0, axis=0)
    field = np.minimum(noise / noise.std() + 0.2, 0.45 * n - radii)
    mesh = level_surface(np.pad(field, 2, constant_values=-9.0), 0.0)
    return mesh.replace(faces=mesh.faces[:, ::-1], name="foam.ply")


def test_a_wrap_has_no_more_tunnels_than_its_triangles_can_show():
    mesh, n_faces = foam(), 300
    assert handles(mesh) > 100
    reason = reason_to_wrap(mesh, n_faces)
    assert reason.has_tunnels and "cannot show its tunnels" in reason.text
    (wrap, width, _), *others = wraps(mesh, n_faces, has_tunnels=True)
    for other, other_width, _ in others:
        assert (handles(other) > n_faces / 60) == (other_width < width)
    assert handles(wrap) <= n_faces / 60
    assert 0.0 < width < 0.1 * mesh.diagonal
    # What fills a pore is carved out again: the wrap stays beside the mesh.
    assert surface_distance(wrap, mesh).a_to_b.rms < 0.02 * mesh.diagonal
    assert reason_to_wrap(wrap, n_faces) is None


def test_a_wrap_has_no_part_smaller_than_a_triangle():
    mesh, n_faces = foam(), 300
    speck = icosphere(1)
    specks = [speck.replace(positions=1.5 * speck.positions + place) for place in (0.0, 67.0)]
    wrap, _, n_left_out = next(wraps(join_meshes([mesh, *specks]), n_faces, has_tunnels=True))
    ids, n_parts = face_components(wrap.faces, wrap.n_vertices)
    areas = np.bincount(ids, face_areas(wrap.positions, wrap.faces))
    assert n_left_out >= len(specks)
    assert n_parts == 1 and areas.min() > areas.sum() / n_faces


def test_carving_leaves_what_is_kept_and_opens_no_tunnel():
    mesh = foam(24)
    grid = np.zeros((32, 32, 32), dtype=bool)
    grid[4:28, 4:28, 4:28] = True  # a block, of which the noise is kept
    kept = np.zeros_like(grid)
    kept[tuple(np.rint(mesh.positions).astype(int).T + 2)] = True
    kept &= grid
    solid = grid.copy()
    n_gone = core.carve_tunnels(kept, solid, 1 << 30)
    assert n_gone == np.count_nonzero(grid & ~solid) > 1_000
    assert solid[kept].all()
    # Euler's number of solid points that touch at corners: parts - tunnels + rooms.
    parts, rooms = (label(s, connectivity=c).max() for s, c in ((solid, 3), (~solid, 1)))
    assert euler_number(solid, connectivity=3) == parts + rooms - 1
