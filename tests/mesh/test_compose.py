"""Meshes joined, and moved by affine maps."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from texbake.mesh.compose import (
    excerpt,
    is_mirroring,
    join_meshes,
    join_parts,
    transformed,
    with_alpha,
)
from texbake.mesh.mesh import Mesh, UvSet
from texbake.mesh.shapes import uv_sphere
from texbake.mesh.tangents import corner_tangents

SPHERE = uv_sphere(6, 8)
SPHERE = SPHERE.replace(normals=SPHERE.positions, normal_faces=SPHERE.faces)
SPHERE = SPHERE.replace(tangents=corner_tangents(SPHERE))


def matrix(linear, translation=(0, 0, 0)):
    full = np.eye(4)
    full[:3, :3], full[:3, 3] = linear, translation
    return full


def volume(mesh):
    a, b, c = (mesh.positions[mesh.faces[:, i]] for i in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum()) / 6.0


linear_maps = st.lists(
    st.floats(-4, 4, allow_subnormal=False), min_size=9, max_size=9
).map(lambda values: np.array(values).reshape(3, 3)).filter(
    lambda linear: np.linalg.cond(linear) < 1e4
)  # fmt: skip


@settings(max_examples=40)
@given(linear_maps)
def test_the_outside_stays_outside_and_normals_stay_normal(linear):
    moved = transformed(SPHERE, matrix(linear, (5, -3, 2)))
    # Relative to the center, the volume that triangles enclose is positive, and |det| as large.
    about = moved.replace(positions=moved.positions - (5, -3, 2))
    assert volume(about) == pytest.approx(abs(np.linalg.det(linear)) * volume(SPHERE), rel=1e-9)
    # A tangent plane goes to a tangent plane: normals stay perpendicular to moved tangents.
    corners = moved.normals[moved.normal_faces]
    tangents = moved.tangents[:, :, :3].astype(np.float64)
    facing = np.einsum("fci,fci->fc", corners, tangents)
    # 1e-3: float32 tangents, under maps of condition 1e4.
    assert np.abs(facing).max() < 1e-3
    # On a sphere p = n, and the inverse transpose of n and the map of p keep n·p = 1 above 0.
    assert (np.einsum("fci,fci->fc", corners, about.positions[about.faces]) > 0).all()


@pytest.mark.parametrize(
    "linear", [np.diag([-1, 1, 1]), np.diag([-2, -3, -4]), np.eye(3)[[1, 0, 2]]]
)
def test_tangents_of_a_mirror_image_are_those_made_of_it(linear):
    moved = transformed(SPHERE, matrix(linear))
    # What MikkTSpace makes of the mirrored mesh: the same directions with other signs. Corners at
    # the poles, where the map is singular, aside.
    made = corner_tangents(moved.replace(tangents=None))
    away = np.abs(moved.uvs[moved.uv_faces][:, :, 1] - 0.5) < 0.49
    np.testing.assert_array_equal(moved.tangents[away, 3], made[away, 3])
    if abs(np.linalg.det(linear)) == 1:  # without shear, directions agree to float32
        np.testing.assert_allclose(moved.tangents[away, :3], made[away, :3], atol=1e-5)


@pytest.mark.parametrize("size", [1e-150, 1e-9, 1e9, 1e150])
def test_size_does_not_matter(size):
    small = transformed(SPHERE, matrix(size * np.diag([-1, 1, 1])))
    np.testing.assert_allclose(small.normals, SPHERE.normals * (-1, 1, 1), atol=1e-12)
    np.testing.assert_array_equal(small.faces, SPHERE.faces[:, ::-1])


def test_a_map_whose_determinant_vanishes_in_rounding_mirrors_nothing():
    flat = np.array([[0.02, 0.0, 0.0], [0.0, 0.0, -0.02], [0.0, 5e-324, 1.2e-18]])
    assert not is_mirroring(flat)  # and no warning


ATTRIBUTES = ("uvs", "normals", "colors", "tangents", "uv_sets")


def part(seed, *attributes):
    """A sheet of triangles with some attributes, of random values, in two objects of two groups."""
    random = np.random.default_rng(seed)
    faces = random.permutation(12).reshape(4, 3).astype(np.int32)
    values = random.uniform(0.1, 1.0, (12, 4))
    fields = {
        "uvs": {"uvs": values[:, :2], "uv_faces": faces[::-1]},
        "normals": {
            "normals": np.eye(3)[random.integers(0, 3, 12)],
            "normal_faces": faces[:, ::-1],
        },
        "colors": {"colors": values[:, :3]},
        "tangents": {"tangents": values.reshape(4, 3, 4)},
        "uv_sets": {"uv_sets": {"light": UvSet(values[:, 2:], faces)}},
    }
    own = {key: value for name in attributes for key, value in fields[name].items()}
    return Mesh(
        positions=random.random((12, 3)), faces=faces, polygon_of=[0, 0, 1, 2], name=f"part {seed}",
        face_groups=[0, 1, 1, 2], group_names=("a", "b", "c"), group_objects=(3, 3, 5), **own,
    )  # fmt: skip


def corner_values(mesh, name):
    """(F, 3, K) values at the corners of a mesh, or those that joining gives a mesh without any."""
    if name == "uv_sets":
        return mesh.corner_uvs("light") if mesh.uv_sets else np.zeros((mesh.n_faces, 3, 2))
    if name == "colors":
        colors = np.ones((mesh.n_vertices, 4)) if mesh.colors is None else with_alpha(mesh.colors)
        return colors[mesh.faces]
    if name == "uvs":
        return np.zeros((mesh.n_faces, 3, 2)) if mesh.uvs is None else mesh.corner_uvs()
    if name == "normals":
        empty = np.zeros((mesh.n_faces, 3, 3))
        return empty if mesh.normals is None else mesh.normals[mesh.normal_faces]
    return mesh.tangents


@pytest.mark.parametrize("one", range(2 ** len(ATTRIBUTES)))
@pytest.mark.parametrize("other", [0, 31])
def test_a_joined_mesh_has_at_each_corner_what_its_part_has(one, other):
    names = [[a for i, a in enumerate(ATTRIBUTES) if bits >> i & 1] for bits in (one, other)]
    parts = [part(seed, *own) for seed, own in enumerate(names)]
    joined = join_parts(parts, "both")
    np.testing.assert_array_equal(
        joined.positions[joined.faces], np.concatenate([p.positions[p.faces] for p in parts])
    )
    assert (joined.tangents is None) == ("tangents" not in set(names[0]) & set(names[1]))
    for name in set(names[0] + names[1]) - ({"tangents"} if joined.tangents is None else set()):
        expected = np.concatenate([corner_values(p, name) for p in parts])
        np.testing.assert_array_equal(corner_values(joined, name), expected)
    assert joined.polygon_of.tolist() == [0, 0, 1, 2, 3, 3, 4, 5]
    assert joined.group_names == ("a", "b", "c") * 2
    assert joined.face_groups.tolist() == [0, 1, 1, 2, 3, 4, 4, 5]
    assert joined.group_objects == (3, 3, 5, 9, 9, 11)
    # And each part comes out of it again.
    for number, own in enumerate(parts):
        chosen = np.arange(joined.n_faces) // own.n_faces == number
        again = excerpt(joined, chosen)
        assert again.n_vertices == own.n_vertices
        for name in names[number]:
            if name != "tangents" or joined.tangents is not None:
                np.testing.assert_array_equal(corner_values(again, name), corner_values(own, name))


@pytest.mark.parametrize("name", ["uvs", "normals"])
def test_meshes_joined_keep_what_all_of_them_have_and_are_groups(name):
    parts = [part(0, *ATTRIBUTES), part(1, name), part(2, name)]
    joined = join_meshes(parts)
    expected = np.concatenate([corner_values(p, name) for p in parts])
    np.testing.assert_array_equal(corner_values(joined, name), expected)
    assert (joined.uvs is None, joined.normals is None) == (name != "uvs", name != "normals")
    assert joined.colors is None and joined.tangents is None
    assert joined.group_names == ("part 0", "part 1", "part 2")
    assert joined.group_objects == (0, 1, 2) and joined.name == "3 meshes"
    np.testing.assert_array_equal(joined.face_groups, np.repeat([0, 1, 2], 4))
    assert join_meshes(parts[:1]) is parts[0]


ARRAYS = ("positions", "faces", "uvs", "uv_faces", "normals", "normal_faces", "tangents", "colors",
          "face_groups", "polygon_of")  # fmt: skip


@pytest.mark.parametrize("seed", range(20))
def test_parts_are_joined_where_their_matrices_take_them(seed):
    """The same bits as from `transformed` parts, also where a matrix mirrors."""
    rng = np.random.default_rng(seed)
    own = [[name for name in ATTRIBUTES if rng.random() < 0.8] for _ in range(1 + seed % 4)]
    parts = [part(i, *names) for i, names in enumerate(own)]
    matrices = np.tile(np.eye(4), (len(parts), 1, 1))
    matrices[:, :3] = rng.normal(size=(len(parts), 3, 4))
    found = join_parts(parts, "a", matrices)
    moved = [transformed(p, matrix) for p, matrix in zip(parts, matrices, strict=True)]
    expected = join_parts(moved, "a")
    for name in ARRAYS:
        one, other = getattr(found, name), getattr(expected, name)
        assert (one is None) == (other is None), name
        assert one is None or one.tobytes() == other.tobytes(), name
    assert found.group_objects == expected.group_objects
    assert found.uv_sets.keys() == expected.uv_sets.keys()
    for name, item in found.uv_sets.items():
        np.testing.assert_array_equal(item.faces, expected.uv_sets[name].faces)
        np.testing.assert_array_equal(item.uvs, expected.uv_sets[name].uvs)
