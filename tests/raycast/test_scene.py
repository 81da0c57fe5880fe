"""Rays against closed forms, and three independent ray casters against each other."""

import numpy as np
import pytest
from embreex_oracle import EmbreexScene, PlainScene

from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import cube, icosphere
from texbake.raycast.rays import NO_HIT, Rays
from texbake.raycast.scene import RayScene


def rays_at(targets, directions, before=0.2, after=0.2):
    """Local-frame rays that reach their targets after `before`."""
    directions = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    n = len(targets)
    return Rays(
        np.ascontiguousarray(targets - before * directions),
        np.ascontiguousarray(directions),
        np.full(n, before + after),
        np.full(n, before),
    )


CASTERS = [RayScene.build, EmbreexScene, PlainScene]


@pytest.mark.parametrize("caster", CASTERS)
def test_back_faces_are_passed_through_and_reported(caster):
    high = cube()
    frame = LocalFrame.around(high)
    center = np.zeros((50, 3))
    directions = np.random.default_rng(1).normal(size=(50, 3))
    inside = Rays(
        center,
        directions / np.linalg.norm(directions, axis=1, keepdims=True),
        np.full(50, 4.0),
        np.zeros(50),
    )
    culled = caster(high, frame).cast(inside)
    assert (culled.faces == NO_HIT).all()
    assert culled.passed_back.all()
    seen = caster(high, frame).cast(inside, cull_back_faces=False)
    assert (seen.faces != NO_HIT).all()
    assert seen.passed_back.all()
    # A closed form: the way out of a cube of half size h is h over the greatest component.
    half = frame.to_local(high.positions).max()
    np.testing.assert_allclose(seen.distances, half / np.abs(inside.directions).max(axis=1))


@pytest.mark.parametrize("caster", CASTERS)
def test_a_front_face_behind_a_back_face_is_found(caster):
    """Two unit squares one behind the other; the first one is turned away."""
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    positions = np.vstack([np.column_stack([square, np.full(4, z)]) for z in (1.0, 0.5)])
    front, back = [[0, 1, 2], [0, 2, 3]], [[2, 1, 0], [3, 2, 0]]
    high = Mesh(positions=positions, faces=back + (np.array(front) + 4).tolist())
    frame = LocalFrame.around(high)
    targets = frame.to_local(np.array([[0.3, 0.6, 1.0], [0.8, 0.1, 1.0]]))
    down = np.tile([0.0, 0.0, -1.0], (2, 1))
    found = caster(high, frame).cast(rays_at(targets, down, before=0.1, after=0.9))
    assert (found.faces >= 2).all()
    assert found.passed_back.all()
    np.testing.assert_allclose(found.distances, 0.1 + frame.length_to_local(0.5))


@pytest.mark.parametrize("caster", CASTERS)
def test_rays_end_where_they_say(caster):
    high = cube()
    frame = LocalFrame.around(high)
    top = np.array([[0.1, 0.2, frame.to_local(high.positions)[:, 2].max()]])
    down = np.array([[0.0, 0.0, -1.0]])
    assert caster(high, frame).cast(rays_at(top, down, 0.2, 0.001)).faces[0] != NO_HIT
    assert caster(high, frame).cast(rays_at(top, down, 0.2, -0.001)).faces[0] == NO_HIT
    nothing = Rays(top + 0.1, np.zeros((1, 3)), np.zeros(1), np.zeros(1))
    assert caster(high, frame).cast(nothing).faces[0] == NO_HIT


def test_same_bytes_for_any_number_of_threads():
    high = icosphere(5)
    frame = LocalFrame.around(high)
    rng = np.random.default_rng(7)
    targets = rng.normal(size=(40_000, 3))
    targets *= 0.45 / np.linalg.norm(targets, axis=1, keepdims=True)
    rays = rays_at(targets, -targets)
    results = [RayScene.build(high, frame, threads=n).cast(rays) for n in (1, 2, 5)]
    for other in results[1:]:
        for mine, theirs in zip(results[0].arrays(), other.arrays(), strict=True):
            assert mine.tobytes() == theirs.tobytes()


def test_degenerate_triangles_are_never_hit_and_hide_nothing():
    square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    high = Mesh(positions=square, faces=[[0, 1, 1], [0, 0, 0], [0, 2, 0], [0, 1, 2], [0, 2, 3]])
    frame = LocalFrame.around(high)
    targets = frame.to_local(np.random.default_rng(0).uniform(0.01, 0.99, (200, 3)) * [1, 1, 0])
    down = np.tile([0.0, 0.0, -1.0], (200, 1))
    for caster in CASTERS:
        found = caster(high, frame).cast(rays_at(targets, down))
        assert (found.faces >= 3).all()
