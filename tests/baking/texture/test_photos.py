"""Photographs baked onto meshes, and their cameras: seen texels take their color, others none."""

import dataclasses

import numpy as np
import pytest

from texbake import FileError, OptionError, RenderOptions, write_image
from texbake.baking.rays import RayField
from texbake.baking.texture.canvas import TextureCanvas
from texbake.baking.texture.options import PhotoOptions
from texbake.baking.texture.photos import Photo, PhotoCamera, bake_photos, read_camera
from texbake.core import core
from texbake.errors import FileFormatError, UvError
from texbake.mesh.compose import join_meshes
from texbake.mesh.frame import LocalFrame
from texbake.mesh.shapes import plane, uv_sphere
from texbake.raycast.rays import Rays
from texbake.raycast.scene import RayScene
from texbake.rendering.camera import Camera

Array = np.ndarray

RED, GREEN = np.array([0.8, 0.0, 0.0], np.float32), np.array([0.0, 0.6, 0.0], np.float32)
FRONT = PhotoCamera(position=(0.5, 0.5, 3.0), target=(0.5, 0.5, 0.0), fov=40.0)
EVEN = PhotoOptions(size=64, samples=1, feather=0.0, margin=0.0, fill="none", padding=0)


def solid(color, height=8, width=8):
    return np.full((height, width, len(color)), color, np.float32)


def texel_positions(mesh, result):
    """(H, W, 3): the position of each covered texel; NaN elsewhere."""
    canvas = TextureCanvas(mesh, dataclasses.replace(result.report.options, samples=1), 1)
    frame = LocalFrame.around(mesh)
    field = RayField(mesh, frame, kind="face", front=0.0, back=0.0)
    points = np.full((*result.texel_faces.shape, 3), np.nan)
    for band in canvas.bands():
        origins = field.rays(band.samples).origins
        points.reshape(-1, 3)[band.samples.texel_ids] = origins / frame.scale + frame.center
    return points


def take_photo(mesh, camera, colors, width, height):
    """Photograph a mesh, one ray per pixel: (H, W, 4), with opacity 0 beside the mesh."""
    frame = LocalFrame.around(mesh)
    right, up, back = camera.axes()
    tall = np.tan(np.radians(camera.fov) / 2)
    y, x = (np.mgrid[:height, :width] + 0.5).reshape(2, -1, 1)
    rays = (2 * x - width) / height * tall * right + (1 - 2 * y / height) * tall * up - back
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    eye = frame.to_local(np.array([camera.position]))
    origins = np.repeat(eye, len(rays), axis=0)
    scene = RayScene.build(mesh, frame)
    hits = scene.cast(
        Rays(origins, rays, np.full(len(rays), 20.0), np.zeros(len(rays))), cull_back_faces=False
    )
    hit = hits.faces >= 0
    points = (origins + rays * hits.distances[:, None]) / frame.scale + frame.center
    picture = np.zeros((len(rays), 4), np.float32)
    picture[hit, :3] = colors(points[hit])
    picture[hit, 3] = 1.0
    return picture.reshape(height, width, 4)


def two_walls():
    """A wall, and a screen in front of its middle, halfway to z = 3; both in one atlas."""
    wall, screen = plane(), plane()
    wall = wall.replace(uvs=wall.uvs * (0.5, 1.0), name="wall")
    screen = screen.replace(
        positions=(screen.positions - (0.5, 0.5, 0.0)) * 0.25 + (0.5, 0.5, 1.5),
        uvs=screen.uvs * (0.5, 1.0) + (0.5, 0.0),
        name="screen",
    )
    return join_meshes([wall, screen])


def test_the_picture_is_neither_mirrored_nor_rotated():
    """A plane that fills the picture takes its pixels as texels."""
    image = np.random.default_rng(0).random((64, 64, 3), dtype=np.float32)
    camera = PhotoCamera(
        position=(0.5, 0.5, 2.0), target=(0.5, 0.5, 0.0), fov=float(np.degrees(2 * np.arctan(0.25)))
    )
    result = bake_photos(plane(), [Photo(image=image, camera=camera)], EVEN)
    # The corners of the plane project onto the border, so all texels are seen, and their centers
    # lie on pixel centers to some 1e-12.
    np.testing.assert_allclose(result.values, image, atol=1e-5)
    assert result.report.unseen_percent == 0.0


def test_a_matrix_gives_a_parallel_projection():
    image = np.random.default_rng(0).random((64, 64, 3), dtype=np.float32)
    # Looks along -z: s = x, t = y, r = depth, q = 1.
    matrix = ((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, -1.0, 0.0), (0, 0, 0, 1.0))
    result = bake_photos(plane(), [Photo(image=image, camera=matrix)], EVEN)
    np.testing.assert_allclose(result.values, image, atol=1e-5)
    hidden = bake_photos(two_walls(), [Photo(image=image, camera=matrix)], EVEN)
    # A quarter by a quarter of the wall is behind the screen: 8 of 32 by 16 of 64 texels.
    wall = hidden.has_color[:, :32]
    assert (~wall).sum() == 8 * 16
    assert not wall[24:40, 12:20].any()


def test_exactly_the_hidden_texels_are_unseen():
    """The hidden part of the wall is twice the size of the screen, by similar triangles."""
    mesh = two_walls()
    colors = {"wall": RED, "screen": GREEN}
    image = take_photo(
        mesh, FRONT, lambda p: np.where(p[:, 2:] > 1.0, colors["screen"], colors["wall"]), 256, 256
    )
    photo = Photo(image=image, camera=FRONT)
    result = bake_photos(mesh, [photo], EVEN)
    points = texel_positions(mesh, result)
    shadow = (points[..., 2] < 1.0) & (np.abs(points[..., :2] - 0.5) < 0.25).all(axis=2)
    np.testing.assert_array_equal(result.unseen, shadow)
    through = bake_photos(mesh, [photo], dataclasses.replace(EVEN, occlusion=False))
    assert not through.unseen.any()
    inner = (points[..., 2] > 1.0) & (np.abs(points[..., :2] - 0.5) < 0.11).all(axis=2)
    assert inner.sum() > 1000
    np.testing.assert_allclose(through.values[inner] - GREEN, 0.0, atol=1e-6)


def test_a_margin_leaves_out_pixels_of_outlines():
    mesh = two_walls()
    image = take_photo(mesh, FRONT, lambda p: np.where(p[:, 2:] > 1.0, GREEN, RED), 110, 110)
    photo = Photo(image=image[..., :3] + 0.0, camera=FRONT)
    bare = bake_photos(mesh, [photo], dataclasses.replace(EVEN, size=512))
    wide = bake_photos(mesh, [photo], dataclasses.replace(EVEN, size=512, margin=1.5))
    wall = texel_positions(mesh, bare)[..., 2] < 1.0
    assert (bare.values[wall & bare.has_color, 1] > 0.05).sum() > 100
    assert (wide.values[wall & wide.has_color, 1] > 0.05).sum() == 0
    assert 0 < (bare.has_color & ~wide.has_color).sum() < 0.1 * wall.sum()


def test_a_curved_surface_does_not_hide_itself():
    sphere = uv_sphere(64, 96)
    camera = PhotoCamera(position=(0.0, 0.0, 4.0), target=(0.0, 0.0, 0.0), fov=40.0)
    photo = Photo(image=solid(RED, 500, 500), camera=camera)
    options = dataclasses.replace(EVEN, size=256, margin=1.0)
    with_rays = bake_photos(sphere, [photo], options)
    without = bake_photos(sphere, [photo], dataclasses.replace(options, occlusion=False))
    np.testing.assert_array_equal(with_rays.has_color, without.has_color)


def test_two_photographs_have_weights_that_sum_to_1():
    sphere = uv_sphere(16, 24)
    cameras = [
        PhotoCamera(position=(4 * np.sin(a), 0.5, 4 * np.cos(a)), target=(0.0, 0.0, 0.0))
        for a in (0.0, 1.2)
    ]
    ones = [np.array([1, 0, 0], np.float32), np.array([0, 1, 0], np.float32)]
    photos = [
        Photo(image=solid(one), camera=camera) for one, camera in zip(ones, cameras, strict=True)
    ]
    options = dataclasses.replace(EVEN, samples=4, feather=0.1)
    result = bake_photos(sphere, photos, options)
    sums = result.values.sum(axis=2)
    np.testing.assert_allclose(sums[result.has_color], 1.0, atol=1e-6)
    both = result.has_color & (result.values[..., :2] > 0.05).all(axis=2)
    assert both.sum() > 100
    shares = result.report.photos
    assert shares[0].percent + shares[1].percent == pytest.approx(100.0)
    assert shares[0].percent == pytest.approx(100 * result.values[result.has_color][:, 0].mean())


def test_the_weight_is_the_power_of_the_cosine():
    """In the middle of a plane that is seen head-on and at 60 degrees."""
    side = PhotoCamera(
        position=(0.5 + 4 * np.sin(np.pi / 3), 0.5, 4 * np.cos(np.pi / 3)), target=(0.5, 0.5, 0.0)
    )
    photos = [
        Photo(image=solid(np.array([1, 0, 0], np.float32)), camera=FRONT),
        Photo(image=solid(np.array([0, 1, 0], np.float32)), camera=side),
    ]
    options = dataclasses.replace(EVEN, size=65, max_angle=90.0, falloff=1.0)
    middle = bake_photos(plane(), photos, options).values[32, 32]
    np.testing.assert_allclose(middle, [1 / 1.5, 0.5 / 1.5, 0.0], atol=1e-6)
    squared = dataclasses.replace(options, falloff=2.0)
    middle = bake_photos(plane(), photos, squared).values[32, 32]
    np.testing.assert_allclose(middle, [1 / 1.25, 0.25 / 1.25, 0.0], atol=1e-6)
    narrow = dataclasses.replace(options, max_angle=59.0)
    np.testing.assert_allclose(bake_photos(plane(), photos, narrow).values[32, 32], [1, 0, 0])


def test_the_border_of_a_photograph_has_no_weight():
    weights = [border_weight(u, 0.5, 0.1) for u in (-1.0, 0.0, 1e-9, 0.05, 0.1, 0.5, 0.95, 1.0)]
    assert weights[:2] == [0.0, 0.0] and weights[-1] == 0.0
    assert 0.0 < weights[2] < 1e-10 and weights[3] == pytest.approx(0.5) == weights[6]
    assert weights[4] == weights[5] == 1.0
    assert border_weight(0.5, np.nan, 0.1) == 0.0
    assert border_weight(1e-9, 0.5, 0.0) == 1.0


def border_weight(u, v, feather):
    """Weight at a point of the photograph, on a face that the photograph sees head-on."""
    corners = np.tile(np.array([u, v]), (1, 3, 1))
    coordinates, weights = np.empty((1, 2)), np.empty(1)
    core.weigh_by_area(
        np.zeros(1, np.int32), np.zeros((1, 2)), corners, np.ones((1, 3)), 1.0, feather,
        coordinates, weights,
    )  # fmt: skip
    return float(weights[0])


def test_transparent_pixels_give_no_color():
    """The transparent blue half of a picture gives no color, nor a fringe along its edge."""
    image = solid(np.array([*RED, 1.0], np.float32), 32, 32)
    image[:, 16:] = (0.0, 0.0, 1.0, 0.0)
    camera = dataclasses.replace(FRONT, fov=20.0)
    result = bake_photos(plane(), [Photo(image=image, camera=camera)], EVEN)
    assert 0.4 < result.has_color.mean() < 0.6 and not result.has_color[:, 36:].any()
    np.testing.assert_allclose(result.values[result.has_color] - RED, 0.0, atol=1e-6)


def test_unseen_texels_are_filled():
    sphere = uv_sphere(16, 24)
    camera = PhotoCamera(position=(0.0, 0.0, 4.0), target=(0.0, 0.0, 0.0))
    options = dataclasses.replace(EVEN, fill="push-pull", padding=2)
    result = bake_photos(sphere, [Photo(image=solid(RED), camera=camera)], options)
    np.testing.assert_allclose(result.values, np.broadcast_to(RED, result.values.shape), atol=1e-6)
    assert result.report.photos[0].texels_seen == result.has_color.sum()
    assert ((result.unseen_map() == (255, 40, 60)).all(axis=2) == result.unseen).all()


def test_a_photograph_can_have_a_mesh_unwrapped_onto_it():
    """Texture coordinates rotated by 90 degrees rotate the texture."""
    image = np.random.default_rng(0).random((64, 64, 3), dtype=np.float32)
    mesh = plane()
    turned = mesh.replace(uvs=np.stack([mesh.uvs[:, 1], 1 - mesh.uvs[:, 0]], axis=1))
    result = bake_photos(mesh, [Photo(image=image, mapped=turned)], EVEN)
    np.testing.assert_allclose(result.values, np.rot90(image), atol=1e-5)


def test_a_photograph_counts_by_the_area_that_it_gives_a_face():
    """One photograph shows the left half large and the right half small, the other vice versa."""
    mesh = plane(2, 1)

    def squeezed(middle):
        u = np.interp(mesh.uvs[:, 0], [0, 0.5, 1], [0, middle, 1])
        return mesh.replace(uvs=np.stack([u, mesh.uvs[:, 1]], axis=1))

    photos = [
        Photo(image=solid(np.array([1, 0, 0], np.float32)), mapped=squeezed(0.8)),
        Photo(image=solid(np.array([0, 1, 0], np.float32)), mapped=squeezed(0.2)),
    ]
    values = bake_photos(mesh, photos, EVEN).values
    np.testing.assert_allclose(values.sum(axis=2), 1.0, atol=1e-6)
    assert values[32, 4, 0] > 0.75 and values[32, 60, 1] > 0.75
    assert np.abs(np.diff(values[32, :, 0])).max() < 0.1  # smooth over the edge between faces


def test_the_number_of_threads_changes_no_byte():
    sphere = uv_sphere(16, 24)
    image = np.random.default_rng(0).random((50, 70, 3), dtype=np.float32)
    photos = [Photo(image=image, camera=dataclasses.replace(FRONT, fov=fov)) for fov in (20.0, 70)]
    photos.append(Photo(image=image, mapped=sphere))
    bakes = [
        bake_photos(sphere, photos, PhotoOptions(size=128, threads=threads)) for threads in (1, 3)
    ]
    assert bakes[0].values.tobytes() == bakes[1].values.tobytes()


def test_wrong_input_is_one_clear_error(tmp_path):
    with pytest.raises(OptionError, match="photos: there are none"):
        bake_photos(plane(), [])
    for both in ({}, {"camera": FRONT, "mapped": plane()}):
        with pytest.raises(OptionError, match="camera, mapped: give each photograph exactly one"):
            Photo(image=solid(RED), **both)
    with pytest.raises(OptionError, match=r"plane.*: it has 4 faces where .* has 2"):
        bake_photos(plane(), [Photo(image=solid(RED), mapped=plane(2, 1).replace(name="plane2"))])
    flat = ((1.0, 0, 0, 0), (1.0, 0, 0, 0), (0, 0, -1.0, 0), (0, 0, 0, 1.0))
    with pytest.raises(OptionError, match=r"p\.png: matrix: its rows s, t and q flatten"):
        bake_photos(plane(), [Photo(image=solid(RED), camera=flat, name="p.png")])
    with pytest.raises(OptionError, match="photograph 1: its shape"):
        bake_photos(plane(), [Photo(image=solid(RED)[0], camera=FRONT)])
    with pytest.raises(UvError, match="no texture coordinates"):
        bake_photos(
            plane().replace(uvs=None, uv_faces=None), [Photo(image=solid(RED), camera=FRONT)]
        )


def test_a_photograph_from_a_file_with_nan_and_16_bits(tmp_path):
    image = solid(RED)
    image[3, 3] = np.nan
    write_image(image, tmp_path / "a.exr", color=True, bits=32)
    result = bake_photos(plane(), [Photo(image=tmp_path / "a.exr", camera=FRONT)], EVEN)
    assert np.isfinite(result.values).all()
    assert result.report.photos[0].name == "a.exr"


def test_an_exact_shift_changes_no_bit():
    mesh = uv_sphere(6, 12)
    here = mesh.replace(positions=np.round(mesh.positions * 2.0**30) / 2.0**30)
    shift = np.array([2.0**21, -(2.0**20), 2.0**19])
    image = np.random.default_rng(2).random((16, 16, 3)).astype(np.float32)

    def baked(mesh, shift):
        camera = PhotoCamera(position=tuple(np.add(shift, [0.5, 1.0, 4.0])), target=tuple(shift))
        options = PhotoOptions(size=32, threads=1)
        return bake_photos(mesh, [Photo(image=image, camera=camera)], options).values

    there = here.replace(positions=here.positions + shift)
    np.testing.assert_array_equal(baked(there, shift), baked(here, np.zeros(3)))


def test_a_camera_projects_as_a_preview_does():
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


def test_cameras_are_read_from_toml_and_from_matrices(tmp_path):
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


@pytest.mark.parametrize(("text", "message"), [
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
    ("position = [0, 0, 1]\ntarget = [0, 0, 0]\nlens = 35", "lens: unknown key; a camera"),
    ("position = [0,", "it is not TOML"),
    ("position = " + "[" * 10_000, "it is not TOML: maximum recursion depth"),
    ("position = " + "9" * 5000, "it is not TOML: Exceeds the limit"),
])  # fmt: skip
def test_an_error_in_a_file_names_the_key(tmp_path, text, message):
    file = tmp_path / "camera.toml"
    file.write_text(text)
    with pytest.raises(FileFormatError, match=rf"camera\.toml: {message}"):
        read_camera(file)


def test_a_missing_file_is_an_error(tmp_path):
    with pytest.raises(FileError, match=r"no\.toml: "):
        read_camera(tmp_path / "no.toml")


def test_a_camera_at_any_distance_has_the_same_axes():
    near, far = (
        PhotoCamera(position=(scale, 2.0 * scale, 0.0), target=(0.0, 0.0, 0.0))
        for scale in (1.0, 2.0**1000)
    )
    np.testing.assert_array_equal(near.axes(), far.axes())
