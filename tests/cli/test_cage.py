"""`texbake cage` on files."""

import numpy as np
import pytest

from texbake import Mesh, fit_cage, read_mesh, write_mesh
from texbake.mesh.compose import join_meshes, transformed
from texbake.mesh.shapes import cube, orange, uv_sphere
from texbake.verbs.meshes import cage_file


@pytest.fixture(autouse=True)
def pair(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_mesh(orange(2_000), "high.ply")
    write_mesh(uv_sphere(6, 8), "low.obj")


BAKE = "-o n.png --size 32 --cage cage.obj --fail-on-miss 0"


def test_a_bake_accepts_the_cage(invoke):
    assert "moved by" in invoke("cage high.ply low.obj -o cage.obj").output
    assert read_mesh("cage.obj").n_faces == read_mesh("low.obj").n_faces
    invoke(f"bake-normals high.ply low.obj {BAKE}")


def test_objects_that_are_baked_apart_have_cages_of_their_own(tmp_path):
    """The ball bulges toward the cube, which is no reason for the cube's cage to be larger."""
    beside = np.eye(4)
    beside[0, 3] = 1.52
    box = transformed(cube(), beside).replace(name="box")
    highs, lows = ([mesh.replace(name="ball"), box] for mesh in (orange(2_000), uv_sphere(6, 8)))
    files = [tmp_path / f"{name}.obj" for name in ("high", "low", "cage")]
    for path, meshes in zip(files, (highs, lows), strict=False):
        write_mesh(join_meshes(meshes), path)
    report = cage_file(*files, margin=0.01).report
    alone = [fit_cage(*pair, margin=0.01) for pair in zip(highs, lows, strict=True)]
    distances = np.concatenate([cage.distances for cage in alone])
    assert np.allclose(report.distances, distances, rtol=0.0, atol=1e-6)
    joined = fit_cage(join_meshes(highs), join_meshes(lows), margin=0.01)
    assert joined.distances[-8:].max() > 2.0 * distances[-8:].max()


@pytest.mark.parametrize("inside_out", ["high.ply", "low.obj"])
def test_only_a_low_poly_mesh_that_is_inside_out_gets_a_warning(invoke, inside_out):
    line = "cage high.ply low.obj -o cage.obj"
    assert "faces against" not in invoke(line).output
    mesh = read_mesh(inside_out)
    write_mesh(Mesh(positions=mesh.positions, faces=mesh.faces[:, ::-1].copy()), inside_out)
    warned = "faces against the high-poly surface" in invoke(line).output
    assert warned is (inside_out == "low.obj")
    if not warned:
        invoke(f"bake-normals high.ply low.obj {BAKE}")
