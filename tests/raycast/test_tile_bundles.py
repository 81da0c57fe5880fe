"""Rays in bundles: the same hits as one by one and of other casters, and where they are."""

import numpy as np
import pytest
from embreex_oracle import EmbreexScene, PlainScene

from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import cube, uv_sphere
from texbake.raycast.rays import NO_HIT, Rays
from texbake.raycast.scene import BUNDLE_SIDE, RayPlaces, RayScene

WALL = Mesh(positions=[[0, 0, 0], [0, 1, 0], [0, 0, 1]], faces=[[0, 1, 2]])


def met(origin, direction):
    """Weights, distance and point where a ray meets the wall."""
    frame = LocalFrame(np.zeros(3), 1.0)
    direction = np.array([direction]) / np.linalg.norm(direction)
    rays = Rays(np.array([origin]), direction, np.full(1, 4.0), np.zeros(1))
    found = RayScene.build(WALL, frame).cast(rays, cull_back_faces=False)
    assert found.faces[0] == 0
    return found.barycentrics[0], found.distances[0], rays.origins + found.distances * direction


def test_a_ray_across_meets_the_plane_where_a_closed_form_says():
    weights, distance, _ = met([3.0, 0.25, 1.0], [-3.0, 0.0, -0.5])
    np.testing.assert_allclose(weights, [0.25, 0.5], rtol=1e-15)
    np.testing.assert_allclose(distance, np.hypot(3.0, 0.5), rtol=1e-15)


def test_a_ray_along_the_triangle_stays_on_it():
    weights, distance, point = met([1.5e-8, 0.25, 2.0], [-1e-8, 0.0, -1.0])
    assert (weights >= 0).all() and weights.sum() <= 1
    np.testing.assert_allclose(distance, 1.5, atol=1e-7)
    np.testing.assert_allclose(point[0], [0.0, *weights], atol=1e-7)


def bumpy():
    return uv_sphere(60, 90, lambda theta, phi: 1 + 0.1 * np.sin(7 * theta) * np.sin(9 * phi))


def inward(n, rng, spread):
    """Rays from around a sphere toward its middle, more or less."""
    starts = rng.normal(size=(n, 3))
    starts *= 0.55 / np.linalg.norm(starts, axis=1, keepdims=True)
    directions = -starts + spread * rng.normal(size=(n, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return Rays(starts, directions, rng.uniform(0.0, 1.2, n), np.zeros(n))


def in_squares(n):
    """Places of rays that fill one square of a bundle after another."""
    place, across = np.arange(n, dtype=np.int32), np.int32(BUNDLE_SIDE)
    cells = np.stack([place % across, place // across], axis=1)
    return RayPlaces(np.zeros(n, dtype=np.int32), cells)


@pytest.mark.parametrize("cull", [True, False])
@pytest.mark.parametrize("spread", [0.0, 0.1, 1.0])
def test_every_ray_has_the_hit_of_a_plain_caster(cull, spread):
    """Any directions, any lengths, and rays that go nowhere."""
    mesh = bumpy()
    frame = LocalFrame.around(mesh)
    rays = inward(400, np.random.default_rng(4), spread)
    rays.lengths[::17] = 0.0
    rays.lengths[1::17] = np.inf
    found = RayScene.build(mesh, frame).cast(rays, cull_back_faces=cull, places=in_squares(400))
    plain = PlainScene(mesh, frame).cast(rays, cull_back_faces=cull)
    np.testing.assert_array_equal(found.faces, plain.faces)
    np.testing.assert_array_equal(found.passed_back, plain.passed_back)
    np.testing.assert_allclose(found.distances, plain.distances, atol=1e-12)
    np.testing.assert_allclose(found.barycentrics, plain.barycentrics, atol=1e-9)


@pytest.mark.parametrize("seed", range(6))
def test_hits_depend_on_no_bundle(seed):
    """Whatever places and charts rays are said to have, and wherever the bundle is cut."""
    rng = np.random.default_rng(seed)
    mesh = bumpy()
    frame = LocalFrame.around(mesh)
    rays = inward(3000, rng, [0.0, 0.02, 0.3][seed % 3])
    scene = RayScene.build(mesh, frame)
    alone = scene.cast(rays)
    order = np.argsort(rays.origins[:, 0] + (rays.origins[:, 1] > 0.0), kind="stable")
    some = rays.where(order)
    cells = rng.integers(0, 3 * BUNDLE_SIDE, (3000, 2)).astype(np.int32)
    cells = cells[np.lexsort((cells[:, 0] // BUNDLE_SIDE, cells[:, 1] // BUNDLE_SIDE))]
    charts = rng.integers(0, 1 + seed, 3000).astype(np.int32)
    found = scene.cast(some, places=RayPlaces(charts, np.ascontiguousarray(cells)))
    for mine, theirs in zip(alone.arrays(), found.arrays(), strict=True):
        np.testing.assert_array_equal(mine[order], theirs)
    assert (alone.faces != NO_HIT).any()


@pytest.mark.parametrize("in_bundles", [True, False])
@pytest.mark.parametrize("value", [np.nan, np.inf, -1e300])
def test_rays_that_are_not_finite_hit_nothing(value, in_bundles):
    places = in_squares(700) if in_bundles else None
    rays = inward(700, np.random.default_rng(5), 0.3)
    rays.origins[::7, 0] = value
    rays.directions[1::7, 1] = value
    mesh = bumpy()
    found = RayScene.build(mesh, LocalFrame.around(mesh)).cast(rays, places=places)
    others = found.faces.reshape(-1, 7)
    assert (others[:, :2] == NO_HIT).all() and (others[:, 2:] != NO_HIT).any(axis=0).all()


CASTERS = [RayScene.build, EmbreexScene, PlainScene]


@pytest.mark.parametrize("caster", CASTERS)
def test_back_faces_are_passed_through_and_reported(caster):
    high = cube()
    frame = LocalFrame.around(high)
    center = np.zeros((50, 3))
    directions = np.random.default_rng(1).normal(size=(50, 3))
    inside = Rays(
        center, directions / np.linalg.norm(directions, axis=1, keepdims=True), np.full(50, 4.0),
        np.zeros(50),
    )  # fmt: skip
    culled = caster(high, frame).cast(inside)
    assert (culled.faces == NO_HIT).all() and culled.passed_back.all()
    seen = caster(high, frame).cast(inside, cull_back_faces=False)
    assert (seen.faces != NO_HIT).all() and seen.passed_back.all()
    # A closed form: the way out of a cube of half size h is h over the greatest component.
    half = frame.to_local(high.positions).max()
    np.testing.assert_allclose(seen.distances, half / np.abs(inside.directions).max(axis=1))


def test_degenerate_triangles_are_never_hit_and_hide_nothing():
    square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    high = Mesh(positions=square, faces=[[0, 1, 1], [0, 0, 0], [0, 2, 0], [0, 1, 2], [0, 2, 3]])
    frame = LocalFrame.around(high)
    targets = frame.to_local(np.random.default_rng(0).uniform(0.01, 0.99, (200, 3)) * [1, 1, 0])
    down = np.tile([0.0, 0.0, -1.0], (200, 1))
    rays = Rays(targets - 0.2 * down, down, np.full(200, 0.4), np.full(200, 0.2))
    for caster in CASTERS:
        found = caster(high, frame).cast(rays)
        assert (found.faces >= 3).all()
