"""Parts that are copies of one another."""

import numpy as np
import pytest

from texbake.mesh.compose import join_meshes, transformed
from texbake.mesh.hard_edges import with_normals
from texbake.mesh.materials import Materials, MeshMaterial
from texbake.mesh.repeated_parts import Looks, RepeatedParts
from texbake.mesh.shapes import uv_sphere


def egg():
    """A shape without any symmetry."""
    ball = uv_sphere(5, 9)
    return with_normals(
        ball.replace(positions=ball.positions * [1.0, 2.0, 3.0] + 0.3 * ball.positions**2), "smooth"
    )


def matrix(linear, place):
    found = np.eye(4)
    found[:3, :3], found[:3, 3] = linear, place
    return found


TURNED = np.array([[0.0, -1.0, 0.0], [0.8, 0.0, 0.6], [-0.6, 0.0, 0.8]])
MOTIONS = {
    "moved": matrix(np.eye(3), (9.0, 0.0, 0.0)),
    "turned": matrix(TURNED, (0.0, 9.0, 0.0)),
    "larger": matrix(1.5 * TURNED, (0.0, 0.0, 20.0)),
    "mirrored": matrix(TURNED * [1.0, 1.0, -1.0], (-9.0, 0.0, 0.0)),
}


def repeated(meshes, ids=None, colors=None):
    mesh = join_meshes([part.replace(name=str(i)) for i, part in enumerate(meshes)])
    mesh = mesh.replace(group_objects=tuple(range(len(meshes))))
    faces = np.zeros(mesh.n_faces, np.int32) if ids is None else np.array(ids)[mesh.face_groups]
    materials = Materials(face_materials=faces, materials=(MeshMaterial(name="a"),) * 2)
    looks = Looks.of(mesh, materials)
    shown = looks.colors if colors is None else colors(mesh)
    return mesh, materials, RepeatedParts.of(mesh, Looks(looks.materials, mesh.corner_uvs(), shown))


def test_copies_are_found_wherever_they_lie_and_brought_back():
    source, materials, found = repeated(
        [egg(), *(transformed(egg(), motion) for motion in MOTIONS.values())]
    )
    assert found.n_shared == 4
    one = found.one_each(found.mesh)
    assert one.n_faces == found.is_first.sum() == egg().n_faces
    # The largest is the one that the others share the texels of.
    largest = transformed(egg(), MOTIONS["larger"])
    assert np.abs(one.bounds - largest.bounds).max() < 1e-9
    whole, _ = found.restored(one, materials)
    assert whole.group_names == source.group_names
    for group in range(5):
        faces = [mesh.faces[mesh.face_groups == group] for mesh in (source, whole)]
        corners = [mesh.positions[f] for mesh, f in zip((source, whole), faces, strict=True)]
        assert np.abs(corners[0] - corners[1]).max() < 1e-9
        uvs = [mesh.corner_uvs()[mesh.face_groups == group] for mesh in (source, whole)]
        assert np.array_equal(*uvs)
        normals = [
            mesh.normals[mesh.normal_faces[mesh.face_groups == group]] for mesh in (source, whole)
        ]
        assert np.abs(normals[0] - normals[1]).max() < 1e-9


@pytest.mark.parametrize(("other", "given"), [
    (egg().replace(positions=egg().positions * [1.0, 1.0, 1.01]), {}),  # shape
    (egg(), {"ids": [0, 1]}),  # material
    (egg().replace(uvs=egg().uvs + 0.25), {}),  # texture coordinates
    (egg(), {"colors": lambda mesh: mesh.positions[mesh.faces]}),
    (egg().replace(normals=-egg().normals), {}),
    (egg().replace(positions=0.4 * egg().positions), {}),  # size
])  # fmt: skip
def test_parts_of_another_shape_or_look_are_no_copies(other, given):
    moved = transformed(other, MOTIONS["moved"])
    assert repeated([egg(), moved], **given)[2].n_shared == 0
    whole_tiles = transformed(egg().replace(uvs=egg().uvs + np.array([2.0, -1])), MOTIONS["moved"])
    assert repeated([egg(), whole_tiles])[2].n_shared == 1


def test_a_line_is_no_copy():
    flat = egg().replace(positions=egg().positions * [1.0, 0.0, 0.0])
    assert repeated([flat, transformed(flat, MOTIONS["moved"])])[2].n_shared == 0
