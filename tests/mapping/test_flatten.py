"""Patches laid flat: developable ones exactly, others as an independent optimizer does."""

import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from texbake.core import core
from texbake.mapping.atlas.flatten import flatten, measure_layout
from texbake.mapping.corner_uvs import signed_areas, surface_areas
from texbake.mapping.overlap import find_overlaps


def sheet(columns, rows, place):
    """Grid of the unit square in (u, v), each square cut in two, moved by `place`."""
    v, u = np.meshgrid(np.linspace(0, 1, rows + 1), np.linspace(0, 1, columns + 1), indexing="ij")
    points = np.stack(place(u, v), axis=-1).reshape(-1, 3).astype(np.float64)
    ids = np.arange(len(points)).reshape(rows + 1, columns + 1)
    a, b, c, d = ids[:-1, :-1], ids[:-1, 1:], ids[1:, 1:], ids[1:, :-1]
    faces = np.stack([np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)])
    return points, faces.reshape(-1, 3).astype(np.int32)


def cylinder(u, v):
    """Two thirds of a turn; the polyhedron is developable, as its rulings are edges."""
    angle = 4.0 * u
    return np.cos(angle), np.sin(angle), 2.0 * v


def cone(u, v):
    angle, radius = 5.0 * u, 1.0 + v
    return radius * np.cos(angle) * 0.6, radius * np.sin(angle) * 0.6, 0.8 * radius


def hemisphere(n):
    """A square grid over a disk, wrapped onto the upper half of the unit sphere."""

    def place(u, v):
        x, y = 2.0 * u - 1.0, 2.0 * v - 1.0
        x, y = x * np.sqrt(1 - y * y / 2), y * np.sqrt(1 - x * x / 2)
        radius = np.hypot(x, y)
        angle = np.where(radius > 0, 0.5 * math.pi * radius, 0.0)
        ratio = np.where(radius > 0, np.sin(angle) / np.maximum(radius, 1e-300), math.pi / 2)
        return x * ratio, y * ratio, np.cos(angle)

    return sheet(n, n, place)


def edge_lengths(points, faces):
    corners = points[faces]
    return np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)


def assert_laid_flat(flat, points, faces):
    """No flips, finite, the area that it has in space, and figures that fit the coordinates."""
    assert np.isfinite(flat.uvs).all()
    areas = signed_areas(flat.uvs[faces])
    assert (areas > 0).all()
    assert areas.sum() == pytest.approx(surface_areas(points[faces]).sum(), rel=1e-3)
    assert flat.energy >= 4 - 1e-12 and flat.l2 >= 1 - 1e-12


@pytest.mark.parametrize("place", [cylinder, cone])
def test_developable(place):
    points, faces = sheet(24, 10, place)
    flat = flatten(points, faces, accuracy=1e-6)
    assert_laid_flat(flat, points, faces)
    # The last step gained no more than 1e-7, and left a part of that; of it, strains are the root.
    assert flat.energy == pytest.approx(4, abs=1e-7)
    assert flat.l2 == pytest.approx(1, abs=1e-7)
    np.testing.assert_allclose(
        edge_lengths(flat.uvs, faces), edge_lengths(points, faces), rtol=1e-3
    )
    assert flat.injective


def test_figures_of_a_known_stretch():
    # A unit square stretched to 2 x 1/2 keeps its area: σ = (2, 1/2) in every triangle.
    points, faces = sheet(3, 3, lambda u, v: (u, v, 0 * u))
    layout = points[:, :2] * [2.0, 0.5] * 7.0 + 100.0
    flat = measure_layout(points, faces, layout)
    assert flat.energy == pytest.approx(2 * (4 + 1 / 4), rel=1e-12)
    assert flat.l2 == pytest.approx(math.sqrt((4 + 1 / 4) / 2), rel=1e-12)
    assert flat.injective
    assert_laid_flat(flat, points, faces)
    assert measure_layout(points, faces, layout[:, ::-1]) is None


def test_optimum_against_another_optimizer():
    """The energy and its slope by formulas of their own, minimized by BFGS."""
    from scipy.optimize import minimize

    points, faces = hemisphere(6)
    corners = points[faces]
    edges = corners[:, 1:] - corners[:, :1]
    lengths = np.linalg.norm(edges[:, 0], axis=1)
    shapes = np.zeros((len(faces), 2, 2))  # columns: the edges in the plane of the triangle
    shapes[:, 0, 0] = lengths
    shapes[:, 0, 1] = (edges[:, 0] * edges[:, 1]).sum(axis=1) / lengths
    shapes[:, 1, 1] = 2 * surface_areas(corners) / lengths
    back, areas = np.linalg.inv(shapes), surface_areas(corners)

    def energy(flat_uvs):
        uvs = flat_uvs.reshape(-1, 2)
        jacobians = np.swapaxes(uvs[faces[:, 1:]] - uvs[faces[:, :1]], 1, 2) @ back
        determinants = np.linalg.det(jacobians)
        if (determinants <= 0).any():
            return 1e6, np.zeros_like(flat_uvs)
        inverses = np.linalg.inv(jacobians)
        value = (jacobians**2).sum(axis=(1, 2)) + (inverses**2).sum(axis=(1, 2))
        # d |J⁻¹|² = -2 <J⁻ᵀ J⁻¹ J⁻ᵀ, dJ>
        turned = np.swapaxes(inverses, 1, 2)
        shares = (areas / areas.sum())[:, None, None]
        slopes = 2 * shares * (jacobians - turned @ inverses @ turned)
        steps = np.swapaxes(slopes @ np.swapaxes(back, 1, 2), 1, 2)
        gradient = np.zeros_like(uvs)
        np.add.at(gradient, faces[:, 1:].ravel(), steps.reshape(-1, 2))
        np.add.at(gradient, faces[:, 0], -steps.sum(axis=1))
        return (value * areas).sum() / areas.sum(), gradient.ravel()

    # From a start of its own: longitudes kept, latitudes as distances.
    angles = np.arccos(np.clip(points[:, 2:], -1, 1))
    start = points[:, :2] * angles / np.maximum(np.sin(angles), 1e-9)
    found = minimize(energy, start.ravel(), jac=True, method="L-BFGS-B", options={"maxiter": 2000})
    flat = flatten(points, faces, accuracy=1e-6)
    best = measure_layout(points, faces, found.x.reshape(-1, 2))  # both at the area in space
    assert flat.energy - 4 == pytest.approx(best.energy - 4, rel=1e-5)
    assert flat.l2 == pytest.approx(best.l2, abs=1e-6)
    # By default a step of less than a thousandth of the distortion is the last one.
    quick = flatten(points, faces)
    assert quick.energy - 4 == pytest.approx(best.energy - 4, rel=1e-3)


@settings(max_examples=25)
@given(
    seed=st.integers(0, 2**32 - 1), columns=st.integers(1, 8), rows=st.integers(1, 8),
    roughness=st.sampled_from([0.0, 0.1, 1.0, 10.0]),
)  # fmt: skip
def test_injectivity_agrees_with_the_faces(seed, columns, rows, roughness):
    noise = np.random.default_rng(seed).normal(size=(rows + 1, columns + 1)) * roughness
    points, faces = sheet(columns, rows, lambda u, v: (u, v, noise))
    flat = flatten(points, faces)
    assert_laid_flat(flat, points, faces)
    extent = np.ptp(flat.uvs, axis=0).max()
    assert flat.injective == (not find_overlaps(flat.uvs[faces] / extent).overlapping.any())


@pytest.mark.parametrize(("turns", "injective"), [(0.9, True), (1.2, False)])
def test_wound_onto_itself(turns, injective):
    """A spiral staircase's flat ring of more than a full turn is developable and overlaps."""
    slope = 1e-3

    def place(u, v):
        angle, radius = 2 * math.pi * turns * u, 1 + 0.3 * v
        return radius * np.cos(angle), radius * np.sin(angle), slope * angle

    points, faces = sheet(60, 3, place)
    flat = flatten(points, faces, accuracy=1e-7)
    assert_laid_flat(flat, points, faces)
    assert flat.energy == pytest.approx(4, abs=1e-5)
    assert flat.injective is injective
    apart = flatten(points, faces, keep_apart=True)
    assert apart.injective and not find_overlaps(apart.uvs[faces]).overlapping.any()


def annulus(n_holes_high, place=lambda u, v: (u, v, 0 * u)):
    points, faces = sheet(12, 12, place)
    middles = faces // 13, faces % 13
    row, column = middles[0].min(axis=1), middles[1].min(axis=1)
    is_hole = np.isin(row, [4, 5]) & np.isin(column, [2, 3, 8, 9][: 2 * n_holes_high])
    return points, faces[~is_hole]


@pytest.mark.parametrize("n_holes", [1, 2])
def test_holes_stay_holes(n_holes):
    points, faces = annulus(n_holes)
    flat = flatten(points, faces)
    assert_laid_flat(flat, points, faces)
    assert flat.energy == pytest.approx(4, abs=1e-5)
    assert flat.injective
    bent, faces = annulus(n_holes, lambda u, v: (u, v, np.sin(3 * u) * np.cos(2 * v)))
    flat = flatten(bent, faces)
    assert_laid_flat(flat, bent, faces)
    assert flat.injective
    # A numbering that begins at a hole has the same circle to start from.
    order = np.roll(np.arange(len(bent)), -80)
    start, other = (
        flatten(points, faces, n_iterations=0)
        for points, faces in ((bent, faces), (bent[order], np.argsort(order)[faces]))
    )
    assert other.energy == pytest.approx(start.energy, rel=1e-9)


def test_fans_that_touch():
    """Two squares that share a corner: no disk, but fine from a layout of their own."""
    points, faces = sheet(3, 3, lambda u, v: (u, v, 0 * u))
    row, column = faces.min(axis=1) // 4, faces.min(axis=1) % 4
    faces = faces[(row == column) & (row < 2)]
    assert flatten(points, faces) is None
    start = points[:, :2] * [1.0, 1.2]
    flat = flatten(points, faces, start, accuracy=1e-6)
    assert_laid_flat(flat, points, faces)
    assert flat.energy == pytest.approx(4, abs=1e-7)


def test_no_surface():
    points = np.random.default_rng(0).normal(size=(6, 3))
    assert flatten(points, np.array([[0, 1, 2], [1, 0, 3], [0, 1, 4]])) is None  # an edge of three
    assert flatten(points, np.array([[0, 1, 2], [0, 1, 3]])) is None  # opposite windings
    assert flatten(points, np.array([[0, 1, 1]])) is None
    assert flatten(points, np.empty((0, 3), dtype=np.int32)) is None
    assert flatten(points, np.array([[0, 1, 2], [3, 4, 5]])) is None  # two pieces
    closed = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
    assert flatten(points, closed) is None
    assert flatten(np.zeros((3, 3)), np.array([[0, 1, 2]])) is None  # all at one place


def test_handle():
    """A torus less one square has one boundary and is no disk."""
    ids = np.arange(16).reshape(4, 4)
    a, b = ids, np.roll(ids, -1, axis=1)
    c, d = np.roll(b, -1, axis=0), np.roll(a, -1, axis=0)
    faces = np.concatenate(
        [np.stack([a, b, c], axis=-1).reshape(-1, 3), np.stack([a, c, d], axis=-1).reshape(-1, 3)]
    )
    faces = np.delete(faces, [0, 16], axis=0)
    points = np.random.default_rng(0).normal(size=(16, 3))
    assert flatten(points, faces) is None


@pytest.mark.parametrize("height", [0.0, 1e-12, 1e-6])
def test_slivers(height):
    """Vertices on the edges of a square sheet, or all but: slivers take nothing from the rest."""
    points, faces = sheet(6, 6, lambda u, v: (u, v, 0.3 * u * v))
    # A sliver on each bottom edge, its third corner in the middle of the edge.
    bottom = np.arange(6)
    middles = (points[bottom] + points[bottom + 1]) / 2 - [0, height, 0]
    slivers = np.stack([bottom + 1, bottom, len(points) + bottom], axis=1)
    more = np.concatenate([points, middles])
    flat = flatten(more, np.concatenate([faces, slivers]), accuracy=1e-6)
    assert np.isfinite(flat.uvs).all() and (signed_areas(flat.uvs[faces]) > 0).all()
    without = flatten(points, faces, accuracy=1e-6)
    # Slivers weigh 1e-5 of the sheet, and cost what it takes to fold their bases open.
    assert flat.energy == pytest.approx(without.energy, abs=1e-4)


def test_start_is_used_and_kept():
    points, faces = sheet(8, 8, lambda u, v: (u, v, 0 * u))
    start = points[:, :2] + 5.0
    kept = start.copy()
    flat = flatten(points, faces, start, n_iterations=0)
    np.testing.assert_allclose(flat.uvs, points[:, :2] - 0.5, atol=1e-12)
    np.testing.assert_array_equal(start, kept)
    start[40] += 1.0  # flips triangles: laid out from a circle
    flat = flatten(points, faces, start)
    assert flat.energy == pytest.approx(4, abs=1e-7)


TURNS = np.linspace(0, 2 * math.pi, 7)[:-1]
HEXAGON = np.stack([np.cos(TURNS), np.sin(TURNS)], axis=1)


def is_injective(uvs, faces):
    points = np.column_stack([uvs, np.zeros(len(uvs))])
    figures = np.empty(3)
    return bool(core.measure_layout(points, faces, np.array(uvs), figures) and figures[2])


def ring(n, turns, inner=1.0, outer=1.4, *, closed=False):
    """A band of n quads around the origin, and its layout."""
    angle = np.arange(n if closed else n + 1) * (2 * math.pi * turns / n)
    rim = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    a, b = np.arange(n), (np.arange(n) + 1) % len(angle)
    faces = np.concatenate(
        [np.stack([a, a + len(rim), b + len(rim)], axis=1), np.stack([a, b + len(rim), b], axis=1)]
    )
    return np.concatenate([inner * rim, outer * rim]), faces.astype(np.int32)


@pytest.mark.parametrize(
    ("turns", "injective"), [(0.5, True), (0.99, True), (1.01, False), (1.5, False), (2.0, False)]
)
@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_band(turns, injective, size):
    uvs, faces = ring(50, turns)
    assert is_injective(size * uvs, faces) is injective


def test_slit_that_closes_exactly():
    """Both ends of a full turn lie on one another: the sides touch, and no area is shared."""
    uvs, faces = ring(50, 1.0)
    assert is_injective(uvs, faces)
    uvs[[50, 101]] = uvs[[0, 51]]
    assert is_injective(uvs, faces)
    # By more than rounding, and less than a face.
    turn = np.array([[math.cos(1e-3), math.sin(1e-3)], [-math.sin(1e-3), math.cos(1e-3)]])
    uvs[[50, 101]] = uvs[[0, 51]] @ turn
    assert not is_injective(uvs, faces)


def test_hole_wound_twice():
    """A closed band around the origin twice, as the square root's sheet is."""
    uvs, faces = ring(50, 1.0, closed=True)
    assert is_injective(uvs, faces)
    uvs, faces = ring(50, 2.0, closed=True)
    assert not is_injective(uvs, faces)


def test_hole_turned_inside_out():
    """The inner loop mirrored: triangles are flipped, though no edges of the boundary cross."""
    _, faces = ring(6, 1.0, closed=True)
    assert is_injective(np.concatenate([0.2 * HEXAGON, HEXAGON]), faces)
    mirrored = np.concatenate([0.2 * HEXAGON * [1, -1], HEXAGON])
    assert not is_injective(mirrored, faces)


def test_fans_within_one_another():
    """Triangles around one corner: beside each other, or one within the other."""
    faces = np.array([[0, 1, 2], [0, 3, 4]], dtype=np.int32)
    uvs = np.array([[0, 0], [1, 0], [1, 1], [-1, 0], [-1, -1]], dtype=float)
    assert is_injective(uvs, faces)
    uvs[3:] = [[0.5, 0.1], [0.5, 0.2]]  # no edges cross
    assert not is_injective(uvs, faces)
