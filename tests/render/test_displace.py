import numpy as np
import pytest

from texbake.errors import OptionError, UvError
from texbake.mesh.mesh import Mesh
from texbake.mesh.normals import face_normals
from texbake.mesh.shapes import cube, icosphere, plane, uv_sphere
from texbake.mesh.weld import weld_rows
from texbake.render.camera import Camera
from texbake.render.displace import displace, on_base, segments_for
from texbake.render.raster.rasterize import rasterize


def edges_of(mesh):
    """Directed edges by welded position, as (E, 2), without those of length 0."""
    faces = weld_rows(mesh.positions)[mesh.faces]
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    return edges[edges[:, 0] != edges[:, 1]]


def is_closed(mesh):
    edges = edges_of(mesh)
    forward = np.unique(edges, axis=0, return_counts=True)
    backward = np.unique(edges[:, ::-1], axis=0, return_counts=True)
    return all(np.array_equal(f, b) for f, b in zip(forward, backward, strict=True))


def split_cube():
    """Cube whose sides are charts of their own, so that every edge between sides is a seam."""
    mesh = cube()
    sides = np.repeat(np.arange(6), 2)
    side_faces = mesh.faces.reshape(6, 6)
    uvs = np.zeros((6, 8, 2))
    for side, used in enumerate(side_faces):
        flat = [a for a in range(3) if np.ptp(mesh.positions[used, a]) > 0]
        uvs[side] = (mesh.positions[:, flat] + 0.6) / 1.2 / 3 + (side % 3 / 3, side // 3 / 3)
    return mesh.replace(uvs=uvs.reshape(-1, 2), uv_faces=mesh.faces + 8 * sides[:, None])


@pytest.mark.parametrize("segments", [1, 2, 3, 8])
def test_no_displacement_cuts_and_moves_nothing(segments):
    mesh = icosphere(1).replace(uvs=np.zeros((1, 2)), uv_faces=np.zeros((80, 3), np.int32))
    cut = displace(mesh, np.zeros((4, 4), np.float32), segments=segments)
    assert cut.n_faces == 80 * segments**2
    # Euler: a closed surface of genus 0 has F / 2 + 2 vertices.
    assert cut.n_vertices == cut.n_faces // 2 + 2
    assert is_closed(cut)
    # The pieces of each face follow one another and are all alike, as it is itself.
    corners = mesh.positions[mesh.faces]
    vectors = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    pieces = cut.positions[cut.faces]
    piece_vectors = np.cross(pieces[:, 1] - pieces[:, 0], pieces[:, 2] - pieces[:, 0])
    np.testing.assert_allclose(
        piece_vectors, np.repeat(vectors, segments**2, axis=0) / segments**2, atol=1e-14
    )


def test_a_plane_follows_heights_that_are_linear():
    # Bilinear lookup of a linear ramp is the ramp itself, but for the half texel at the border,
    # where it is clamped.
    size = 32
    s = (np.arange(size, dtype=np.float32) + 0.5) / size
    heights = 0.5 + 0.25 * s[None, :] - 0.125 * s[::-1, None]
    cut = displace(plane(2, 2), heights, segments=16)
    x, y, z = cut.positions.T
    half = 0.5 / size
    s, t = np.clip(x, half, 1 - half), np.clip(y, half, 1 - half)
    # float32 heights near 1/2.
    np.testing.assert_allclose(z, 0.5 + 0.25 * s - 0.125 * t, atol=6e-8)
    assert len(np.unique(x)) == 33
    np.testing.assert_allclose(cut.uvs[cut.uv_faces], cut.positions[cut.faces][..., :2], atol=1e-15)


def test_a_sphere_grows_by_a_constant_height():
    mesh = uv_sphere(12, 24)
    cut = displace(mesh, np.full((2, 2, 1), 0.25, np.float32), segments=4)
    flat = displace(mesh, np.zeros((2, 2), np.float32), segments=4)
    moved = cut.positions - flat.positions
    np.testing.assert_allclose(np.linalg.norm(moved, axis=1), 0.25, rtol=1e-12)
    # Along the smooth normals: near the radius of the sphere on a mesh this coarse.
    radial = flat.positions / np.linalg.norm(flat.positions, axis=1, keepdims=True)
    assert (np.einsum("ij,ij->i", moved, radial) / 0.25).min() > 0.99


def test_seams_stay_closed_under_noise():
    mesh = split_cube()
    heights = np.random.default_rng(7).uniform(-0.05, 0.05, (64, 64)).astype(np.float32)
    for segments in 1, 2, 7, 16:
        cut = displace(mesh, heights, segments=segments)
        assert is_closed(cut)
        assert cut.n_vertices == cut.n_faces // 2 + 2
    assert np.abs(face_normals(cut)).max() <= 1.0


def test_a_seam_that_a_file_split_is_welded():
    # The same cube with a vertex of its own for each corner of each face, as STL has it.
    mesh = split_cube()
    soup = mesh.replace(
        positions=mesh.positions[mesh.faces].reshape(-1, 3),
        faces=np.arange(36, dtype=np.int32).reshape(12, 3),
    )
    heights = np.random.default_rng(8).uniform(-0.05, 0.05, (64, 64)).astype(np.float32)
    cut = displace(soup, heights, segments=5)
    assert is_closed(cut)
    whole = displace(mesh, heights, segments=5)
    # Angle-weighted normals and means are summed in another order.
    np.testing.assert_allclose(cut.positions[cut.faces], whole.positions[whole.faces], atol=1e-14)


def test_a_vertex_without_normal_stays():
    line = Mesh(
        positions=[[0, 0, 0], [1, 0, 0], [2, 0, 0]],
        faces=[[0, 1, 2]],
        uvs=[[0, 0], [0.5, 0], [1, 0]],
        uv_faces=[[0, 1, 2]],
    )
    cut = displace(line, np.ones((2, 2), np.float32), segments=3)
    assert not cut.positions[:, 1:].any()


def test_segments_resolve_texels_within_the_bound():
    mesh = plane()  # the longest edge in texture space is the diagonal
    assert segments_for(mesh, 100, 100, max_triangles=10**6) == 142
    assert segments_for(mesh, 100, 50, max_triangles=10**6) == 112
    assert segments_for(mesh, 100, 100, max_triangles=800) == 20
    assert segments_for(mesh, 100, 100, max_triangles=1) == 1


def test_places_on_the_base_are_those_of_its_corners():
    mesh = icosphere(1).replace(uvs=np.zeros((1, 2)), uv_faces=np.zeros((80, 3), np.int32))
    segments = 6
    cut = displace(mesh, np.zeros((1, 1), np.float32), segments=segments)
    matrix = Camera.framing(mesh).clip_from_world(1.0)
    fine = rasterize(cut.positions, cut.faces, matrix, 100, 100)
    base = on_base(fine, segments=segments)

    def points(visibility, mesh):
        covered = visibility.face_ids >= 0
        corners = mesh.positions[mesh.faces[visibility.face_ids[covered]]]
        weights = visibility.barycentrics[covered].astype(np.float64)
        weights = np.c_[1 - weights.sum(axis=1), weights]
        return np.einsum("nk,nkc->nc", weights, corners)

    np.testing.assert_array_equal(base.face_ids >= 0, fine.face_ids >= 0)
    # float32 weights, twice.
    np.testing.assert_allclose(points(base, mesh), points(fine, cut), atol=4e-7)


def test_what_cannot_be_displaced_is_an_error():
    with pytest.raises(UvError):
        displace(cube(), np.zeros((2, 2), np.float32), segments=2)
    with pytest.raises(OptionError, match="displacement: the shape"):
        displace(plane(), np.zeros((2, 2, 3), np.float32), segments=2)
    with pytest.raises(OptionError, match="segments"):
        displace(plane(), np.zeros((2, 2), np.float32), segments=0)
