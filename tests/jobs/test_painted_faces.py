"""What is painted on a mesh: importance and protected faces, by images and vertex colors."""

import numpy as np
import pytest

import texbake as tb
from texbake.errors import FileFormatError, OptionError, UvError
from texbake.jobs.painted_faces import importance_at, protected_at
from texbake.mapping.corner_uvs import signed_areas, surface_areas
from texbake.mesh.shapes import cube, icosphere, uv_sphere
from texbake.texture.image import write_image


def painted(path, pixels):
    write_image(np.asarray(pixels, dtype=np.float32), path, color=False)
    return path


def test_the_image_of_a_ramp_gives_the_centers_of_faces(tmp_path):
    mesh = uv_sphere(16, 8)
    ramp = (np.arange(64) + 0.5) / 64.0
    path = painted(tmp_path / "ramp.exr", np.broadcast_to(ramp[None, :, None], (4, 64, 3)))
    centers = mesh.corner_uvs()[..., 0].mean(axis=1)
    assert np.allclose(importance_at(path, mesh), centers, atol=1e-2)
    (faces,) = protected_at(path, [mesh])
    assert np.array_equal(faces, np.flatnonzero(importance_at(path, mesh) > 0.5))


def test_what_is_transparent_is_black(tmp_path):
    path = painted(tmp_path / "clear.png", np.ones((4, 4, 4)) * [1.0, 1.0, 1.0, 0.0])
    assert (importance_at(path, uv_sphere(8, 4)) == 0.0).all()
    with pytest.raises(FileFormatError, match=r"clear\.png: no face of .* is more than half white"):
        protected_at(path, [uv_sphere(8, 4)])


def test_vertex_colors_and_files_of_faces_count_as_well(tmp_path):
    mesh = icosphere(1)
    gray = np.linspace(0.0, 1.0, mesh.n_vertices, dtype=np.float32)
    colored = mesh.replace(colors=np.repeat(gray[:, None], 3, axis=1))
    assert np.allclose(importance_at("colors", colored), gray[mesh.faces].mean(axis=1))
    tb.write_mesh(mesh.replace(faces=mesh.faces[[3, 5]]), tmp_path / "some.ply")
    (faces,) = protected_at(tmp_path / "some.ply", [mesh])
    assert faces.tolist() == [3, 5]


def test_what_is_not_there_is_an_error(tmp_path):
    path = painted(tmp_path / "white.png", np.ones((4, 4, 1)))
    with pytest.raises(OptionError, match="has no vertex colors"):
        importance_at("colors", icosphere(1))
    with pytest.raises(UvError, match="over which importance reads an image"):
        importance_at(path, icosphere(1))
    with pytest.raises(UvError, match="over which protect reads an image"):
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


@pytest.mark.parametrize(
    ("importance", "changes", "message"),
    [
        ([0.5], {}, "one number for each of the 80 faces"),
        (np.full(80, 1.5), {}, "not in the range 0 to 1"),
        (np.full(80, np.nan), {}, "not in the range 0 to 1"),
        (np.ones(80), {"method": "planar"}, "the method planar has no charts"),
    ],
)
def test_importance_that_cannot_be_used_is_an_error(importance, changes, message):
    with pytest.raises(OptionError, match=message):
        tb.unwrap(icosphere(1), importance=importance, **changes)
