"""Widths and distances of charts, in texels."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from texbake import CheckOptions, Mesh
from texbake.checks.checked_mesh import CheckedMesh
from texbake.checks.coordinates import chart_widths, close_charts
from texbake.mesh.shapes import plane
from texbake.texture.padding import nearest_owner


def checked(mesh, size=128, padding=4):
    return CheckedMesh(mesh, "low", CheckOptions(size=size, padding=padding))


@pytest.mark.parametrize(("width", "length"), [(3, 100), (3, 3), (50, 100), (0.01, 120)])
def test_width_of_a_rectangle_is_its_width(width, length):
    uvs = plane(7, 3).uvs * [width / 128, length / 128]
    (found,) = chart_widths(checked(plane(7, 3).replace(uvs=uvs)))
    assert found == pytest.approx(width, rel=1e-9)  # a root of numbers near 1e5, in float64


def test_width_of_a_disk_and_of_a_ring():
    n = 200
    angle = np.arange(n) * 2.0 * np.pi / n
    rim = 0.5 + 0.25 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    uvs = np.concatenate([rim, [[0.5, 0.5]]])
    faces = [[i, (i + 1) % n, n] for i in range(n)]
    disk = Mesh(positions=np.column_stack([uvs, np.zeros(n + 1)]), faces=faces, uvs=uvs,
                uv_faces=faces)  # fmt: skip
    # A polygon of 200 sides is 1e-4 narrower.
    assert chart_widths(checked(disk))[0] == pytest.approx(64.0, rel=2e-4)
    inner = 0.5 + (rim - 0.5) * 0.9
    uvs = np.concatenate([rim, inner])
    faces = [t for i in range(n) for j in [(i + 1) % n] for t in ((i, j, i + n), (j, j + n, i + n))]
    ring = Mesh(positions=np.column_stack([uvs, np.zeros(2 * n)]), faces=faces, uvs=uvs,
                uv_faces=faces)  # fmt: skip
    # The strip laid straight: 3.2 texels by the mean circumference, which adds 1.6 %.
    assert chart_widths(checked(ring))[0] == pytest.approx(3.2, rel=0.03)


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1), st.integers(0, 6))
def test_pairs_are_found_just_where_padding_meets(seed, padding):
    """Charts of a few texels at random places, against every texel and every owner."""
    random = np.random.default_rng(seed)
    owners = np.full((24, 24), -1, dtype=np.int32)
    n_charts = int(random.integers(2, 6))
    for chart in range(n_charts):
        row, column = random.integers(0, 22, 2)
        owners[row : row + 2, column : column + 2] = chart
    # Apart in the texture, and of no size that counts: the texels above are whose they are said.
    corner = np.array([[0.0, 0.0], [0.01, 0.0], [0.0, 0.01]])
    points = (corner + 0.1 * np.arange(1, n_charts + 1)[:, None, None]).reshape(-1, 2)
    faces = np.arange(3 * n_charts).reshape(-1, 3)
    mesh = Mesh(positions=np.column_stack([points, np.arange(3.0 * n_charts)]), faces=faces,
                uvs=points, uv_faces=faces)  # fmt: skip
    found = close_charts(checked(mesh, size=24, padding=padding), owners)
    n_meeting = nearest_owner(owners, padding).n_meeting
    touching = (
        any(
            (a != b) & (a >= 0) & (b >= 0)
            for one, other in ((owners[:-1], owners[1:]), (owners[:, :-1], owners[:, 1:]))
            for a, b in zip(one.ravel().tolist(), other.ravel().tolist(), strict=True)
        )
        and padding > 0
    )
    assert (found is not None) == (n_meeting > 0 or touching)
