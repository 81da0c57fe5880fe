"""The Möbius strip: one side, one border, and a seam that any winding must have."""

import numpy as np
import pytest

from texbake import OptionError, make
from texbake.mesh.normals import face_normals
from texbake.mesh.topology import euler_characteristic, face_components, find_edges


def loops(edges):
    """Number of closed loops that edges make, each of whose vertices two of them have."""
    at = {}
    for a, b in edges.tolist():
        at.setdefault(a, []).append(b)
        at.setdefault(b, []).append(a)
    assert all(len(ends) == 2 for ends in at.values())
    count, left = 0, set(at)
    while left:
        walk = [left.pop()]
        while walk:
            for vertex in at[walk.pop()]:
                if vertex in left:
                    left.remove(vertex)
                    walk.append(vertex)
        count += 1
    return count


@pytest.mark.parametrize("twists", [-3, -1, 0, 1, 2, 3])
@pytest.mark.parametrize("resolution", [(3, 1), (24, 5)])
def test_topology(twists, resolution):
    mesh = make("mobius", twists=twists, resolution=resolution)
    n_u, n_v = resolution
    edges = find_edges(mesh.faces)
    odd = twists % 2 == 1
    assert (mesh.n_vertices, mesh.n_faces) == (n_u * (n_v + 1), 2 * n_u * n_v)
    assert euler_characteristic(mesh.faces, edges) == 0
    assert loops(edges.vertices[edges.boundary]) == (1 if odd else 2)
    assert edges.misoriented.sum() == (n_v if odd else 0)
    assert not edges.non_manifold.any()
    assert face_components(mesh.faces, mesh.n_vertices)[1] == 1


def strip(u, v, twists, radius=1.0, width=0.8):
    angle, turn = 2 * np.pi * (u - 0.5), np.pi * twists * (u - 0.5)
    across = width * (v - 0.5)
    r = radius + across * np.sin(turn)
    return np.stack([r * np.sin(angle), across * np.cos(turn), r * np.cos(angle)], axis=-1)


@pytest.mark.parametrize("twists", [1, 2, -5])
def test_corners_follow_the_closed_form(twists):
    mesh = make("mobius", twists=twists, resolution=(48, 6))
    u, v = mesh.corner_uvs().reshape(-1, 2).T
    points = mesh.positions[mesh.faces].reshape(-1, 3)
    # The cosine of an angle of up to 5 pi / 2, rounded: some 2^-51.
    assert np.abs(points - strip(u, v, twists)).max() < 3e-15
    # Central differences of step h are off by h^2 times third derivatives, of about (2 pi)^3.
    h = 1e-5
    du = strip(u + h, v, twists) - strip(u - h, v, twists)
    dv = strip(u, v + h, twists) - strip(u, v - h, twists)
    expected = np.cross(du, dv)
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    normals = mesh.normals[mesh.normal_faces].reshape(-1, 3)
    assert np.abs(normals - expected).max() < 1e-7


def test_normals_jump_to_the_other_side_at_the_seam_and_nowhere_else():
    mesh = make("mobius", resolution=(64, 4))
    u = mesh.corner_uvs()[..., 0].ravel()
    vertices, normals = mesh.faces.ravel(), mesh.normals[mesh.normal_faces].reshape(-1, 3)
    for vertex in set(vertices[u == 0.0].tolist()):
        start = normals[(vertices == vertex) & (u == 0.0)]
        end = normals[(vertices == vertex) & (u == 1.0)]
        assert (start == start[0]).all()
        assert (end == -start[0]).all()
    within = (u > 0.0) & (u < 1.0)
    pairs = np.unique(np.column_stack([vertices, mesh.normal_faces.ravel()])[within], axis=0)
    assert len(np.unique(pairs[:, 0])) == len(pairs)


def test_faces_look_where_their_normals_do():
    mesh = make("mobius")
    corners = mesh.normals[mesh.normal_faces]
    assert np.einsum("fi,fci->fc", face_normals(mesh), corners).min() > 0.99


def test_its_front_stands_upright():
    mesh = make("mobius", resolution=(4, 2), radius=2, width=1)
    assert [0.0, 0.5, 2.0] in mesh.positions.tolist()
    assert [0.0, -0.5, 2.0] in mesh.positions.tolist()


@pytest.mark.parametrize("options", [{"width": 2.0}, {"twists": 200}, {"twists": 10**30}])
def test_strips_that_cannot_be(options):
    with pytest.raises(OptionError, match=r"width: 2\.0 is not|twists: .* raise the resolution"):
        make("mobius", **options)
