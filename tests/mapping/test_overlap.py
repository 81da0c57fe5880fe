import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings, strategies as st

from texbake.mapping import overlap
from texbake.mapping.overlap import find_overlaps, layout_notes, overlap_layers
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import plane

Array = npt.NDArray[np.float64]


def common_area(one, other):
    """Area of what two triangles share, by clipping one with the edges of the other."""
    polygon = [tuple(point) for point in one]
    if np.linalg.det(other[1:] - other[0]) < 0.0:
        other = other[::-1]
    for start, end in zip(other, np.roll(other, -1, axis=0), strict=True):
        edge = end - start
        sides = [edge[0] * (y - start[1]) - edge[1] * (x - start[0]) for x, y in polygon]
        clipped = []
        for i, (p, side) in enumerate(zip(polygon, sides, strict=True)):
            q, next_side = polygon[(i + 1) % len(polygon)], sides[(i + 1) % len(polygon)]
            if side >= 0.0:
                clipped.append(p)
            if side * next_side < 0.0:
                t = side / (side - next_side)
                clipped.append((p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])))
        polygon = clipped
        if not polygon:
            return 0.0
    x, y = np.array(polygon).T
    return float(abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1)))) / 2.0


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1), st.floats(0.05, 0.6))
def test_agrees_with_the_area_that_clipping_leaves(seed, size):
    random = np.random.default_rng(seed)
    # On a lattice of 1/64 an overlap is deep or is none: nothing hangs on the tolerance.
    corners = random.random((24, 1, 2)) + (random.random((24, 3, 2)) - 0.5) * size
    corners = np.round(corners * 64.0) / 64.0
    edges = corners[:, 1:] - corners[:, :1]
    solid = np.linalg.det(edges) != 0.0
    expected = np.zeros(24, dtype=bool)
    for i in range(24):
        for j in range(i):
            if solid[i] and solid[j] and common_area(corners[i], corners[j]) > 1e-9:
                expected[i] = expected[j] = True
    assert np.array_equal(find_overlaps(corners).overlapping, expected)


@pytest.mark.parametrize("n_copies", [1, 2, 5])
def test_copies_of_a_square_need_as_many_layers(n_copies):
    square = plane().corner_uvs()
    corners = np.tile(square, (n_copies, 1, 1))
    layers = overlap_layers(corners, np.zeros(2 * n_copies, dtype=np.int32), depth=1e-6)
    assert layers.tolist() == np.repeat(np.arange(n_copies), 2).tolist()


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1), st.integers(1, 3))
def test_layers_are_the_lowest_that_faces_before_leave_free(seed, n_charts):
    random = np.random.default_rng(seed)
    corners = random.random((24, 1, 2)) + (random.random((24, 3, 2)) - 0.5) * 0.4
    corners = np.round(corners * 64.0) / 64.0  # an overlap is deep or is none
    charts = random.integers(0, n_charts, 24).astype(np.int32)
    solid = np.linalg.det(corners[:, 1:] - corners[:, :1]) != 0.0
    expected: list[int] = []
    for i in range(24):
        taken = {
            expected[j]
            for j in range(i)
            if charts[i] == charts[j]
            and solid[i]
            and solid[j]
            and common_area(corners[i], corners[j]) > 1e-9
        }
        expected.append(min(set(range(25)) - taken))
    assert overlap_layers(corners, charts, depth=1e-6).tolist() == expected


@pytest.mark.parametrize(("shift", "overlaps"), [(0.0, False), (5e-7, False), (1e-5, True)])
def test_neighbors_touch_until_one_is_moved_into_the_other(shift, overlaps):
    square = plane().corner_uvs()
    beside = square + np.array([1.0 - shift, 0.0])
    assert find_overlaps(np.concatenate([square, beside])).overlapping.any() == overlaps


def test_coordinates_of_float32_far_from_the_unit_square_only_touch():
    grid = (
        (plane(20, 20).corner_uvs() + np.array([913.0, 77.0])).astype(np.float32).astype(np.float64)
    )
    split = np.concatenate([grid, (grid + np.array([1.0, 0.0])).astype(np.float32)])
    assert not find_overlaps(split).overlapping.any()


def test_a_stack_and_faces_on_one_point():
    # 20,000 faces on one another are 200 million pairs; one each is enough.
    stack = np.tile(np.array([[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]]), (20_000, 1, 1))
    found = find_overlaps(stack)
    assert found.overlapping.all() and not found.unsure.any()
    assert not find_overlaps(np.full((20_000, 3, 2), 0.3)).overlapping.any()
    assert not find_overlaps(np.zeros((0, 3, 2))).overlapping.any()


def test_slivers_along_a_diagonal_and_around_a_point_only_touch():
    turn = np.array([[np.cos(0.4), -np.sin(0.4)], [np.sin(0.4), np.cos(0.4)]])
    strip = plane(20_000, 1).corner_uvs() * [0.7, 0.5] @ turn.T
    angles = np.linspace(0.0, 2.0 * np.pi, 2001)
    ring = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    ring[-1] = ring[0]
    fan = np.stack([np.zeros((2000, 2)), ring[:-1], ring[1:]], axis=1)
    for corners in strip, fan:
        found = find_overlaps(corners)
        assert not found.overlapping.any() and not found.unsure.any()
    covered = find_overlaps(np.concatenate([strip, [[[-9.0, -9.0], [9.0, -9.0], [0.0, 9.0]]]]))
    assert covered.overlapping.all()


def test_a_check_that_would_take_too_long_is_reported(monkeypatch):
    monkeypatch.setattr(overlap, "_MOST_PAIRS", 0)
    monkeypatch.setattr(overlap, "_LEAST_PAIRS_OF_A_FACE", 4)
    angles = np.linspace(0.1, 1.3, 101)
    ring = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    fan = np.stack([np.zeros((100, 2)), ring[:-1], ring[1:]], axis=1)
    apart = fan[:1] + np.array([5.0, 0.0])
    found = find_overlaps(np.concatenate([fan, apart, apart]))
    assert found.overlapping.tolist() == [False] * 100 + [True, True]
    assert found.unsure.any()
    assert not (found.overlapping & found.unsure).any()


@pytest.mark.parametrize("far", [1e9, 1e160, 1e200, 1.7e308])
def test_any_size_is_taken(far):
    """One grid at any size, and two of them shifted by half a cell, where depth is relative."""
    grid = plane(4, 4).corner_uvs() * far
    assert not find_overlaps(grid).overlapping.any()
    assert find_overlaps(np.concatenate([grid, grid * 0.9])).overlapping.all()


def test_simplified_faces_that_leave_the_layout_are_counted():
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])

    def mesh(uvs):
        return Mesh(positions=np.c_[square, np.zeros(4)], faces=faces, uvs=uvs, uv_faces=faces)

    mirrored = square.copy()
    mirrored[3] = [0.8, 0.2]  # so that the second triangle lies in the first, clockwise
    (note,) = layout_notes(mesh(mirrored), mesh(square))
    assert note.startswith("2 of 2 triangles overlap others or are mirrored in the texture")
    assert layout_notes(mesh(square), mesh(square)) == []
    assert layout_notes(mesh(mirrored), mesh(mirrored)) == []
