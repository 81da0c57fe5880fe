import math
from dataclasses import replace

import numpy as np
import pytest

from texbake.mesh.oklch import linear_from_oklch
from texbake.mesh.shapes import plane, uv_sphere
from texbake.rendering.camera import Camera
from texbake.rendering.draw import draw, prepare
from texbake.rendering.options import BUFFERS, RenderOptions
from texbake.rendering.scene.lights import Environment, Fog, Light, Lighting
from texbake.rendering.scene.material import Material, NormalMap
from texbake.rendering.scene.scene import Scene, SceneObject, transform_matrix
from texbake.rendering.scene.textures import ImageTexture
from texbake.texture.encoding import encode_srgb

# Codes from 0 to 1: float32 light, encoded.
CLOSE = {"rtol": 0.0, "atol": 3e-6}


def codes(wall, buffer, material=None, **fields):
    """(16, 24, 3): the picture of a buffer, as a file holds it."""
    options = replace(wall.options, buffer=buffer)
    return encode_srgb(wall.light(material or Material(), options=options, **fields))


def test_depth_goes_from_white_at_the_nearest_to_dark_at_the_farthest(wall):
    found = codes(wall, "depth")
    away = (wall.camera.eye - wall.points) @ wall.camera.axes[2]
    level = (away.max() - away) / (away.max() - away.min())
    # Corners, far out, lie on a grid of 1/256 pixel: 1/256 of the change from pixel to pixel.
    np.testing.assert_allclose(found[..., 0], 0.05 + 0.95 * level, atol=2e-4)
    np.testing.assert_array_equal(found[..., 1], found[..., 0])


def test_normals_are_coded_as_in_a_map(wall):
    normal = np.array((0.48, -0.6, 0.64))
    found = codes(wall, "normals", normal=normal)
    np.testing.assert_allclose(found, np.broadcast_to(normal / 2 + 0.5, found.shape), **CLOSE)
    # With a map, those of the map.
    texel = np.array((0.0, 0.6, 0.8), np.float32)
    image = ImageTexture(image=np.broadcast_to(texel, (2, 2, 3)).copy(), filter="nearest")
    found = codes(wall, "normals", Material(normal_map=NormalMap(texture=image)))
    np.testing.assert_allclose(found, np.broadcast_to(texel / 2 + 0.5, found.shape), **CLOSE)


def test_coordinates_are_red_and_green_and_start_again_in_each_tile(wall):
    found = codes(wall, "uv")
    np.testing.assert_allclose(found[..., :2], wall.uvs, **CLOSE)
    assert not found[..., 2].any()
    tiled = wall.mesh().uvs * 7 - 3
    found = codes(wall, "uv", uvs=tiled)
    expected = (wall.uvs * 7 - 3) % 1.0
    apart = np.abs(found[..., :2] - expected)
    assert np.minimum(apart, 1 - apart).max() < 1e-5


def rho(wall, width, height):
    """Largest step of a pixel in texels, from differences of closed forms."""
    origin, right, down = wall.camera.view_rays(24, 16)
    columns, rows = np.meshgrid(np.arange(24) + 0.5, np.arange(16) + 0.5)

    def uv(i, j):
        rays = origin + i[..., None] * right + j[..., None] * down
        points = wall.camera.eye - wall.camera.eye[2] / rays[..., 2:] * rays
        return (points[..., :2] / 10 + 0.5) * (width, height)

    h = 1e-4
    across = (uv(columns + h, rows) - uv(columns - h, rows)) / (2 * h)
    below = (uv(columns, rows + h) - uv(columns, rows - h)) / (2 * h)
    return np.maximum(np.linalg.norm(across, axis=-1), np.linalg.norm(below, axis=-1))


@pytest.mark.parametrize("scale", [1.0, 4.0])
def test_mip_levels_have_hues_and_magnified_texels_none(wall, scale):
    for size, shape in ((None, (1024, 1024)), ((64, 32), (64, 32)), ((512, 64), (512, 64))):
        material, stretch = Material(), 1.0
        if size is not None:
            texels = np.zeros((size[1], size[0], 3), np.float32)
            material = Material(base_color=ImageTexture(image=texels, scale=(scale, scale)))
            stretch = scale
        levels = np.log2(stretch * rho(wall, *shape))
        options = replace(wall.options, buffer="mip-level")
        found = wall.light(material, options=options)
        expected = linear_from_oklch(
            0.75, np.where(levels < 0, 0.0, 0.14), 30.0 + 50.0 * np.maximum(levels, 0)
        )
        sure = np.abs(levels) > 1e-3
        assert sure.mean() > 0.95
        np.testing.assert_allclose(found[sure], expected[sure], atol=2e-4)


def test_the_texel_grid_is_a_checker_where_texels_are_large(wall):
    texels = np.zeros((4, 8, 3), np.float32)
    image = ImageTexture(image=texels, filter="bilinear", scale=(1.0, 2.0))
    found = codes(wall, "texel-grid", Material(base_color=image))
    assert rho(wall, 8, 8).max() < 0.5  # texels of at least two pixels: in full
    odd = np.floor(wall.uvs * (8, 8)).sum(axis=-1) % 2
    expected = 0.5 + (odd - 0.5) * 0.7
    np.testing.assert_allclose(found, np.repeat(expected[..., None], 3, -1), **CLOSE)
    # Texels below a pixel are gray.
    small = ImageTexture(image=np.zeros((2048, 2048, 3), np.float32))
    found = codes(wall, "texel-grid", Material(base_color=small))
    np.testing.assert_allclose(found, 0.5, **CLOSE)


def stack(n):
    """Planes behind one another, each drawn over by the next."""
    return tuple(
        SceneObject(
            mesh=plane(), name=f"{i}",
            transform=transform_matrix(scale=4, translate=(-2, -2, 0.01 * i)),
        )
        for i in range(n)
    )  # fmt: skip


@pytest.mark.parametrize("n", [1, 3, 16, 20])
def test_overdraw_counts_the_triangles_on_a_sample(n):
    options = RenderOptions(width=16, height=12, supersampling=2, buffer="overdraw")
    camera = Camera.looking_at((0.01, 0.02, 2.0), (0.01, 0.02, 0.0), fov=0.3, near=0.1)
    frame = draw(prepare(Scene(objects=stack(n)), options), camera)
    found = encode_srgb(frame.color[..., :3])
    np.testing.assert_allclose(found, min(n, 16) / 16, atol=3e-6)


def test_objects_have_hues_of_their_own():
    options = RenderOptions(width=64, height=24, supersampling=1, buffer="object-id")
    items = tuple(
        SceneObject(
            mesh=uv_sphere(8, 16), transform=transform_matrix(scale=0.5, translate=(i, 0, 0))
        )
        for i in range(6)
    )
    camera = Camera.looking_at((2.5, 0, 9), (2.5, 0, 0), fov=0.3, near=0.1)
    frame = draw(prepare(Scene(objects=items), options), camera)
    n_faces = items[0].mesh.n_faces
    colors = []
    for i in range(6):
        own = frame.color[(frame.face_ids // n_faces == i) & (frame.face_ids >= 0)]
        assert len(own) > 10
        np.testing.assert_array_equal(own, own[0:1].repeat(len(own), 0))
        colors.append(own[0, :3])
    for i in range(6):
        for j in range(i):
            assert np.linalg.norm(colors[i] - colors[j]) > 0.1


@pytest.mark.parametrize("buffer", BUFFERS)
def test_nothing_is_lit_for_a_buffer_and_threads_change_no_byte(buffer):
    sky = Environment(color=(1.0, 0.0, 0.0), lighting=True)
    scene = Scene(
        objects=(
            SceneObject(mesh=uv_sphere(12, 24), material=Material(opacity=0.5)),
            SceneObject(mesh=plane()),
        ),
        lighting=Lighting(lights=(Light(),), environment=sky, fog=Fog()),
    )
    options = RenderOptions(width=40, height=900, buffer=buffer)
    camera = Camera.framing(uv_sphere(4, 8), options=options)
    one, three = (draw(prepare(scene, options, threads=n), camera) for n in (1, 3))
    assert one.color.tobytes() == three.color.tobytes()
    assert np.isfinite(one.color).all()
    names = {item.name for item in one.plan.passes}
    assert "buffer" in names
    assert not names & {"slots", "lights", "environment", "background", "fog", "transparency"}
    # Behind is the options' color, whatever the scene has.
    assert math.isclose(encode_srgb(one.color[0, 0, 0]), 0.15, abs_tol=1e-6)


def test_a_picture_of_nothing_shows_the_background():
    away = SceneObject(mesh=plane(), transform=transform_matrix(translate=(1e3, 0, 0)))
    for buffer in BUFFERS:
        options = RenderOptions(width=8, height=8, buffer=buffer, background=(1.0, 0.0, 0.0))
        camera = Camera.looking_at((0, 0, 2.0), (0, 0, 0), fov=0.3, near=0.1)
        frame = draw(prepare(Scene(objects=(away,)), options), camera)
        np.testing.assert_array_equal(frame.color, np.broadcast_to((1, 0, 0, 1), (8, 8, 4)))
