"""Safe repairs: the faults that they fix, and meshes that they leave alone."""

import numpy as np
import pytest

from texbake import Mesh, RepairOptions, make, repair
from texbake.mesh.normals import face_normals
from texbake.mesh.shapes import cube, icosphere, plane, uv_sphere
from texbake.mesh.topology import find_edges


def spoiled(mesh, seed):
    """The same surface with vertices split, faces turned, repeated and without area."""
    random = np.random.default_rng(seed)
    faces = np.arange(3 * mesh.n_faces).reshape(-1, 3)
    turned = random.random(len(faces)) < 0.4
    faces[turned] = faces[turned][:, ::-1]
    more = random.integers(0, len(faces), 5)
    flat = np.stack([faces[:3, 0], faces[:3, 1], faces[:3, 1]], axis=1)
    return Mesh(
        positions=mesh.positions[mesh.faces].reshape(-1, 3),
        faces=np.concatenate([faces, faces[more], flat]),
    )


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", ["icosphere", "torus", "cube"])
def test_a_spoiled_closed_mesh_is_restored(name, seed):
    meshes = {"icosphere": icosphere(2), "torus": make("torus", resolution=(9, 6)), "cube": cube()}
    mesh = meshes[name]
    repaired, report = repair(spoiled(mesh, seed))
    assert report.counts["duplicate faces"] == 5 and report.counts["faces without area"] == 3
    assert report.counts["vertices merged"] == 3 * mesh.n_faces - mesh.n_vertices
    # Corner by corner, up to where each face begins.
    before, after = (m.positions[m.faces] for m in (mesh, repaired))
    firsts = [np.abs(np.roll(after, k, axis=1) - before).max(axis=(1, 2)) for k in range(3)]
    assert np.min(firsts, axis=0).max() == 0.0


def test_an_open_mesh_keeps_the_side_that_most_faces_show():
    mesh = plane(4, 4)
    faces = mesh.faces.copy()
    faces[:5] = faces[:5, ::-1]
    repaired, report = repair(Mesh(positions=mesh.positions, faces=faces))
    assert report.counts["faces turned"] == 5
    assert not find_edges(repaired.faces).misoriented.any()
    assert (face_normals(repaired)[:, 2] == 1.0).all()


def test_a_one_sided_mesh_is_unchanged():
    strip = make("mobius", resolution=(16, 2))
    repaired, report = repair(strip)
    assert report.counts["faces turned"] == 0
    assert np.array_equal(repaired.faces, repair(repaired)[0].faces)


def test_turned_faces_take_their_normals_and_coordinates_with_them():
    ball = uv_sphere(4, 8)
    normals = ball.positions / np.linalg.norm(ball.positions, axis=1)[:, None]
    ball = ball.replace(normals=normals, normal_faces=ball.faces)
    inside_out = {
        name: np.ascontiguousarray(getattr(ball, name)[:, ::-1])
        for name in ("faces", "uv_faces", "normal_faces")
    }
    turned = ball.replace(**inside_out, normals=-ball.normals)
    repaired, report = repair(turned, RepairOptions(merge=False))
    assert report.counts["faces turned"] == ball.n_faces
    assert np.array_equal(repaired.faces, ball.faces)
    assert np.array_equal(repaired.corner_uvs(), ball.corner_uvs())
    assert np.array_equal(repaired.normals[repaired.normal_faces], ball.normals[ball.normal_faces])


@pytest.mark.parametrize("seed", range(3))
def test_a_second_repair_changes_nothing(seed):
    """Vertices that only removed faces used go as well."""
    mesh = spoiled(icosphere(1), seed)
    far = np.array([[2.0, 0.0, 0.0], [3.0, 0.0, 0.0], [4.0, 0.0, 0.0]])  # on one line
    n = mesh.n_vertices
    line = mesh.replace(
        positions=np.concatenate([mesh.positions, far]),
        faces=np.concatenate([mesh.faces, [[n, n + 1, n + 2]]]),
    )
    once, _ = repair(line)
    twice, report = repair(once)
    assert set(report.counts.values()) == {0}
    np.testing.assert_array_equal(twice.positions, once.positions)
    np.testing.assert_array_equal(twice.faces, once.faces)
    assert once.n_vertices == icosphere(1).n_vertices
