"""Tangents: Blender's MikkTSpace on torture meshes, closed forms, invariances, degeneration."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, strategies as st
from hypothesis.extra import numpy as hnp

from tests.models import CASES, REAL
from texbake.errors import UvError
from texbake.mesh.mesh import Mesh
from texbake.mesh.polygons import triangulated
from texbake.mesh.shapes import plane
from texbake.mesh.tangents import corner_tangents

# Steps are rounded to float32: a few times 2^-24 = 6e-8 for well-shaped triangles.
ROUNDING = 1e-6

# Tangents of Blender's MikkTSpace for these meshes: see tests/cases/make.py.
REFERENCES = [
    *(
        CASES / f"{name}_tangents.npz"
        for name in ("figure", "fused_cells", "mirrored_ball", "quads")
    ),
    *sorted((REAL / "mikktspace").glob("*.npz")),
]

SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
SQUARE_FACES = [[0, 1, 2], [0, 2, 3]]


def reference_mesh(reference):
    """The mesh of a file, and the corner of the file that each of its corners is."""
    faces = reference["faces"].ravel()
    sizes = reference.get("sizes", np.full(len(faces) // 3, 3))
    corners, polygons = triangulated("it", reference["positions"].astype(float), faces, sizes)
    mesh = Mesh(
        positions=reference["positions"], faces=faces[corners], uvs=reference["uvs"].reshape(-1, 2),
        uv_faces=corners, normals=reference["normals"].reshape(-1, 3), normal_faces=corners,
        polygon_of=polygons,
    )  # fmt: skip
    return mesh, corners


def square_mesh(uvs, **changes):
    return Mesh(positions=SQUARE, faces=SQUARE_FACES, uvs=uvs, uv_faces=SQUARE_FACES).replace(
        **changes
    )


def bumpy_mesh(n=12):
    """A sheet whose texture is mirrored at u = 0.5 and skewed everywhere."""
    sheet = plane(n, n, lambda x, y: 0.1 * np.sin(5 * x + 1) * np.cos(7 * y))
    u, v = sheet.uvs.T
    return sheet.replace(uvs=np.stack([np.minimum(u, 1 - u) + 0.2 * v * v, v + 0.1 * u], axis=1))


@pytest.mark.parametrize("path", REFERENCES, ids=lambda path: path.stem)
@pytest.mark.parametrize("scale", [1.0, 2.0**-20, 2.0**20])
def test_blenders_tangents(path, scale):
    reference = np.load(path)
    mesh, corners = reference_mesh(reference)
    ours = corner_tangents(mesh.replace(positions=mesh.positions * scale)).astype(float)
    theirs = reference["tangents"].reshape(-1, 3)[corners].astype(float)
    given_there = theirs.any(axis=2)
    ours, theirs = ours[given_there], theirs[given_there]
    signs = reference["signs"].ravel()[corners][given_there]
    sines = np.linalg.norm(np.cross(ours[:, :3], theirs), axis=1)
    degrees = np.degrees(np.arctan2(sines, (ours[:, :3] * theirs).sum(axis=1)))
    # The same float32 steps but for the order of sums, which shows where tangents nearly cancel.
    assert degrees.max() < 0.001
    assert np.array_equal(ours[:, 3], signs)


@given(hnp.arrays(np.float64, (2, 2), elements=st.floats(-2, 2)), st.floats(-1, 1))
def test_affine_mapping_has_its_closed_form(jacobian, offset):
    (u_x, u_y), (v_x, v_y) = jacobian
    determinant = u_x * v_y - u_y * v_x
    assume(abs(determinant) > 0.1)
    tangents = corner_tangents(square_mesh(SQUARE[:, :2] @ jacobian.T + offset))
    # u grows along the first column of the inverse of d(u, v) / d(x, y).
    along_u = np.array([v_y, -v_x]) / determinant
    expected = [*along_u / np.linalg.norm(along_u), 0.0, math.copysign(1.0, determinant)]
    # float32 coordinates of up to 5 over a determinant of at least 0.1.
    assert np.abs(tangents - expected).max() < 100 * ROUNDING


def test_mirrored_halves_keep_their_own_tangents_at_the_shared_edge():
    positions = [[-1, 0, 0], [0, 0, 0], [0, 1, 0], [1, 0, 0]]
    faces = [[0, 1, 2], [1, 3, 2]]
    uvs = [[1, 0], [0, 0], [0, 1], [1, 0]]
    tangents = corner_tangents(Mesh(positions=positions, faces=faces, uvs=uvs, uv_faces=faces))
    assert (tangents[0] == [-1, 0, 0, -1]).all() and (tangents[1] == [1, 0, 0, 1]).all()


class TestInvariance:
    @pytest.mark.parametrize("exponent", [-900, -20, 20, 900])
    def test_power_of_two_changes_no_bit(self, exponent):
        mesh = bumpy_mesh()
        scaled = mesh.replace(
            positions=np.ldexp(mesh.positions, exponent), uvs=np.ldexp(mesh.uvs, -exponent)
        )
        assert corner_tangents(scaled).tobytes() == corner_tangents(mesh).tobytes()

    def test_split_vertices_change_no_bit(self):
        mesh = bumpy_mesh()
        corners = np.arange(3 * mesh.n_faces).reshape(-1, 3)
        split = Mesh(
            positions=mesh.positions[mesh.faces.ravel()], faces=corners,
            uvs=mesh.uvs[mesh.uv_faces.ravel()], uv_faces=corners,
        )  # fmt: skip
        assert corner_tangents(split).tobytes() == corner_tangents(mesh).tobytes()


def with_one_normal(normal, uvs):
    return square_mesh(uvs, normals=[normal], normal_faces=np.zeros((2, 3), int))


X, MIRRORED = [1, 0, 0, 1], [1, 0, 0, -1]
BESIDE = [[0, 0, 1], *SQUARE_FACES]
COLLAPSED = [[0, 0, 1], [2, 2, 2]]
UVS = SQUARE[:, :2]
DEGENERATE = {
    # Corner 3 has the coordinates of corner 2: only the vertices of the shared edge have any.
    "face without texture area": (
        square_mesh([[0, 0], [1, 0], [1, 1], [1, 1]]), [[X] * 3, [X, X, MIRRORED]]
    ),
    "no texture area, the default of the reference": (square_mesh(np.zeros((4, 2))), MIRRORED),
    "collapsed face, which copies from its vertices": (
        Mesh(positions=SQUARE, faces=BESIDE, uvs=UVS * [-1, 1], uv_faces=BESIDE),
        [-1, 0, 0, -1],
    ),
    "collapsed faces alone": (
        Mesh(positions=SQUARE, faces=COLLAPSED, uvs=UVS, uv_faces=COLLAPSED), MIRRORED
    ),
    "zero normal, which leaves the direction in the face": (with_one_normal([0, 0, 0], UVS), X),
}  # fmt: skip


@pytest.mark.parametrize("name", DEGENERATE)
def test_degenerate_faces_have_the_tangents_of_the_reference(name):
    mesh, expected = DEGENERATE[name]
    assert (corner_tangents(mesh) == expected).all()


@pytest.mark.parametrize(("mesh", "sign"), [
    (square_mesh(np.zeros((4, 2)), positions=SQUARE[:, [2, 0, 1]]), 1),  # normals along x
    # The normal lies along the direction of u: nothing of it is left in the normal's plane.
    (with_one_normal([1, 0, 0], UVS), 1),
    (with_one_normal([1, 0, 0], UVS * [1, -1]), -1),
])  # fmt: skip
def test_without_a_direction_tangents_are_perpendicular_to_the_normal(mesh, sign):
    tangents = corner_tangents(mesh)
    assert (tangents[..., 0] == 0).all()
    assert np.abs(np.linalg.norm(tangents[..., :3], axis=2) - 1).max() < ROUNDING
    assert (tangents[..., 3] == sign).all()


def test_no_texture_coordinates():
    with pytest.raises(UvError, match="no texture coordinates"):
        corner_tangents(Mesh(positions=SQUARE, faces=SQUARE_FACES))


@pytest.mark.parametrize("axes", [(0, 1, 2), (1, 2, 0), (2, 0, 1)])
def test_a_needle_has_the_tangent_of_its_face_at_its_tip(axes):
    # The angle at the tip, 1e-8, is less than a float32 cosine can tell from 0.
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1e-8, 0.0]])[:, axes]
    mesh = Mesh(
        positions=points,
        faces=np.array([[0, 1, 2]], np.int32),
        uvs=np.array([[0.15, 0.15], [0.85, 0.15], [0.15, 0.85]]),
        uv_faces=np.array([[0, 1, 2]], np.int32),
    )
    along = np.array([1.0, 0.0, 0.0])[list(axes)]
    np.testing.assert_allclose(corner_tangents(mesh)[0, :, :3], np.tile(along, (3, 1)), atol=1e-6)
