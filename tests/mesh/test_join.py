from __future__ import annotations

import numpy as np

from texbake.mesh.compose import join_meshes
from texbake.mesh.shapes import cube, icosphere, plane


def test_one_mesh_comes_back_as_it_is() -> None:
    mesh = cube()
    assert join_meshes([mesh]) is mesh


def test_faces_keep_their_corners_and_coordinates() -> None:
    meshes = [plane(2, 1), plane(1, 3)]
    joined = join_meshes(meshes)
    corners = np.concatenate([mesh.positions[mesh.faces] for mesh in meshes])
    assert np.array_equal(joined.positions[joined.faces], corners)
    uvs = np.concatenate([mesh.corner_uvs() for mesh in meshes])
    assert np.array_equal(joined.corner_uvs(), uvs)
    assert joined.face_groups is not None
    assert joined.face_groups.tolist() == [0] * 4 + [1] * 6


def test_what_one_has_not_all_go_without() -> None:
    joined = join_meshes([plane(), icosphere(1)])
    assert joined.uvs is None
    assert joined.group_names == ("plane", "icosphere")
