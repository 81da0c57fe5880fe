"""What is painted on a mesh: importance and protected faces, by images and vertex colors."""

import numpy as np
import pytest

import texbake as tb
from texbake import OptionError, UnwrapOptions, write_image
from texbake.errors import FileFormatError, UvError
from texbake.jobs.painted_faces import importance_at, protected_at
from texbake.mapping.corner_uvs import signed_areas, surface_areas
from texbake.mapping.seams import seam_edges
from texbake.mesh.files.conversion import linear_colors
from texbake.mesh.shapes import cube, icosphere, uv_sphere
from texbake.mesh.topology import opposite_half_edges
from texbake.verbs.unwrap import unwrap_files


def painted(path, pixels):
    write_image(np.asarray(pixels, dtype=np.float32), path, color=False)
    return path


def test_the_image_of_a_ramp_gives_the_centers_of_faces(tmp_path):
    mesh = uv_sphere(16, 8)
    ramp = (np.arange(64) + 0.5) / 64.0
    path = painted(tmp_path / "ramp.exr", np.broadcast_to(ramp[None, :, None], (4, 64, 3)))
    centers = mesh.corner_uvs()[..., 0].mean(axis=1)
    assert np.allclose(importance_at(path, [mesh])[0], centers, atol=1e-2)
    (faces,) = protected_at(path, [mesh])
    assert np.array_equal(faces, np.flatnonzero(importance_at(path, [mesh])[0] > 0.5))


def test_what_is_transparent_is_black(tmp_path):
    path = painted(tmp_path / "clear.png", np.ones((4, 4, 4)) * [1.0, 1.0, 1.0, 0.0])
    assert (importance_at(path, [uv_sphere(8, 4)])[0] == 0.0).all()
    with pytest.raises(FileFormatError, match=r"clear\.png: no face of .* is more than half white"):
        protected_at(path, [uv_sphere(8, 4)])


def test_colors_that_are_stored_times_their_alpha_count_once(tmp_path):
    pixels = np.full((4, 4, 4), 0.5)  # white, half transparent, where the file stores products
    for name, gray in ("apart.png", 0.25), ("products.exr", 0.5):
        path = painted(tmp_path / name, pixels)
        assert np.allclose(importance_at(path, [uv_sphere(8, 4)])[0], gray, atol=0.01)


def test_an_image_that_cannot_be_read_everywhere_is_an_error(tmp_path):
    mesh = uv_sphere(8, 4)
    path = painted(tmp_path / "holes.exr", np.full((4, 4, 3), np.nan))
    with pytest.raises(FileFormatError, match=r"holes\.exr: importance: some values are not"):
        importance_at(path, [mesh])
    path = painted(tmp_path / "white.png", np.ones((4, 4, 3)))
    with pytest.raises(UvError, match="needs texture coordinates from 0 to 1"):
        protected_at(path, [mesh, mesh.replace(uvs=mesh.uvs + np.array([1.0, 0.0]))])


def test_files_of_several_meshes_share_an_image(tmp_path):
    ball, left = uv_sphere(16, 8), tmp_path / "left.obj"
    tb.write_mesh(ball.replace(uvs=ball.uvs * [0.5, 1.0]), left)
    tb.write_mesh(ball.replace(uvs=ball.uvs * [0.5, 1.0] + [0.5, 0.0]), tmp_path / "right.obj")
    sources, pixels = [left, tmp_path / "right.obj"], np.zeros((64, 64, 3))
    important = painted(tmp_path / "important.png", pixels + (np.arange(64) < 32)[:, None])
    pixels[20:44, 40:56] = 1.0
    protected = painted(tmp_path / "protected.png", pixels)
    free = unwrap_files(sources, tmp_path / "free", UnwrapOptions(size=256))
    found = unwrap_files(
        sources, tmp_path / "kept", UnwrapOptions(size=256), importance=important,
        protect=protected,
    )  # fmt: skip
    assert not any(report.notes for report in found.report)
    flat = [tb.read_mesh(tmp_path / "kept" / path.name) for path in sources]
    spaces = [surface_areas(mesh.positions[mesh.faces]).sum() for mesh in flat]
    textures = [signed_areas(mesh.corner_uvs()).sum() for mesh in flat]
    ratio = np.sqrt(textures[0] / spaces[0] / (textures[1] / spaces[1]))
    assert ratio == pytest.approx(4.0, rel=0.02)
    (none, faces) = protected_at(protected, [tb.read_mesh(path) for path in sources])
    assert len(none) == 0 and len(faces) > 20
    whole = np.isin(np.arange(ball.n_faces), faces)
    opposite = opposite_half_edges(flat[1].faces)
    inner = (opposite >= 0) & whole[opposite // 3] & np.repeat(whole, 3)
    freely = tb.read_mesh(tmp_path / "free" / "right.obj")
    assert seam_edges(freely).ravel()[inner].any()
    assert not seam_edges(flat[1]).ravel()[inner].any()
    assert len(free.report) == len(found.report) == 2


def test_vertex_colors_and_files_of_faces_count_as_well(tmp_path):
    mesh = icosphere(1)
    gray = np.linspace(0.0, 1.0, mesh.n_vertices, dtype=np.float32)
    colored = mesh.replace(colors=linear_colors(np.repeat(gray[:, None], 3, axis=1)))
    found = importance_at("colors", [colored])[0]
    assert np.allclose(found, gray[mesh.faces].mean(axis=1), atol=1e-6)
    bright = mesh.replace(colors=np.full((mesh.n_vertices, 3), 1.7, dtype=np.float32))
    assert (importance_at("colors", [bright])[0] == 1.0).all()
    tb.write_mesh(mesh.replace(faces=mesh.faces[[3, 5]]), tmp_path / "some.ply")
    (faces,) = protected_at(tmp_path / "some.ply", [mesh])
    assert faces.tolist() == [3, 5]


def test_what_is_not_there_is_an_error(tmp_path):
    path = painted(tmp_path / "white.png", np.ones((4, 4, 1)))
    with pytest.raises(OptionError, match="has no vertex colors"):
        importance_at("colors", [icosphere(1)])
    with pytest.raises(UvError, match="importance with an image needs texture coordinates"):
        importance_at(path, [icosphere(1)])
    with pytest.raises(UvError, match="protect with an image needs texture coordinates"):
        protected_at(path, [icosphere(1)])


@pytest.mark.parametrize("quality", ["fast", "good"])
def test_important_charts_get_more_texels(quality):
    mesh = cube()
    importance = np.arange(mesh.n_faces) // 2 / 5.0  # by sides
    changes = {"seams_at_hard_edges": True, "quality": quality, "symmetry": "off"}
    flat = tb.unwrap(mesh, importance=importance, **changes)
    areas = signed_areas(flat.corner_uvs()) / surface_areas(mesh.positions[mesh.faces])
    assert np.allclose(np.sqrt(areas / areas[0]), 4.0**importance)
    same = tb.unwrap(mesh, importance=np.full(mesh.n_faces, 0.5), **changes)
    assert np.allclose(same.uvs, tb.unwrap(mesh, **changes).uvs)


@pytest.mark.parametrize(("importance", "changes", "message"), [
    ([0.5], {}, "one number for each of the 80 faces"),
    (np.full(80, 1.5), {}, "not in the range 0 to 1"),
    (np.full(80, np.nan), {}, "not in the range 0 to 1"),
    (np.ones(80), {"method": "planar"}, "the method planar has no charts"),
])  # fmt: skip
def test_importance_that_cannot_be_used_is_an_error(importance, changes, message):
    with pytest.raises(OptionError, match=message):
        tb.unwrap(icosphere(1), importance=importance, **changes)
