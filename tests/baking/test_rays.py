"""Rays start where they should, and every sample has a direction or is known to have none."""

import numpy as np
import pytest

from texbake.baking.rays import RayField, UnobstructedRays
from texbake.baking.texels import Samples
from texbake.mesh.compose import join_meshes
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import cube, plane, uv_sphere
from texbake.raycast.scene import RayScene


def samples_on(mesh, n=500, seed=0):
    rng = np.random.default_rng(seed)
    weights = rng.dirichlet([1, 1, 1], n)
    faces = rng.integers(0, mesh.n_faces, n).astype(np.int32)
    points = np.einsum("ni,nij->nj", weights, mesh.positions[mesh.faces[faces]])
    return Samples(np.zeros(n, dtype=np.int32), faces, weights[:, 1:].copy()), points


@pytest.mark.parametrize("kind", ["smooth", "vertex", "face"])
def test_rays_go_through_their_sample_from_front_to_back(kind):
    mesh = uv_sphere(8, 12)
    frame = LocalFrame.around(mesh)
    samples, points = samples_on(mesh)
    rays = RayField(mesh, frame, kind=kind, front=0.3, back=0.2).rays(samples)
    np.testing.assert_allclose(np.linalg.norm(rays.directions, axis=1), 1, atol=1e-14)
    np.testing.assert_allclose(frame.length_to_model(rays.lengths), 0.5, rtol=1e-14)
    through = rays.origins + rays.fronts[:, np.newaxis] * rays.directions
    np.testing.assert_allclose(frame.to_model(through), points, atol=1e-14)
    # Inward: towards the middle of the sphere.
    assert (np.einsum("ij,ij->i", rays.directions, points) < -0.9 * 0.9).all()


def test_smooth_rays_leave_no_gap_at_a_hard_edge():
    """Two faces of a cube that share an edge send the same ray from each of its points."""
    mesh = cube()
    frame = LocalFrame.around(mesh)
    normals = np.repeat(np.eye(3), [0, 0, 1], axis=0)
    split = mesh.replace(normals=normals, normal_faces=np.zeros((mesh.n_faces, 3), dtype=int))
    field = RayField(split, frame, kind="smooth", front=0.1, back=0.1)
    along = np.linspace(0, 1, 11)
    starts = {}
    for face, corners in enumerate(mesh.faces):
        for k in range(3):
            edge = (corners[k], corners[(k + 1) % 3])
            weights = np.zeros((11, 3))
            forward = edge[0] < edge[1]
            weights[:, k] = 1 - along if forward else along
            weights[:, (k + 1) % 3] = along if forward else 1 - along
            faces = np.full(11, face, dtype=np.int32)
            samples = Samples(np.zeros(11, dtype=np.int32), faces, weights[:, 1:].copy())
            starts.setdefault(tuple(sorted(edge)), []).append(field.rays(samples).origins)
    assert len(starts) == 18
    for both in starts.values():
        np.testing.assert_allclose(both[0], both[1], atol=1e-15)


def test_normals_that_cancel_fall_back_to_the_face():
    """Two triangles back to back: their smooth normals cancel at every vertex."""
    positions = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    normals = [[0, 0, 1], [0, 0, -1], [0, 0, 0]]
    # At the middle of the first edge the corners' normals cancel.
    mesh = Mesh(
        positions=positions, faces=[[0, 1, 2]], normals=normals[:2], normal_faces=[[0, 1, 0]]
    )
    samples = Samples(np.zeros(1, np.int32), np.zeros(1, np.int32), np.array([[0.5, 0.0]]))
    rays = RayField(mesh, LocalFrame.around(mesh), kind="vertex", front=0.1, back=0.1).rays(samples)
    np.testing.assert_allclose(rays.directions, [[0, 0, -1]], atol=1e-15)


def test_a_face_without_a_direction_sends_no_ray():
    mesh = Mesh(positions=[[0, 0, 0], [1, 0, 0], [2, 0, 0]], faces=[[0, 1, 2]])
    samples = Samples(np.zeros(1, np.int32), np.zeros(1, np.int32), np.array([[0.3, 0.3]]))
    for kind in "smooth", "vertex", "face":
        rays = RayField(mesh, LocalFrame.around(mesh), kind=kind, front=0.1, back=0.1).rays(samples)
        assert rays.lengths[0] == 0
        assert np.isfinite(rays.origins).all()
        np.testing.assert_array_equal(rays.directions, 0)


@pytest.mark.parametrize(
    ("height", "faces_up", "front", "back"),
    [(0.3, False, 0.3, 0.7), (0.3, True, 0.8, 0.7), (-0.2, False, 0.8, 0.2), (-0.2, True, 0.8, 0.7),
     (0.9, False, 0.8, 0.7), (-0.75, False, 0.8, 0.7)],
)  # fmt: skip
def test_another_part_of_the_low_poly_mesh_ends_rays_where_it_faces_their_own(
    height, faces_up, front, back
):
    """Rays of a floor: what looks at it from above is another part, its underside is its end."""
    other = plane()
    other = other.replace(positions=other.positions + np.array([0.0, 0.0, height]))
    if not faces_up:
        other = other.replace(faces=other.faces[:, ::-1], uv_faces=other.uv_faces[:, ::-1])
    low = join_meshes([plane(), other])
    frame = LocalFrame.around(low)
    samples = samples_on(plane(), 20)[0]
    field = RayField(low, frame, kind="face", front=0.8, back=0.7)
    rays = UnobstructedRays(field, RayScene.build(low, frame)).rays(samples)
    np.testing.assert_allclose(rays.directions, [[0, 0, -1]] * 20, atol=1e-15)
    np.testing.assert_allclose(frame.length_to_model(rays.fronts), front, atol=1e-6)
    np.testing.assert_allclose(frame.length_to_model(rays.lengths), front + back, atol=2e-6)
    np.testing.assert_allclose(frame.to_model(rays.origins)[:, 2], front, atol=1e-6)
