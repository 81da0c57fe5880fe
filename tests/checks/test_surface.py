"""Faces through one another, against exact fractions and closed forms."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from texbake import CheckOptions, Mesh, check
from texbake.checks import surface
from texbake.checks.checked_mesh import CheckedMesh
from texbake.checks.surface import crossed_by
from texbake.mesh.compose import join_meshes
from texbake.mesh.shapes import cube, icosphere, plane


def crossed(mesh):
    others, unsure = crossed_by(CheckedMesh(mesh, "high", CheckOptions()))
    assert not unsure.any()
    return (others >= 0).tolist()


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def dot(a, b):
    return sum((x * y for x, y in zip(a, b, strict=True)), Fraction(0))


def minus(a, b):
    return [x - y for x, y in zip(a, b, strict=True)]


def exactly_crosses(one, other):
    """Whether the insides of two triangles in different planes have a line in common."""
    normals = [cross(minus(t[1], t[0]), minus(t[2], t[0])) for t in (one, other)]
    along = cross(*normals)
    pieces = []
    for triangle, normal, point in ((one, normals[1], other[0]), (other, normals[0], one[0])):
        heights = [dot(normal, minus(corner, point)) for corner in triangle]
        if not min(heights) < 0 < max(heights):
            return False
        places = [dot(along, corner) for corner in triangle]
        ends = [
            places[i] + (places[j] - places[i]) * heights[i] / (heights[i] - heights[j])
            for i, j in ((0, 1), (1, 2), (2, 0))
            if (heights[i] < 0) != (heights[j] < 0)
        ]
        pieces.append((min(ends), max(ends)))
    return max(pieces[0][0], pieces[1][0]) < min(pieces[0][1], pieces[1][1])


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1), st.integers(2, 9))
def test_agrees_with_exact_fractions(seed, side):
    """On a coarse lattice, where corners lie on faces and edges on edges as often as not."""
    random = np.random.default_rng(seed)
    points = random.integers(0, side, (9, 3)).astype(float)
    mesh = Mesh(positions=points, faces=random.integers(0, 9, (10, 3)))
    corners = [[[Fraction(int(x)) for x in p] for p in t] for t in points[mesh.faces].tolist()]
    expected = [
        any(i != j and exactly_crosses(one, other) for j, other in enumerate(corners))
        for i, one in enumerate(corners)
    ]
    assert crossed(mesh) == expected


@pytest.mark.parametrize("mesh", [cube(), icosphere(3), plane(9, 7)])
def test_neighbors_and_copies_do_not_cross(mesh):
    assert not any(crossed(mesh))
    assert not any(crossed(join_meshes([mesh, mesh])))


def test_parts_that_stand_on_one_another_do_not_cross():
    box = cube()
    upper = box.replace(positions=box.positions * 0.3 + [0.1, 0.1, 0.65])
    assert not any(crossed(join_meshes([box, upper])))
    # Rounding to float32 far from the origin is no crossing either.
    both = join_meshes([box, upper])
    moved = (both.positions + 1234.5).astype(np.float32)
    assert not any(crossed(both.replace(positions=moved)))


@pytest.mark.parametrize("scale", [1e-310, 1e-12, 1.0, 1e12, 1e300])
def test_a_box_through_the_top_of_another(scale):
    """Its four sides cross the two faces of the top, each its half of them."""
    box = cube()
    upper = box.replace(positions=box.positions * 0.25 + [0.01, 0.02, 0.5])
    both = join_meshes([box, upper])
    found = crossed(both.replace(positions=both.positions * scale))
    up = np.cross(*(np.diff(both.positions[both.faces], axis=1)[:, i] for i in (0, 1)))[:, 2] != 0
    top = up[:12] & (both.positions[both.faces[:12]][..., 2] > 0).all(axis=1)
    sides = ~up[12:]
    assert found[:12] == top.tolist()
    assert found[12:] == sides.tolist()


def test_a_thousand_sheets_through_one_another_are_found_quickly():
    angles = np.arange(1000) * np.pi / 1000
    up = np.array([0.0, 0.0, 1.0])
    ways = np.stack([np.cos(angles), np.sin(angles), np.zeros(1000)], axis=1)
    corners = np.stack([-ways - up, ways - up, 0.3 * ways + up], axis=1)
    mesh = Mesh(positions=corners.reshape(-1, 3), faces=np.arange(3000).reshape(-1, 3))
    assert all(crossed(mesh))
    found = check(mesh).finding("self-intersections")
    assert found is not None and found.count == 1000
    assert "passes through face" in found.problem


@pytest.fixture
def few_pairs(monkeypatch):
    """Faces are given up after those of one leaf of the tree."""
    monkeypatch.setattr(surface, "_MAX_PAIRS", 0)
    monkeypatch.setattr(surface, "_MIN_PAIRS_PER_FACE", 1)


def test_undecided_faces_are_reported_where_none_is_crossed(few_pairs):
    """Each face of a sphere touches its neighbors, of more than one leaf; none crosses another."""
    mesh = icosphere(3)
    report = check(mesh)
    assert report.finding("self-intersections") is None
    found = report.finding("undecided-intersections")
    assert found is not None and found.severity == "note"
    assert found.count == len(found.faces) > mesh.n_faces / 2
    areas = CheckedMesh(mesh, "high", CheckOptions()).areas
    assert areas[found.faces[0]] == areas[found.faces].max()


def test_undecided_faces_are_reported_beside_crossed_ones(few_pairs):
    """Two spheres through one another, and what of it the first leaf of each face shows."""
    ball = icosphere(3)
    other = ball.replace(positions=ball.positions + np.array([1.0, 0.1, 0.2]))
    report = check(join_meshes([ball, other]))
    found = report.finding("self-intersections")
    assert found is not None and " more faces were not decided" in found.problem
    assert report.finding("undecided-intersections") is None


def test_nothing_is_given_up_in_common_meshes():
    assert check(icosphere(4)).finding("undecided-intersections") is None
