"""Parts joined into one mesh: each face keeps what it had."""

from itertools import product

import numpy as np
import pytest

from texbake.baking.parts.high_parts import HighMeshes, NamedPart
from texbake.mesh.compose import excerpt
from texbake.mesh.materials import CHANNELS, ChannelSource, Materials, MeshMaterial
from texbake.mesh.normals import shading_normals
from texbake.mesh.shapes import cube, icosphere

RED = MeshMaterial(name="red", channels={"base-color": ChannelSource((1.0, 0.0, 0.0), None, 0.0)})
GREEN = MeshMaterial(name="green", channels={"roughness": ChannelSource((0.5,), None, 0.0)})


def meshes(with_normals, with_uvs, with_colors, with_groups):
    """A box and a ball; the flags say whether the box, and then the ball, has something."""
    made = []
    for i, mesh in enumerate((cube(), icosphere(1))):
        mesh = mesh.replace(name=f"mesh {i}", uvs=None, uv_faces=None)
        if with_normals[i]:
            mesh = mesh.replace(normals=-mesh.positions, normal_faces=mesh.faces)
        if with_uvs[i]:
            mesh = mesh.replace(uvs=mesh.positions[:, :2], uv_faces=mesh.faces)
        if with_colors[i]:
            rgba = np.abs(mesh.positions[:, [0, 1, 2, 0]]).astype(np.float32)
            mesh = mesh.replace(colors=rgba)
        if with_groups[i]:
            ids = (np.arange(mesh.n_faces) % 3).astype(np.int32)
            mesh = mesh.replace(face_groups=ids, group_names=tuple(f"{i}{g}" for g in "abc"))
        made.append(mesh)
    return made


def corners_of(mesh):
    """What the corners of faces have: positions, texture coordinates, colors, normals."""
    normals, normal_faces = shading_normals(mesh)
    return (
        mesh.positions[mesh.faces],
        np.zeros((mesh.n_faces, 3, 2)) if mesh.uvs is None else mesh.uvs[mesh.uv_faces],
        np.ones((mesh.n_faces, 3, 3)) if mesh.colors is None else mesh.colors[mesh.faces][..., :3],
        normals[normal_faces],
    )


@pytest.mark.parametrize("flags", list(product(product((0, 1), repeat=2), repeat=2)))
@pytest.mark.parametrize("materials", ["none", "first", "both"])
def test_faces_of_joined_parts_keep_all_they_had(flags, materials):
    (some, others) = flags
    parts = [
        NamedPart("b", 1, (0, 2)) if others[1] else NamedPart("b", 1),
        NamedPart("a", 0, (1,)) if others[0] else NamedPart("a", 0),
    ]
    made = meshes(some, some[::-1], others, others)
    of_meshes = [
        Materials(
            face_materials=np.arange(mesh.n_faces, dtype=np.int32) % 2,
            materials=pair,
            uv_sets={} if mesh.uvs is None else {number: number + mesh.uvs},
        )
        for mesh, pair, number in zip(made, ((RED, GREEN), (GREEN, RED)), (1, 2), strict=True)
    ]
    known = {"none": [None, None], "first": [of_meshes[0], None], "both": of_meshes}[materials]
    joined, of_joined = HighMeshes(made, known).joined(parts)
    chosen = [part.faces_of(made[part.mesh]) for part in parts]
    alone = [corners_of(excerpt(made[p.mesh], c)) for p, c in zip(parts, chosen, strict=True)]
    wanted = [np.concatenate(column) for column in zip(*alone, strict=True)]
    # Without any normals, those of the joined mesh are smooth over what it is made of.
    for column, values in zip(wanted[: 3 + any(some)], corners_of(joined), strict=False):
        np.testing.assert_allclose(values, column, atol=1e-12)
    for values, has in ((joined.normals, some), (joined.uvs, some), (joined.colors, others)):
        assert (values is None) == (not any(has))
    groups = [joined.group_names[g] for g in joined.face_groups]
    sources = [(made[p.mesh], known[p.mesh], c) for p, c in zip(parts, chosen, strict=True)]
    assert groups == [
        mesh.name if mesh.face_groups is None else mesh.group_names[mesh.face_groups[face]]
        for mesh, _, faces in sources
        for face in np.flatnonzero(faces)
    ]
    assert (of_joined is None) == (materials == "none")
    for number in (1, 2):
        corners = [
            number + mesh.uvs[mesh.uv_faces[faces]]
            if item is not None and number in item.uv_sets
            else np.zeros((faces.sum(), 3, 2))
            for mesh, (_, item, faces) in zip([made[p.mesh] for p in parts], sources, strict=True)
        ]
        if of_joined is not None and any(corner.any() for corner in corners):
            found_corners = of_joined.uv_sets[number][joined.uv_faces]
            np.testing.assert_array_equal(found_corners, np.concatenate(corners))
    for channel in () if of_joined is None else CHANNELS:
        found = of_joined.sources(channel)
        assert [found[m] for m in of_joined.face_materials] == [
            None if item is None else item.sources(channel)[item.face_materials[face]]
            for _, item, faces in sources
            for face in np.flatnonzero(faces)
        ]


def test_one_mesh_as_a_whole_stays_as_it_is():
    (mesh, _) = meshes((1, 1), (1, 1), (0, 0), (0, 0))
    joined, materials = HighMeshes([mesh]).joined([NamedPart("all", 0)])
    np.testing.assert_array_equal(joined.faces, mesh.faces)
    assert materials is None and joined.name == mesh.name


@pytest.mark.parametrize("colored", list(product((0, 1), repeat=2)))
@pytest.mark.parametrize("factors", list(product((False, True), repeat=2)))
def test_vertex_colors_are_factors_if_they_are_of_all_meshes_that_have_any(colored, factors):
    made = meshes((0, 0), (0, 0), colored, (0, 0))
    materials = [
        Materials(
            face_materials=np.zeros(mesh.n_faces, np.int32),
            materials=(RED,),
            has_vertex_colors=is_set,
        )
        for mesh, is_set in zip(made, factors, strict=True)
    ]
    _, joined = HighMeshes(made, materials).joined([NamedPart("a", 0), NamedPart("b", 1)])
    those = [is_set for is_set, has in zip(factors, colored, strict=True) if has]
    assert joined.has_vertex_colors == (bool(those) and all(those))
