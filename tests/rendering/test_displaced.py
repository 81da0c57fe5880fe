import numpy as np
import pytest
from displaced_mesh import are_closed, directed_edges, displace

from texbake.mesh.mesh import Mesh
from texbake.mesh.normals import face_normals
from texbake.mesh.shapes import cube, icosphere
from texbake.mesh.weld import weld_rows
from texbake.rendering.camera import Camera
from texbake.rendering.displaced import BaseSurface, EdgeView, displaced
from texbake.rendering.options import RenderOptions


def edges_of(mesh):
    """Directed edges by welded position."""
    return directed_edges(weld_rows(mesh.positions)[mesh.faces])


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


@pytest.mark.parametrize("edge_texels", [0.6, 1.0, 5.0, 100.0])
def test_seams_stay_closed_under_noise(edge_texels):
    mesh = split_cube()
    heights = np.random.default_rng(7).uniform(-0.05, 0.05, (64, 64)).astype(np.float32)
    cut = displace(mesh, heights, edge_texels=edge_texels)
    assert are_closed(edges_of(cut))
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
    cut = displace(soup, heights)
    assert are_closed(edges_of(cut))
    whole = displace(mesh, heights)
    assert cut.n_vertices == whole.n_vertices
    # Angle-weighted normals and means are summed in another order.
    np.testing.assert_allclose(cut.positions.sum(axis=0), whole.positions.sum(axis=0), atol=1e-11)
    np.testing.assert_allclose(
        np.sort(np.linalg.norm(cut.positions, axis=1)),
        np.sort(np.linalg.norm(whole.positions, axis=1)),
        atol=1e-14,
    )


def test_at_a_seam_a_vertex_moves_by_the_mean_of_its_heights():
    # Two triangles side by side in space, one on the black half of the map, one on the white.
    mesh = Mesh(
        positions=[[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]],
        faces=[[0, 1, 2], [2, 1, 3]],
        uvs=[[0.1, 0.1], [0.4, 0.1], [0.1, 0.4], [0.6, 0.1], [0.9, 0.1], [0.6, 0.4]],
        uv_faces=[[0, 1, 2], [3, 4, 5]],
    )
    heights = np.repeat(np.float32([[0, 0, 0, 0, 1, 1, 1, 1]]), 8, axis=0)
    cut = displace(mesh, heights, edge_texels=0.5)
    x, y, z = cut.positions.T
    np.testing.assert_array_equal(z, np.where(x + y == 1, 0.5, np.where(x + y < 1, 0.0, 1.0)))
    assert np.count_nonzero(x + y == 1) > 4


def test_a_vertex_without_normal_stays():
    line = Mesh(
        positions=[[0, 0, 0], [1, 0, 0], [2, 0, 0]],
        faces=[[0, 1, 2]],
        uvs=[[0, 0], [0.5, 0], [1, 0]],
        uv_faces=[[0, 1, 2]],
    )
    cut = displace(line, np.ones((4, 4), np.float32))
    assert cut.n_faces > 1
    assert not cut.positions[:, 1:].any()


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
