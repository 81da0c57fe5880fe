"""No ray passes between the triangles of a closed mesh, wherever it is aimed."""

import numpy as np
import pytest

from texbake.mesh.frame import LocalFrame
from texbake.mesh.normals import face_normals, vertex_normals
from texbake.mesh.shapes import icosphere
from texbake.raycast.rays import NO_HIT, Rays
from texbake.raycast.scene import RayScene

N_DIRECTIONS = 10_000


def directions(n):
    """Unit vectors spread evenly, after Fibonacci."""
    z = 1.0 - (2.0 * np.arange(n) + 1.0) / n
    turn = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(n)
    radius = np.sqrt(1.0 - z * z)
    return np.column_stack([radius * np.cos(turn), radius * np.sin(turn), z])


def from_outside(targets, toward):
    """Rays that start 2 local units before their targets and end 2 behind them."""
    return Rays(
        np.ascontiguousarray(targets - 2.0 * toward), np.ascontiguousarray(toward),
        np.full(len(targets), 4.0), np.full(len(targets), 2.0),
    )  # fmt: skip


def cast(mesh, rays, *, cull):
    found = RayScene.build(mesh, LocalFrame.around(mesh)).cast(rays, cull_back_faces=cull)
    return found.faces, found.distances


def into(mesh, rng):
    """Points on a closed mesh, at vertices and middles of edges, and directions into it."""
    frame = LocalFrame.around(mesh)
    points = frame.to_local(mesh.positions)
    # By vertex and not by position: shells that coincide have normals of their own.
    normals, of_faces = vertex_normals(mesh), face_normals(mesh)
    corners = points[mesh.faces]
    edges = np.sort(np.stack([mesh.faces, np.roll(mesh.faces, -1, axis=1)], axis=2), axis=2)
    _, edge_ids = np.unique(edges.reshape(-1, 2), axis=0, return_inverse=True)
    sums = np.zeros((edge_ids.max() + 1, 3))
    np.add.at(sums, edge_ids, np.repeat(of_faces, 3, axis=0))
    middles = ((corners + np.roll(corners, -1, axis=1)) / 2.0).reshape(-1, 3)
    used = np.unique(mesh.faces)
    targets = np.resize(np.concatenate([points[used], middles]), (N_DIRECTIONS, 3))
    inward = -np.resize(np.concatenate([normals[used], sums[edge_ids]]), (N_DIRECTIONS, 3))
    inward /= np.linalg.norm(inward, axis=1, keepdims=True)
    inward = inward + 0.02 * rng.normal(size=inward.shape)
    return targets, inward / np.linalg.norm(inward, axis=1, keepdims=True)


def test_no_hole_from_ten_thousand_directions(closed_case):
    mesh = closed_case.make()
    targets, inward = into(mesh, np.random.default_rng(1))
    faces, _ = cast(mesh, from_outside(targets, inward), cull=False)
    assert (faces != NO_HIT).all()


def test_aimed_rays_hit_their_target(ray_case):
    """Or, where they only touch, nowhere else than near there."""
    aimed = ray_case.make()
    rays = from_outside(aimed.targets, aimed.directions)
    faces, distances = cast(aimed.mesh, rays, cull=True)
    hit = faces != NO_HIT
    assert hit.all() or not aimed.must_hit
    # Touching lines graze a ball within half an edge, 0.02; those along a cube's faces enter by an
    # edge of its, at most its side away; the others hit what they are aimed at, to float32.
    slack = 1e-6 if aimed.must_hit else 1.0 if aimed.mesh.n_faces == 12 else 0.02
    np.testing.assert_allclose(distances[hit], 2.0, atol=slack)


@pytest.mark.parametrize("level", [0, 1, 2, 3])
def test_a_ball_is_hit_at_its_radius(level):
    """Closed form: rays to the center of a polyhedron end between its inner and outer radius."""
    mesh = icosphere(level)
    frame = LocalFrame.around(mesh)
    toward = directions(N_DIRECTIONS)
    found = RayScene.build(mesh, frame).cast(from_outside(np.zeros_like(toward), toward))
    assert (found.faces != NO_HIT).all()
    corners = frame.to_local(mesh.positions)[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    heights = np.einsum("ij,ij->i", normals, corners[:, 0])
    exact = heights[found.faces] / -np.einsum("ij,ij->i", normals[found.faces], toward)
    np.testing.assert_allclose(2.0 - found.distances, exact, atol=1e-12)
