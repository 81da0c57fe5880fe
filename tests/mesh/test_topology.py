"""Edges, components and sides of surfaces, against counting one by one; rows that are equal."""

from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from hypothesis.extra import numpy as hnp

from tests.models import flipped, soup_of
from texbake.core import core
from texbake.mesh.mesh import Mesh
from texbake.mesh.normals import degenerate_faces
from texbake.mesh.shapes import cube, icosphere, uv_sphere
from texbake.mesh.topology import (
    duplicate_faces,
    edge_neighbors,
    euler_characteristic,
    face_components,
    find_edges,
    genus,
    surface_side,
)
from texbake.mesh.weld import weld_rows

TETRAHEDRON = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]], dtype=np.int32)


def torus(n, m):
    """Faces of an n x m grid whose opposite sides are one."""
    i, j = np.mgrid[:n, :m]
    a, b = i * m + j, i * m + (j + 1) % m
    c, d = (i + 1) % n * m + j, (i + 1) % n * m + (j + 1) % m
    faces = np.stack([[a, b, c], [b, d, c]]).reshape(2, 3, -1)
    return np.ascontiguousarray(faces.transpose(2, 0, 1).reshape(-1, 3), dtype=np.int32)


def genus_of(faces):
    return genus(faces, find_edges(faces), int(faces.max()) + 1)


def test_tetrahedron():
    edges = find_edges(TETRAHEDRON)
    assert edges.closed and not (edges.boundary | edges.misoriented | edges.non_manifold).any()
    assert (euler_characteristic(TETRAHEDRON, edges), genus_of(TETRAHEDRON)) == (2, 0)


@settings(max_examples=100)
@given(hnp.arrays(np.int32, st.tuples(st.integers(1, 40), st.just(3)), elements=st.integers(0, 9)))
def test_against_counting_one_by_one(faces):
    kept = [face for face in faces.tolist() if len(set(face)) == 3]
    directed = Counter((face[k], face[(k + 1) % 3]) for face in kept for k in range(3))
    both = Counter(tuple(sorted(edge)) for edge in directed.elements())
    edges = find_edges(faces)
    pairs = [tuple(pair) for pair in edges.vertices.tolist()]
    assert pairs == sorted(both)
    assert edges.n_faces.tolist() == [both[pair] for pair in pairs]
    assert edges.n_forward.tolist() == [directed[pair] for pair in pairs]

    seen = set()
    expected = []
    for face in faces.tolist():
        expected.append(tuple(sorted(face)) in seen)
        seen.add(tuple(sorted(face)))
    assert duplicate_faces(faces).tolist() == expected

    sets = []
    for face in faces.tolist():
        touching = [group for group in sets if group & set(face)]
        sets = [group for group in sets if group not in touching]
        sets.append(set(face).union(*touching))
    components, n_components = face_components(faces, 10)
    assert n_components == len(sets)
    for face, component in zip(faces.tolist(), components.tolist(), strict=True):
        group = next(group for group in sets if face[0] in group)
        same = [set(other) <= group for other in faces.tolist()]
        assert (components == component).tolist() == same
    firsts = [components.tolist().index(number) for number in range(n_components)]
    assert firsts == sorted(firsts)


@given(hnp.arrays(np.int32, st.tuples(st.integers(0, 40), st.just(3)), elements=st.integers(0, 9)))
def test_neighbors_against_pairing_one_by_one(faces):
    of_edges = {}
    for half_edge, tail in enumerate(faces.ravel().tolist()):
        face, corner = divmod(half_edge, 3)
        head = int(faces[face, (corner + 1) % 3])
        of_edges.setdefault((min(tail, head), max(tail, head)), []).append((face, tail, head))
    in_order = [of_edges[edge] for edge in sorted(of_edges)]
    pairs = [
        (one[0], other[0], one[1] == other[2])
        for one, other in (at_edge for at_edge in in_order if len(at_edge) == 2)
    ]
    found = edge_neighbors(faces)
    columns = found.first.tolist(), found.second.tolist(), found.agree.tolist()
    assert list(zip(*columns, strict=True)) == pairs
    others = [face for at_edge in in_order if len(at_edge) != 2 for face, *_ in at_edge]
    assert found.at_other_edges.tolist() == others


def test_edges_of_a_vertex_in_many_faces():
    spokes = np.random.default_rng(5).permutation(np.arange(1, 100)).astype(np.int32)
    faces = np.stack([np.zeros_like(spokes), spokes, np.roll(spokes, 1)], axis=1)
    expected = np.unique(np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
    assert (find_edges(faces).vertices == expected).all()


def test_genus_is_the_sum_over_components():
    one = torus(5, 7)
    assert genus_of(one) == 1
    two = np.concatenate([one, one + 35, TETRAHEDRON + 70]).astype(np.int32)
    assert (genus_of(two), face_components(two, 74)[1]) == (2, 3)


def test_two_closed_surfaces_that_touch_at_a_vertex_have_no_genus():
    other = TETRAHEDRON + 4
    other[other == 4] = 0
    faces = np.concatenate([TETRAHEDRON, other]).astype(np.int32)
    assert find_edges(faces).closed and genus_of(faces) is None
    assert face_components(faces, 8)[1] == 1


def test_face_with_a_repeated_vertex_is_in_no_edge():
    # A closed mesh whose faces along one edge are a flat sliver apart stays closed.
    faces = np.concatenate([TETRAHEDRON, [[0, 1, 1]]]).astype(np.int32)
    assert find_edges(faces).closed
    assert genus_of(faces) == 0


@pytest.mark.parametrize("scale", [1e-150, 1.0, 1e150])
@pytest.mark.parametrize("offset", [0.0, 1000.0])
def test_degenerate_faces(scale, offset):
    thin = 2.0**-20  # of its length: thin, but with an area
    positions = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [0.5, thin, 0], [0, 1, 1], [0, 0, 0]])
    faces = [[0, 1, 2], [0, 1, 1], [0, 1, 5], [0, 1, 3], [0, 1, 4], [0, 0, 0]]
    mesh = Mesh(positions=(positions + offset) * scale, faces=faces)
    assert degenerate_faces(mesh).tolist() == [True, True, True, False, False, True]


def test_indices_up_to_the_greatest():
    last = 2**31 - 1
    edges = find_edges(np.array([[0, last - 1, last], [last, last - 1, 5]], dtype=np.int32))
    assert edges.vertices[~edges.boundary].tolist() == [[last - 1, last]]
    assert edges.n_forward[~edges.boundary].tolist() == [1]


@pytest.mark.parametrize("scale", [1e-6, -1.0, 1.0, 1e6])
@pytest.mark.parametrize("place", [0.0, 1e3])
@pytest.mark.parametrize("mesh", [cube(), uv_sphere(8, 16), icosphere(2)])
def test_the_visible_side(mesh, scale, place):
    """A closed mesh shows one side, by its orientation; with a hole or a flipped face, both."""
    positions = scale * (mesh.positions + place)
    closed = Mesh(positions=positions, faces=mesh.faces)
    expected = ("front", "back") if scale > 0.0 else ("back", "front")
    assert (surface_side(closed), surface_side(flipped(closed))) == expected
    assert surface_side(soup_of(closed)) == expected[0]
    turned = mesh.faces.copy()
    turned[3] = turned[3, ::-1]
    for faces in mesh.faces[1:], turned:
        assert surface_side(Mesh(positions=positions, faces=faces)) == "both"


def test_the_side_of_many_faces_does_not_depend_on_threads():
    ball = icosphere(7)
    assert ball.n_faces > 1 << 17
    assert [surface_side(ball, threads=n) for n in (1, 2)] == ["front", "front"]


def test_a_sheet_with_two_sides_is_closed():
    positions = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    assert surface_side(Mesh(positions=positions, faces=[[0, 1, 2], [2, 1, 0]])) == "front"


# Rows that are equal, bit for bit.


def firsts_by_dictionary(rows):
    seen = {}
    return [seen.setdefault(tuple(row), index) for index, row in enumerate(rows.tolist())]


@given(
    hnp.arrays(
        np.float64,
        st.tuples(st.integers(1, 60), st.just(3)),
        elements=st.sampled_from([0.0, -0.0, 1.0, 1e-300, 0.1]),
    )
)
def test_first_equal_row_as_a_dictionary_finds_it(rows):
    assert weld_rows(rows).tolist() == firsts_by_dictionary(rows)


@pytest.mark.parametrize("dtype", [np.float64, np.float32, np.int32])
def test_many_rows_with_any_number_of_threads(dtype):
    rows = np.random.default_rng(1).integers(-30, 30, (50_000, 3)).astype(dtype)
    firsts = weld_rows(rows, threads=1)
    assert firsts.tolist() == firsts_by_dictionary(rows)
    assert weld_rows(rows, threads=3).tobytes() == firsts.tobytes()


def test_rows_that_differ_have_hashes_all_over():
    """One hash for all would find the same rows, in time that grows with their square."""
    words = np.arange(60_000, dtype=np.uint32).reshape(-1, 3)
    keys = np.random.default_rng(2).integers(0, 2**64, 4, np.uint64)
    hashes = np.empty(len(words), np.uint32)
    core.hash_rows(words, keys, 0, len(words), hashes)
    assert len(np.unique(hashes)) > 0.999 * len(words)
    assert np.ptp(np.bincount(hashes >> np.uint32(28), minlength=16)) < 0.2 * len(words) / 16


def test_neighboring_floats_stay_apart():
    rows = np.array([[1.0], [np.nextafter(1.0, 2.0)], [1.0]])
    assert weld_rows(rows).tolist() == [0, 1, 0]


def test_rows_are_left_as_they_are():
    rows = np.array([[-0.0, 1.0], [0.0, 1.0]])
    rows.flags.writeable = False
    assert weld_rows(rows).tolist() == [0, 0]
    assert np.signbit(rows[0, 0])


def test_all_rows_equal():
    assert not weld_rows(np.zeros((20_000, 3))).any()
