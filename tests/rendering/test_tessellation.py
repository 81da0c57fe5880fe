import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from texbake.mesh.shapes import icosphere, plane
from texbake.rendering.camera import Camera
from texbake.rendering.displaced import (
    MOST_CUTS,
    BaseSurface,
    EdgeView,
    cut,
    displaced,
    edges_to_cut,
    undivided_triangles,
)
from texbake.rendering.options import RenderOptions


def start(mesh):
    pieces, places = undivided_triangles(mesh.faces)
    return pieces, mesh.positions.copy(), places


def cut_once(pieces, points, marked, threads=1):
    finer, ends, places = cut(pieces, marked, points, threads=threads)
    return finer, np.concatenate([points, points[ends].mean(axis=1)]), places


def is_consistent(pieces):
    """Whether each triangle's edges run between its corners, and each pair of ends is one edge."""
    ends = np.sort(pieces.ends[pieces.face_edges], axis=-1)
    corners = np.sort(np.stack([pieces.faces, np.roll(pieces.faces, -1, axis=1)], axis=-1), axis=-1)
    used = np.unique(pieces.face_edges)
    distinct = len(np.unique(np.sort(pieces.ends, axis=1), axis=0)) == len(pieces.ends)
    return np.array_equal(ends, corners) and distinct and len(used) == len(pieces.ends)


def area_vectors(points, faces):
    a, b, c = np.moveaxis(points[faces], 1, 0)
    return np.cross(b - a, c - a)


def on_base(mesh, faces, weights):
    corners = mesh.positions[mesh.faces[faces]]
    w = weights.astype(np.float64)
    return np.einsum(
        "...c,...ck->...k", np.stack([1 - w.sum(axis=-1), w[..., 0], w[..., 1]], axis=-1), corners
    )


@settings(max_examples=60)
@given(st.sampled_from(["sphere", "plane"]), st.integers(0, 2**32 - 1), st.floats(0.0, 1.0))
def test_any_cut_leaves_no_crack_and_moves_nothing(shape, seed, share):
    mesh = icosphere(1) if shape == "sphere" else plane(3, 2)
    pieces, points, _ = start(mesh)
    euler = pieces.n_vertices - len(pieces.ends) + len(pieces.faces)
    boundary = np.count_nonzero(np.bincount(pieces.face_edges.ravel()) == 1)
    random = np.random.default_rng(seed)
    for _ in range(3):
        marked = random.random(len(pieces.ends)) < share
        borders = np.bincount(pieces.face_edges.ravel(), minlength=len(marked)) == 1
        n_faces = len(pieces.faces) + np.count_nonzero(marked[pieces.face_edges])
        boundary += np.count_nonzero(marked & borders)
        # Every new vertex has one place on each base triangle that was cut there.
        sides = np.stack([pieces.face_edges, np.repeat(pieces.base_faces[:, None], 3, axis=1)], 2)
        n_places = len(np.unique(sides[marked[pieces.face_edges]], axis=0))
        pieces, points, places = cut_once(pieces, points, marked)
        assert len(pieces.faces) == n_faces
        assert len(points) == pieces.n_vertices
        assert len(places.vertices) == n_places
        np.testing.assert_allclose(
            on_base(mesh, places.base_faces, places.weights),
            points[places.vertices + pieces.n_vertices - np.count_nonzero(marked)],
            atol=1e-15,
        )
        assert is_consistent(pieces)
    assert pieces.n_vertices - len(pieces.ends) + len(pieces.faces) == euler
    n_of_edges = np.bincount(pieces.face_edges.ravel())
    assert n_of_edges.max() <= 2 and np.count_nonzero(n_of_edges == 1) == boundary
    # The pieces of each triangle are wound as it is and add up to it.
    vectors = area_vectors(points, pieces.faces)
    wholes = area_vectors(mesh.positions, mesh.faces)[pieces.base_faces]
    assert (np.einsum("ij,ij->i", vectors, wholes) > 0).all()
    for axis in range(3):
        np.testing.assert_allclose(
            np.bincount(pieces.base_faces, weights=vectors[:, axis]),
            area_vectors(mesh.positions, mesh.faces)[:, axis],
            atol=1e-15,
        )
    np.testing.assert_allclose(
        on_base(mesh, pieces.base_faces[:, None], pieces.base_weights), points[pieces.faces],
        atol=1e-15,
    )  # fmt: skip
    assert (np.diff(pieces.base_faces) >= 0).all()


def test_weights_stay_exact_for_as_many_cuts_as_are_made():
    # Always the half of the diagonal at the first corner: its middle is at (2^-n, 2^-n) / 2.
    pieces, points, _ = start(plane())
    edge = int(np.flatnonzero((pieces.ends == (0, 3)).all(axis=1))[0])
    for n in range(1, MOST_CUTS + 1):
        marked = np.zeros(len(pieces.ends), bool)
        marked[edge] = True
        pieces, points, places = cut_once(pieces, points, marked)
        assert sorted(set(places.weights.ravel())) in ([0.0, 2.0**-n], [2.0**-n])
        assert (points[-1, :2] == 2.0**-n).all()
        edge = int(np.flatnonzero((pieces.ends == (0, len(points) - 1)).all(axis=1))[0])


def test_the_shorter_diagonal_is_taken():
    # Two edges of a long triangle are cut: from (0, 0) to the middle of the far side is longer.
    points = np.array([(0.0, 0, 0), (1, 0, 0), (9, 1, 0)])
    pieces, _ = undivided_triangles(np.array([[0, 1, 2]], np.int32))
    marked = np.array([set(ends) in ({0, 1}, {1, 2}) for ends in pieces.ends.tolist()])
    finer, points, _ = cut_once(pieces, points, marked)
    ends = {frozenset(pair) for pair in finer.ends.tolist()}
    first = next(i for i in (3, 4) if points[i, 0] == 0.5)
    # From the middle (0.5, 0) to (9, 1) are 8.56; from (0, 0) to (5, 0.5) 5.02.
    assert frozenset((0, 7 - first)) in ends and frozenset((first, 2)) not in ends


def test_edges_of_length_zero_are_never_cut():
    # A triangle with two corners in one vertex is cut along its other edge, like its neighbor.
    faces = np.array([[0, 1, 1], [1, 0, 2]], np.int32)
    points = np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0)])
    pieces, _ = undivided_triangles(faces)
    for _ in range(3):
        marked = edges_to_cut(pieces, np.full(len(pieces.ends), 2.0), points, 10**6)
        np.testing.assert_array_equal(marked, pieces.ends[:, 0] != pieces.ends[:, 1])
        pieces, points, _ = cut_once(pieces, points, marked)
    lengths = np.linalg.norm(np.diff(points[pieces.ends], axis=1)[:, 0], axis=1)
    assert lengths.max() < 0.2


def test_no_triangle_is_cut_without_its_longest_edge():
    mesh = icosphere(3)
    points = mesh.positions * (1.0, 1.3, 2.0)
    pieces, _ = undivided_triangles(mesh.faces)
    random = np.random.default_rng(4)
    excess = np.where(random.random(len(pieces.ends)) < 0.02, 2.0, 0.5)
    marked = edges_to_cut(pieces, excess, points, 10**6)
    assert marked[excess > 1].all() and marked.sum() > (excess > 1).sum()
    corners = points[pieces.faces]
    lengths = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=-1)
    is_cut = marked[pieces.face_edges]
    np.testing.assert_array_equal(
        np.take_along_axis(is_cut, lengths.argmax(axis=1)[:, None], axis=1)[:, 0],
        is_cut.any(axis=1),
    )
    # What is far from all of them is left alone.
    assert not is_cut.any(axis=1).all()


@pytest.mark.parametrize("most", [80, 81, 82, 99, 150, 319, 320])
def test_a_bound_on_triangles_is_used_up_by_the_longest_edges(most):
    mesh = icosphere(1)
    pieces, points, _ = start(mesh)
    excess = np.random.default_rng(5).uniform(1.1, 2.0, len(pieces.ends))
    marked = edges_to_cut(pieces, excess, points, most)
    finer, _, _ = cut_once(pieces, points, marked)
    # Every edge of a closed surface has two triangles.
    assert len(finer.faces) == most - most % 2
    if marked.any() and not marked.all():
        assert excess[marked].min() > excess[~marked].max()


def test_a_mesh_beyond_the_bound_is_not_cut():
    pieces, points, _ = start(icosphere(1))
    assert not edges_to_cut(pieces, np.full(len(pieces.ends), 9.0), points, 10).any()


@pytest.mark.parametrize("lift", [0.0, 0.2])
@pytest.mark.parametrize("edge_px", [3.0, 12.0])
def test_no_edge_in_a_picture_is_longer_than_its_excess_says(edge_px, lift):
    """Nor shorter than half of that where it lies across the view; one within a texel has none."""
    mesh = icosphere(2)
    options = RenderOptions(width=300, height=200, view=(30.0, 20.0))
    camera = Camera.framing(mesh.replace(positions=1.3 * mesh.positions), options=options)
    surface = BaseSurface(points=mesh.positions, faces=mesh.faces,
                          normals=mesh.positions, linear=np.eye(3))  # fmt: skip
    kept = []

    def no_cuts(now):
        kept.append(now)
        return np.zeros(len(now.pieces.ends))

    displaced(surface, lambda places, _: np.full((len(places.vertices), 1), lift), no_cuts,
              max_triangles=10**6)  # fmt: skip
    now, view = kept[-1], EdgeView(camera, options, edge_px, lift)
    texels = 20.0 * np.tile([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], (mesh.n_faces, 1, 1))
    excess = view.excess(now, texels)
    assert not view.excess(now, texels / 40.0).any()
    np.testing.assert_allclose(
        EdgeView(camera, options, 2.0 * edge_px, lift).excess(now, texels), excess / 2.0
    )
    for points in (now.points, now.positions):
        homogeneous = np.column_stack([points, np.ones(len(points))])
        clip = homogeneous @ np.array(camera.clip_from_world(1.5)).T
        pixels = clip[:, :2] / clip[:, 3:] * (150.0, 100.0)
        lengths = np.linalg.norm(np.diff(pixels[now.pieces.ends], axis=1)[:, 0], axis=1)
        assert (lengths <= excess * edge_px * (1.0 + 1e-9)).all()
    # Maps are read for half of `edge_px` pixels, and for the near plane before it.
    pixel = 2.0 * np.tan(camera.fov / 2.0) / 200
    depths = np.append((camera.eye - now.points) @ camera.axes[2], camera.near)
    shown = np.concatenate([now.points, [camera.eye + camera.axes[2]]])
    np.testing.assert_allclose(view.widths(shown), 0.5 * edge_px * pixel * depths)
    depths = (camera.eye - now.positions) @ camera.axes[2]
    across = np.abs(np.diff(depths[now.pieces.ends], axis=1)[:, 0]) < 0.02
    assert across.any() and (lengths[across] > 0.5 * excess[across] * edge_px).all()
