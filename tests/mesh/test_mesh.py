"""How many faces a mesh may have."""

import numpy as np
import pytest

import texbake
from texbake import Mesh
from texbake.errors import FileFormatError, MeshError
from texbake.mesh import mesh as mesh_module
from texbake.mesh.files import conversion
from texbake.mesh.mesh import MAX_FACES, check_face_count
from texbake.mesh.shapes import uv_sphere


def test_half_edges_fit_int32():
    """The last half-edge of the largest mesh has a number, and that of one face more has none."""
    limit = np.iinfo(np.int32).max
    assert 3 * MAX_FACES - 1 <= limit < 3 * (MAX_FACES + 1) - 1
    check_face_count(MAX_FACES, "scan.ply")
    with pytest.raises(MeshError, match=r"^scan\.ply: it has 715,827,883 triangles; 715"):
        check_face_count(MAX_FACES + 1, "scan.ply")


def test_a_mesh_checks_its_face_count(monkeypatch):
    monkeypatch.setattr(mesh_module, "MAX_FACES", 1)
    faces = np.array([[0, 1, 2]])
    Mesh(positions=np.eye(3), faces=faces)
    with pytest.raises(MeshError, match="it has 2 triangles; 1 are the most"):
        Mesh(positions=np.eye(3), faces=np.repeat(faces, 2, axis=0))


@pytest.mark.parametrize("read", [texbake.read_mesh, texbake.read_scene])
def test_every_reader_counts_the_corners_that_it_places(tmp_path, monkeypatch, read):
    path = tmp_path / "ball.glb"
    texbake.write_mesh(uv_sphere(4, 6), path)
    monkeypatch.setattr(conversion, "MAX_CORNERS", 100)
    with pytest.raises(FileFormatError, match=r"ball\.glb: it places more .* split it"):
        read(path)


@pytest.mark.parametrize("positions", [
    np.eye(3).astype(str), np.eye(3).astype(complex), np.eye(3).astype(object),
    np.eye(3).astype("datetime64[s]"), [["a", "b", "c"]] * 3, [[0.0, 1.0], [2.0]],
])  # fmt: skip
def test_positions_are_numbers(positions):
    with pytest.raises(MeshError, match=r"^mesh: positions is not an array of numbers$"):
        Mesh(positions=positions, faces=[[0, 1, 2]])


def test_masked_numbers_are_not_taken_for_numbers():
    positions = np.ma.masked_array(np.eye(3), mask=np.eye(3) > 0.5)
    with pytest.raises(MeshError, match="positions has masked numbers"):
        Mesh(positions=positions, faces=[[0, 1, 2]])
    whole = np.ma.masked_array(np.eye(3), mask=False)
    np.testing.assert_array_equal(Mesh(positions=whole, faces=[[0, 1, 2]]).positions, np.eye(3))


@pytest.mark.parametrize("bad", [np.nan, -np.inf, 1e300])
@pytest.mark.parametrize("field", ["positions", "uvs", "normals", "tangents", "colors"])
def test_numbers_that_are_not_finite_are_refused_where_they_enter(bad, field):
    """Colors and tangents are float32, which does not hold 1e300."""
    corners = np.array([[0, 1, 2]], np.int32)
    fields = {
        "positions": np.eye(3), "uvs": np.eye(3)[:, :2], "uv_faces": corners,
        "normals": np.eye(3), "normal_faces": corners, "tangents": np.ones((1, 3, 4)),
        "colors": np.ones((3, 3)),
    }  # fmt: skip
    Mesh(faces=corners, **fields)
    fields[field].flat[1] = bad
    if bad == 1e300 and field not in ("tangents", "colors"):
        Mesh(faces=corners, **fields)
        return
    with pytest.raises(MeshError, match="not finite"):
        Mesh(faces=corners, **fields)
