"""A ray into a closed mesh ends on its near side, through vertices, edges and faces alike."""

import numpy as np
import pytest

from texbake.mesh.frame import LocalFrame
from texbake.mesh.normals import face_normals, vertex_normals
from texbake.mesh.parametric.make import make
from texbake.mesh.shapes import cube, icosphere, uv_sphere
from texbake.raycast.rays import NO_HIT, Rays
from texbake.raycast.scene import RayScene

CONVEX = {
    "ball of 2,562 vertices": lambda: icosphere(4),
    "ball of rows": lambda: uv_sphere(24, 36),
    "cube": cube,
}
# A torus hides parts of itself, so a ray may end before its target.
SHAPES = {**CONVEX, "torus": lambda: make("torus", resolution=(48, 24))}
START = 2.0  # local units before the target; a mesh is 1 across
# Coordinates in the local frame are rounded by 1e-16, and so is a target's place on its face; along
# a ray that meets the face at the flattest angle below, that is a hundred times as much.
TOLERANCE = 1e-13
FLATTEST = 0.01  # cosine


def turned(mesh, scale, shift):
    """The mesh, turned out of its axes, scaled and moved by so many of its sizes."""
    axes, _ = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))
    axes[:, 0] *= np.sign(np.linalg.det(axes))
    points = mesh.positions @ axes if shift else mesh.positions
    return mesh.replace(positions=scale * (points + shift * mesh.diagonal * np.array([1, -2, 3])))


def targets_of(mesh, points):
    """Vertices, middles of edges and of faces, outward directions, and pairs (target, face)."""
    edges = np.sort(np.stack([mesh.faces, np.roll(mesh.faces, -1, axis=1)], axis=2), axis=2)
    edges, edge_of = np.unique(edges.reshape(-1, 2), axis=0, return_inverse=True)
    n_vertices, n_edges, faces = mesh.n_vertices, len(edges), np.arange(mesh.n_faces)
    middles = points[edges].mean(axis=1)
    targets = np.concatenate([points, middles, points[mesh.faces].mean(axis=1)])
    owners = np.concatenate(
        [mesh.faces.ravel(), n_vertices + edge_of.ravel(), n_vertices + n_edges + faces]
    )
    met = np.concatenate([np.repeat(faces, 3), np.repeat(faces, 3), faces])
    of_vertices, of_faces = vertex_normals(mesh), face_normals(mesh)
    of_edges = of_vertices[edges].sum(axis=1)
    of_edges /= np.linalg.norm(of_edges, axis=1, keepdims=True)
    return targets, np.concatenate([of_vertices, of_edges, of_faces]), (owners, met)


def rays_into(mesh, frame):
    """Rays to all targets: against the normals, a little turned, and side by side along axes."""
    targets, outward, (owners, met) = targets_of(mesh, frame.to_local(mesh.positions))
    rng, normals = np.random.default_rng(4), face_normals(mesh)
    headings = [-outward, -outward + 0.3 * rng.normal(size=outward.shape)]
    headings += [np.broadcast_to(axis, outward.shape) for axis in (*np.eye(3), -np.eye(3)[0])]
    origins, directions = [], []
    for heading in headings:
        heading = heading / np.linalg.norm(heading, axis=1, keepdims=True)
        # Into the mesh, for certain, where all faces that meet at the target face the ray.
        flattest = np.full(len(targets), -1.0)
        np.maximum.at(flattest, owners, np.einsum("ij,ij->i", normals[met], heading[owners]))
        into = flattest < -FLATTEST
        directions.append(heading[into])
        origins.append(targets[into] - START * heading[into])
    assert len(directions[0]) > 0.95 * len(targets)  # of those against the normals, all but few
    n = sum(map(len, origins))
    lengths = np.full(n, 2.0 * START)
    return Rays(np.concatenate(origins), np.concatenate(directions), lengths, lengths / 2.0)


@pytest.mark.parametrize("cull", [True, False], ids=["culled", "not culled"])
@pytest.mark.parametrize("shift", [0.0, 100.0])
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("shape", SHAPES)
def test_every_vertex_edge_and_face_is_hit_from_outside(shape, scale, shift, cull):
    mesh = turned(SHAPES[shape](), scale, shift)
    frame = LocalFrame.around(mesh)
    rays = rays_into(mesh, frame)
    found = RayScene.build(mesh, frame).cast(rays, cull_back_faces=cull)
    assert (found.faces != NO_HIT).all() and found.distances.max() <= START + TOLERANCE
    if shape in CONVEX:
        assert found.distances.min() >= START - TOLERANCE and not found.passed_back.any()
