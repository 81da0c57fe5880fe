"""A mesh that stays in its file: bit for bit what `read_mesh` and whole-mesh normals give."""

import re
import struct

import numpy as np
import pytest

from texbake import FileError, Mesh, read_mesh, write_mesh
from texbake.errors import FileFormatError, MeshError
from texbake.mesh.normals import shading_normals, smooth_normals
from texbake.mesh.shapes import icosphere, uv_sphere
from texbake.mesh.streamed import source
from texbake.mesh.streamed.mesh import open_streamed

XYZ = ("x", "y", "z")


@pytest.fixture(autouse=True)
def _small_blocks(monkeypatch):
    monkeypatch.setattr(source, "ROWS_PER_BLOCK", 50)


def write_polygons(path, points, polygons, *, order="<", number="float", count="uchar", more=False):
    """Write a binary PLY file; with `more`, other properties stand around those that are read."""
    name = {"<": "little", ">": "big"}[order]
    code, length = {"float": "f", "double": "d"}[number], {"uchar": "B", "ushort": "H"}[count]
    lines = ["ply", f"format binary_{name}_endian 1.0", f"element vertex {len(points)}"]
    lines += ["property uchar flag"] * more + [f"property {number} {axis}" for axis in XYZ]
    lines += ["property short quality"] * more + [f"element face {len(polygons)}"]
    lines += ["property float area"] * more
    lines += [f"property list {count} int vertex_indices"] + ["property uchar kind"] * more
    body = b""
    for point in points:
        values = [7, *point, 9] if more else list(point)
        body += struct.pack(order + (f"B3{code}h" if more else f"3{code}"), *values)
    for polygon in polygons:
        layout = f"{'f' * more}{length}{len(polygon)}i{'B' * more}"
        values = [*[0.5] * more, len(polygon), *polygon, *[3] * more]
        body += struct.pack(order + layout, *values)
    path.write_bytes("\n".join([*lines, "end_header\n"]).encode() + body)
    return path


def opened(path, threads=2):
    mesh = open_streamed(path, threads=threads)
    assert mesh is not None
    return mesh


def assert_same(path):
    """Compare all that a streamed mesh gives with the whole mesh."""
    whole, mesh = read_mesh(path), opened(path)
    assert (mesh.name, mesh.n_faces) == (whole.name, whole.n_faces)
    np.testing.assert_array_equal(mesh.bounds, whole.bounds)
    corners = whole.positions[whole.faces]
    for size in (1, 37, 50, 10**6):
        chunks = list(mesh.chunks(size))
        assert [c.first for c in chunks] == list(range(0, whole.n_faces, size))
        found = np.concatenate([c.positions[c.faces] for c in chunks])
        np.testing.assert_array_equal(found, corners)
        if size < 100 and whole.n_faces > 100:
            break
    for step in (1, 7):
        found = mesh.spread_corners(step)
        np.testing.assert_array_equal(found, corners[::step].reshape(-1, 3))
    normals, normal_faces = shading_normals(whole)
    smooth = smooth_normals(whole)[whole.faces]
    for ids in (np.arange(0, whole.n_faces, 3), np.array([whole.n_faces - 1])):
        part = mesh.part(ids.astype(np.int32))
        np.testing.assert_array_equal(part.mesh.positions[part.mesh.faces], corners[ids])
        found = mesh.smooth_normals(part.vertices)[part.mesh.faces]
        assert found.tobytes() == smooth[ids].tobytes()
        if part.mesh.normals is not None and part.mesh.normal_faces is not None:
            np.testing.assert_array_equal(
                part.mesh.normals[part.mesh.normal_faces], normals[normal_faces[ids]]
            )
        if whole.colors is not None:
            assert part.mesh.colors is not None
            np.testing.assert_array_equal(
                part.mesh.colors[part.mesh.faces], whole.colors[whole.faces[ids]]
            )


@pytest.mark.parametrize("suffix", [".ply", ".stl"])
def test_what_texbake_writes(tmp_path, suffix):
    ball = uv_sphere(12, 15, lambda a, b: 1 + 0.1 * np.sin(5 * a) * np.sin(3 * b))
    write_mesh(Mesh(positions=ball.positions, faces=ball.faces), tmp_path / f"ball{suffix}")
    assert_same(tmp_path / f"ball{suffix}")


def test_normals_and_colors_of_vertices(tmp_path):
    ball = icosphere(2)
    normals = ball.positions.copy()
    normals[::9] = 0.0  # such are shaded with smooth ones
    colors = np.float32(0.5 + 0.5 * ball.positions)
    write_mesh(
        Mesh(
            positions=ball.positions * [1.0, 2.0, 0.5], faces=ball.faces, normals=normals,
            normal_faces=ball.faces, colors=colors,
        ),
        tmp_path / "ball.ply",
    )  # fmt: skip
    assert_same(tmp_path / "ball.ply")


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("number", ["float", "double"])
@pytest.mark.parametrize("count", ["uchar", "ushort"])
@pytest.mark.parametrize("more", [False, True])
def test_forms_of_rows(tmp_path, order, number, count, more):
    ball = icosphere(2)
    path = write_polygons(
        tmp_path / "ball.ply", ball.positions, ball.faces.tolist(), order=order, number=number,
        count=count, more=more,
    )  # fmt: skip
    assert_same(path)


@pytest.mark.parametrize("order", ["<", ">"])
def test_polygons(tmp_path, order):
    """Triangles in one block, quads in the next, then all sorts, some with no area at all."""
    ball = icosphere(2)
    rng = np.random.default_rng(3)
    faces = ball.faces.tolist()
    quads = [[*face, int(v)] for face, v in zip(faces[:60], rng.integers(0, 100, 60), strict=True)]
    mixed = [rng.integers(0, 100, n).tolist() for n in rng.integers(0, 8, 130)]
    path = write_polygons(
        tmp_path / "mixed.ply", ball.positions, [*faces[:70], *quads, *mixed], order=order
    )
    assert_same(path)


def test_faces_in_any_order_with_seams(tmp_path):
    """Vertices of distant chunks lie at one place, one of them at -0.0."""
    ball = icosphere(3)
    points = np.concatenate([ball.positions, ball.positions])
    points[ball.n_vertices :][points[ball.n_vertices :] == 0.0] = -0.0
    faces = ball.faces.copy()
    faces[::2] += ball.n_vertices
    faces = np.random.default_rng(1).permutation(faces)
    assert_same(write_polygons(tmp_path / "seams.ply", points, faces.tolist()))


def test_normals_that_cancel(tmp_path):
    """Two sheets back to back, far apart in the file, and faces without area before them."""
    ball = icosphere(2)
    faces = [[5, 5, 6], *ball.faces.tolist(), *ball.faces[:, ::-1].tolist()]
    path = write_polygons(tmp_path / "sheets.ply", ball.positions, faces)
    assert_same(path)
    whole = read_mesh(path)
    assert np.abs(np.linalg.norm(smooth_normals(whole), axis=1) - 1.0).max() < 1e-6


def damaged(change):
    def write(folder):
        ball = icosphere(2)
        path = write_polygons(folder / "bad.ply", ball.positions, ball.faces.tolist())
        content = bytearray(path.read_bytes())
        change(content)
        path.write_bytes(content)
        return path

    return write


def late_index(value):
    """Change the last index of the third face before the last."""
    return lambda content: content.__setitem__(slice(-30, -26), struct.pack("<i", value))


def truncated(n_bytes):
    return lambda content: content.__delitem__(slice(-n_bytes, None))


NAN_AT = -(320 * 13) - 12
DAMAGES = {
    "truncated in the last face": damaged(truncated(3)),
    "truncated by some faces": damaged(truncated(13 * 40)),
    "truncated in the vertices": damaged(truncated(320 * 13 + 5)),
    "index too great": damaged(late_index(162)),
    "index far too great": damaged(late_index(2**31 - 1)),
    "negative index": damaged(late_index(-1)),
    "a count too great": damaged(lambda content: content.__setitem__(-13, 200)),
    "not finite": damaged(
        lambda content: content.__setitem__(slice(NAN_AT, NAN_AT + 4), struct.pack("<f", np.nan))
    ),
    "no faces": lambda folder: write_polygons(folder / "bad.ply", icosphere(1).positions, []),
    "no triangles": lambda folder: write_polygons(
        folder / "bad.ply", icosphere(1).positions, [[0, 1], [], [2]]
    ),
    "no vertices": lambda folder: write_polygons(folder / "bad.ply", np.empty((0, 3)), [[0, 1, 2]]),
}


@pytest.mark.parametrize("name", DAMAGES)
def test_damaged_files_fail_as_when_read_whole(tmp_path, name):
    path = DAMAGES[name](tmp_path)
    with pytest.raises((FileFormatError, MeshError)) as whole:
        read_mesh(path)
    start = re.split(r" \(|; a mesh", str(whole.value))[0]
    with pytest.raises(type(whole.value), match=re.escape(start)) as streamed:
        open_streamed(path)
    assert "\n" not in str(streamed.value)


def test_missing_and_empty_files(tmp_path):
    with pytest.raises(FileError, match="there is no such file"):
        open_streamed(tmp_path / "none.ply")
    (tmp_path / "empty.stl").write_bytes(b"")
    with pytest.raises(FileFormatError, match="the file is empty"):
        open_streamed(tmp_path / "empty.stl")


def test_files_that_are_read_whole(tmp_path):
    ball = icosphere(1)
    write_mesh(ball, tmp_path / "ball.obj")
    (tmp_path / "ascii.ply").write_text(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
        "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
        "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    )
    (tmp_path / "ascii.stl").write_text("solid\nendsolid\n")
    seams = uv_sphere(4, 5)
    write_mesh(seams, tmp_path / "corners.ply")
    assert "copy_of" in (tmp_path / "corners.ply").read_bytes().decode("latin-1")
    for name in ("ball.obj", "ascii.ply", "ascii.stl", "corners.ply"):
        assert open_streamed(tmp_path / name) is None
