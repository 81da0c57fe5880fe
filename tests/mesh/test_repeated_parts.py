"""Parts that are copies of one another."""

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest

from texbake.mesh.compose import excerpt, join_meshes, transformed
from texbake.mesh.hard_edges import with_normals
from texbake.mesh.materials import Materials, MeshMaterial
from texbake.mesh.mesh import Mesh
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
    looks = replace(looks, uvs=mesh.corner_uvs())
    looks = looks if colors is None else replace(looks, colors=colors(mesh))
    return mesh, materials, RepeatedParts.of(mesh, looks)


def test_copies_are_found_wherever_they_lie_and_brought_back():
    source, _, found = repeated(
        [egg(), *(transformed(egg(), motion) for motion in MOTIONS.values())]
    )
    assert found.n_shared == 4
    one = excerpt(found.mesh, found.is_first)
    assert one.n_faces == egg().n_faces
    assert sorted(found.counts.tolist()) == [1] * 9 + [5]
    # The largest is the one that the others share the texels of.
    largest = transformed(egg(), MOTIONS["larger"])
    assert np.abs(one.bounds - largest.bounds).max() < 1e-9
    whole, _ = found.restored(one)
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


def many(shapes):
    """Shapes in a row."""
    return [
        transformed(shape, matrix(np.eye(3), (9.0 * i, 0.0, 0.0))) for i, shape in enumerate(shapes)
    ]


@pytest.mark.parametrize("sizes", list(permutations([0.55, 1.0, 1.9])))
def test_sizes_form_the_same_kinds_in_any_order(sizes):
    shapes = [egg().replace(positions=size * egg().positions) for size in sizes]
    (each,) = repeated(many(shapes))[2].copies
    assert len(each.numbers) == 2
    assert np.abs(each.matrices[1, :3, :3] - np.eye(3) / 1.9).max() < 1e-9


def test_many_shapes_of_as_many_faces_and_of_any_size_have_their_copies():
    rng = np.random.default_rng(0)
    box = np.indices((2, 2, 2)).reshape(3, 8).T - 0.5
    sides = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    faces = np.array([[side[i] for i in (0, j, j + 1)] for side in sides for j in (1, 2)], np.int32)
    boxes = [Mesh(positions=box * rng.uniform(1.0, 4.0, 3), faces=faces) for _ in range(30)]
    source = join_meshes(many(boxes + boxes))
    materials = Materials(
        face_materials=np.zeros(source.n_faces, np.int32), materials=(MeshMaterial(name="a"),)
    )
    for scale in (1.0, 1e160, 1e-170):
        found = RepeatedParts.among(source.replace(positions=source.positions * scale), materials)
        assert found.n_shared == 30
        low = excerpt(found.mesh, found.is_first)
        assert low.n_faces == 30 * 12
        whole, _ = found.restored(low)
        assert np.allclose(whole.bounds, source.bounds * scale, rtol=1e-9, atol=0.0)


def test_parts_that_were_dropped_are_those_of_the_others():
    eggs = [egg()] * 3
    tall = [egg().replace(positions=egg().positions * [1.0, 1.0, 2.0])] * 2
    found = repeated(many(eggs + tall))[2]
    two = next(each.numbers for each in found.copies if len(each.numbers) == 2)
    low = excerpt(found.mesh, found.is_first & ~np.isin(found.mesh.face_groups, two))
    assert low.n_faces == egg().n_faces
    assert found.restored(low)[0].n_faces == 3 * egg().n_faces
    assert found.left_in(low).n_shared == 2
