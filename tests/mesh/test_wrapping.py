"""Which meshes are wrapped before they are simplified, and why."""

import numpy as np
import pytest

from texbake.mesh.mesh import Mesh
from texbake.mesh.parametric.make import make
from texbake.mesh.shapes import cube, icosphere, plane
from texbake.mesh.topology import find_edges
from texbake.mesh.wrapping import reason_to_wrap, wrapped_if

BALL = icosphere(4)


def with_more(mesh, positions, faces):
    """A mesh and further faces."""
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
    assert reason_to_wrap(mesh) is None
    same, why = wrapped_if(mesh, "auto", 4)
    assert same is mesh and why == ()


def test_an_inside_is_a_reason():
    # The inner ball has 0.64 of the area of the outer one: 39 % of the whole.
    assert reason_to_wrap(DOUBLED) == "39 % of its surface lies inside"
    closed, (why,) = wrapped_if(DOUBLED, "auto", 100)
    assert why.startswith("made.ply: 39 % of its surface lies inside; ")
    assert find_edges(closed.faces).closed
    assert np.linalg.norm(closed.positions, axis=1).min() > 0.99
    assert wrapped_if(DOUBLED, "never", 100) == (DOUBLED, ())
    assert wrapped_if(DOUBLED, "auto", DOUBLED.n_faces) == (DOUBLED, ())


def test_edges_of_three_faces_are_a_reason():
    n_torn = int(np.count_nonzero(find_edges(FINS.faces).non_manifold))
    assert n_torn == 0  # until vertices at one place are joined
    assert "edges have more than two faces" in reason_to_wrap(FINS)


def test_what_is_asked_for_needs_no_reason():
    torn = icosphere(3).replace(faces=icosphere(3).faces[9:])
    closed, why = wrapped_if(torn, "always", 4)
    assert find_edges(closed.faces).closed and why == ()
