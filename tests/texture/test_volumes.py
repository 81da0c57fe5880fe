"""Volumes from files, in scenes and baked into textures."""

import numpy as np
import pytest
from click.testing import CliRunner
from texbake_cli.main import texbake

from texbake.baking.texture.options import SolidOptions
from texbake.baking.texture.solid import bake_solid
from texbake.errors import FileFormatError, OptionError, TexbakeError
from texbake.mesh.files import write_mesh
from texbake.mesh.shapes import plane
from texbake.rendering.options import RenderOptions
from texbake.rendering.render import render_scene
from texbake.rendering.scene.material import Material
from texbake.rendering.scene.read import read_scene
from texbake.rendering.scene.scene import CameraView, Scene, SceneObject
from texbake.rendering.scene.textures import VolumeTexture
from texbake.texture.image import read_image, write_image
from texbake.texture.image_files import read_volume
from texbake.texture.lookup import ramp_lookup, volume_lookup

SCAN = np.random.default_rng(6).integers(0, 65536, (5, 6, 7)).astype(np.uint16)
LEGEND = ((0.0, 0.0, 0.5), (0.0, 0.5, 0.0), (1.0, 0.2, 0.0))


@pytest.fixture
def scan(tmp_path):
    np.save(tmp_path / "scan.npy", SCAN)
    return tmp_path / "scan.npy"


def test_arrays_and_stacks_of_images_are_read(scan, tmp_path):
    volume = read_volume(scan)
    np.testing.assert_array_equal(volume[..., 0], (SCAN / 65535).astype(np.float32))
    paths = [tmp_path / f"slice_{i}.png" for i in range(5)]
    for path, layer in zip(paths, volume, strict=True):
        write_image(layer, path, color=False, bits=16)
    np.testing.assert_allclose(read_volume(paths), volume, atol=1e-7)


@pytest.mark.parametrize(("array", "message"), [
    (np.zeros((3, 3)), "the shape"),
    (np.zeros((3, 3, 3, 2)), "the shape"),
    (np.full((2, 2, 2), np.nan), "not finite"),
    (np.array([{}], dtype=object), "not a .npy file"),
    (np.zeros((2, 2, 2), complex), "not one array of numbers"),
])  # fmt: skip
def test_other_arrays_are_refused(tmp_path, array, message):
    np.save(tmp_path / "a.npy", array)
    with pytest.raises(FileFormatError, match=message):
        read_volume(tmp_path / "a.npy")


def test_slices_of_different_sizes_are_refused(tmp_path):
    for name, size in (("a.png", 4), ("b.png", 5)):
        write_image(np.zeros((size, 4, 1), np.float32), tmp_path / name)
    with pytest.raises(FileFormatError, match=r"b\.png: it is 4 x 5 texels"):
        read_volume([tmp_path / "a.png", tmp_path / "b.png"])


@pytest.mark.parametrize("filter_name", ["nearest", "trilinear"])
@pytest.mark.parametrize("wrap", ["repeat", "mirror", "clamp", "border"])
def test_a_picture_shows_the_values_at_each_point(scan, filter_name, wrap):
    """A plane seen from far away, against the lookup at the centers of the pixels."""
    mesh = plane()
    mesh = mesh.replace(positions=mesh.positions * 3.0 - (1.0, 1.0, 0.0))
    texture = VolumeTexture(
        volume=scan, scale=(1.0, 1.0, 2.0), offset=(0.1, 0.0, 0.37), filter=filter_name, wrap=wrap,
        border=0.25, colors=LEGEND, range=(0.2, 0.9),
    )  # fmt: skip
    view = CameraView(position=(0.5, 0.5, 1000.0), target=(0.5, 0.5, 0.0), fov=0.17)
    item = SceneObject(mesh=mesh, material=Material(shading="unlit", base_color=texture))
    options = RenderOptions(width=24, height=24, supersampling=1)
    seen = render_scene(Scene(objects=(item,), view=view), options).color[..., :3]
    half = 1000.0 * np.tan(np.radians(0.17) / 2)
    steps = 0.5 + half * ((np.arange(24) + 0.5) / 12 - 1.0)
    x, y = np.meshgrid(steps, steps[::-1])
    points = np.stack([x + 0.1, y, np.full_like(x, 0.37)], axis=-1).reshape(-1, 3)
    volume = (SCAN[..., None] / 65535).astype(np.float32)
    values = volume_lookup(volume, points, wrap=wrap, filter=filter_name, border=0.25)
    expected = ramp_lookup(np.array(LEGEND), (values[:, 0] - 0.2) / 0.7)
    np.testing.assert_allclose(seen.reshape(-1, 3), expected, atol=2e-3)


@pytest.mark.parametrize("scale", [None, (0.1, 0.2, 0.15)])
def test_a_volume_fills_the_box_of_a_mesh_or_stands_at_the_origin_by_its_scale(scan, scale):
    corner = np.array([1.0, 2.0, 3.0])
    mesh = plane(2, 2)
    mesh = mesh.replace(positions=4.0 * mesh.positions + corner)
    options = SolidOptions(volume=(str(scan),), scale=scale, size=16, samples=1, padding=0)
    found = bake_solid(mesh, options).values
    steps = (np.arange(16) + 0.5) / 16
    x, y = np.meshgrid(steps, steps[::-1])
    points = np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3)
    places = points if scale is None else (4.0 * points + corner) * scale
    expected = volume_lookup(read_volume(scan), places, wrap="clamp")
    np.testing.assert_allclose(found.reshape(-1, 1), expected, atol=1e-5)


def test_bake_texture_takes_a_volume(scan, tmp_path):
    mesh = plane(2, 2)
    options = SolidOptions(volume=(str(scan),), size=16, samples=1, padding=0)
    found = bake_solid(mesh, options).values
    write_mesh(mesh, tmp_path / "a.obj")
    run = CliRunner().invoke(
        texbake,
        ["bake-texture", str(tmp_path / "a.obj"), "-o", str(tmp_path / "t.exr"), "--volume",
         str(scan), "--size", "16", "--samples", "1", "--padding", "0", "--data"],
    )  # fmt: skip
    assert run.exit_code == 0, run.output
    pixels = read_image(tmp_path / "t.exr", color=False).pixels
    np.testing.assert_allclose(pixels[..., :1], found, atol=1e-5)


def test_a_scene_file_has_a_volume(scan, tmp_path):
    file = tmp_path / "a.toml"
    head = '[[objects]]\nshape = "sphere"\n\n[objects.material]\nbase_color = '
    file.write_text(head + '{volume = "scan.npy", scale = 0.5, offset = [0.5, 0.5, 0.5]}\n')
    texture = read_scene(file).objects[0].material.base_color
    assert isinstance(texture, VolumeTexture) and texture.texels.shape == (5, 6, 7, 1)
    for wrong in ('{volume = "no.npy"}', '{volume = "scan.npy", space = "uv"}',
                  '{volume = "scan.npy", range = [1, 1]}', '{volume = []}'):  # fmt: skip
        file.write_text(head + wrong + "\n")
        with pytest.raises(TexbakeError):
            read_scene(file)
    with pytest.raises(OptionError):
        VolumeTexture(volume=scan, wrap="over")


def test_a_shape_beyond_the_file_takes_no_memory(tmp_path):
    header = b"{'descr': '<f4', 'fortran_order': False, 'shape': (65536, 65536, 64), }\n"
    content = b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header + bytes(64)
    (tmp_path / "bomb.npy").write_bytes(content)
    with pytest.raises(FileFormatError, match="not what its header promises"):
        read_volume(tmp_path / "bomb.npy")
