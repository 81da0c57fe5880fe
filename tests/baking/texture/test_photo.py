"""Cameras of photographs: their matrices and their files."""

from pathlib import Path

import numpy as np
import pytest

from texbake.baking.texture.photos import PhotoCamera, read_camera
from texbake.errors import FileError, FileFormatError
from texbake.mesh.shapes import uv_sphere
from texbake.rendering.camera import Camera
from texbake.rendering.options import RenderOptions


def test_a_camera_projects_as_a_preview_does() -> None:
    """A point has the same position in the photograph as in a preview from the same camera."""
    options = RenderOptions(width=300, height=200, view=(35.0, -20.0))
    seen = Camera.framing(uv_sphere(8, 8), options=options)
    target = seen.eye - seen.axes[2]
    camera = PhotoCamera(
        position=tuple(seen.eye.tolist()), target=tuple(target.tolist()), fov=options.fov
    )
    np.testing.assert_allclose(camera.axes(), seen.axes, atol=1e-12)
    points = np.random.default_rng(0).uniform(-1, 1, (50, 3))
    homogeneous = np.column_stack([points, np.ones(50)])
    clip = homogeneous @ seen.clip_from_world(1.5).T
    s, t, _, q = camera.matrix(1.5) @ homogeneous.T
    np.testing.assert_allclose(s / q, (clip[:, 0] / clip[:, 3] + 1) / 2, atol=1e-12)
    np.testing.assert_allclose(t / q, (clip[:, 1] / clip[:, 3] + 1) / 2, atol=1e-12)


def test_cameras_are_read_from_toml_and_from_matrices(tmp_path: Path) -> None:
    toml = tmp_path / "front.toml"
    toml.write_text("position = [0, 1, 3]\ntarget = [0, 1, 0]\nup = [0, 0.5, 0]\nfov = 50\n")
    assert read_camera(toml) == PhotoCamera(
        position=(0, 1, 3), target=(0, 1, 0), up=(0, 0.5, 0), fov=50
    )
    by_windows = tmp_path / "bom.toml"
    by_windows.write_bytes(b"\xef\xbb\xbf" + toml.read_bytes().replace(b"\n", b"\r\n"))
    assert read_camera(by_windows) == read_camera(toml)
    numbers = tmp_path / "front.txt"
    numbers.write_text("1 0 0 0, 0 1 0 0, 0 0 1 0, 0 0 0 1")
    np.testing.assert_array_equal(np.array(read_camera(numbers)), np.eye(4))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("position = [0, 0, 1]", "target: it is missing"),
        ("target = [0, 0, 1]", "position: it is missing"),
        ("position = [0, 0]\ntarget = [0, 0, 1]", "position: .* is not 3 finite numbers"),
        ("position = 'x'\ntarget = [0, 0, 1]", "position: 'x' is not 3 finite numbers"),
        ("position = [0, 0, nan]\ntarget = [0, 0, 1]", "position"),
        ("position = [0, 0, 1]\ntarget = [0, 0, 1]", "target: it is the position of the camera"),
        ("position = [0, 5, 0]\ntarget = [0, 0, 0]", r"up: .* is along the view"),
        ("position = [0, 0, 1]\ntarget = [0, 0, 0]\nup = [0, 0, 0]", "up: .* has no length"),
        ("position = [0, 0, 1]\ntarget = [0, 0, 0]\nfov = 180", "fov: 180 degrees"),
        ("position = [0, 0, 1]\ntarget = [0, 0, 0]\nfov = true", "fov: True degrees"),
        ("position = [0, 0, 1]\ntarget = [0, 0, 0]\naspect = -1", "aspect: -1"),
        (
            "position = [0, 0, 1]\ntarget = [0, 0, 0]\nlens = 35",
            "lens: unknown key; a camera",
        ),
        ("position = [0,", "it is not TOML"),
        ("position = " + "[" * 10_000, "it is not TOML: maximum recursion depth"),
        ("position = " + "9" * 5000, "it is not TOML: Exceeds the limit"),
    ],
)
def test_an_error_in_a_file_names_the_key(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "camera.toml"
    file.write_text(text)
    with pytest.raises(FileFormatError, match=rf"camera\.toml: {message}"):
        read_camera(file)


def test_a_missing_file_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"no\.toml: "):
        read_camera(tmp_path / "no.toml")


def test_a_camera_at_any_distance_has_the_same_axes() -> None:
    near, far = (
        PhotoCamera(position=(scale, 2.0 * scale, 0.0), target=(0.0, 0.0, 0.0))
        for scale in (1.0, 2.0**1000)
    )
    np.testing.assert_array_equal(near.axes(), far.axes())
