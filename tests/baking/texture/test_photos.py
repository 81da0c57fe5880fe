"""Photographs cast onto meshes and back: what is seen gets its color, what is not gets none."""

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from texbake import read_mesh, write_image
from texbake.baking.rays import RayField
from texbake.baking.texture.coverage import TextureCoverage
from texbake.baking.texture.options import PhotoOptions
from texbake.baking.texture.photo import Photo, PhotoCamera
from texbake.baking.texture.photo_weights import border_weight_kernel
from texbake.baking.texture.photos import bake_photos
from texbake.baking.texture.result import TextureBake
from texbake.errors import OptionError, UvError
from texbake.mesh.compose import join_meshes
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import plane, uv_sphere
from texbake.progress import Stages
from texbake.raycast.rays import Rays
from texbake.raycast.scene import RayScene

Array = np.ndarray
Colors = Callable[[Array], Array]

RED, GREEN = np.array([0.8, 0.0, 0.0], np.float32), np.array([0.0, 0.6, 0.0], np.float32)
FRONT = PhotoCamera(position=(0.5, 0.5, 3.0), target=(0.5, 0.5, 0.0), fov=40.0)
EVEN = PhotoOptions(size=64, samples=1, feather=0.0, margin=0.0, fill="none", padding=0)


def solid(color: Array, height: int = 8, width: int = 8) -> Array:
    return np.full((height, width, len(color)), color, np.float32)


def places(mesh: Mesh, found: TextureBake) -> Array:
    """(H, W, 3): the point of each covered texel; NaN elsewhere."""
    coverage = TextureCoverage(mesh, dataclasses.replace(found.report.options, samples=1).for_bake)
    frame = LocalFrame.around(mesh)
    field = RayField(mesh, frame, kind="face", front=0.0, back=0.0)
    points = np.full((*found.texel_faces.shape, 3), np.nan)
    for band in coverage.bands(Stages()):
        origins = field.rays(band.samples).origins
        points.reshape(-1, 3)[band.samples.texel_ids] = origins / frame.scale + frame.center
    return points


def take_photo(mesh: Mesh, camera: PhotoCamera, colors: Colors, width: int, height: int) -> Array:
    """Photograph a mesh, a ray a pixel: (H, W, 4), with opacity 0 where there is no mesh."""
    frame = LocalFrame.around(mesh)
    right, up, back = camera.axes()
    tall = np.tan(np.radians(camera.fov) / 2)
    y, x = (np.mgrid[:height, :width] + 0.5).reshape(2, -1, 1)
    rays = (2 * x - width) / height * tall * right + (1 - 2 * y / height) * tall * up - back
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    eye = frame.to_local(np.array([camera.position]))
    origins = np.repeat(eye, len(rays), axis=0)
    scene = RayScene.build(mesh, frame)
    found = scene.cast(
        Rays(origins, rays, np.full(len(rays), 20.0), np.zeros(len(rays))), cull_back_faces=False
    )
    scene.close()
    hit = found.faces >= 0
    points = (origins + rays * found.distances[:, None]) / frame.scale + frame.center
    picture = np.zeros((len(rays), 4), np.float32)
    picture[hit, :3] = colors(points[hit])
    picture[hit, 3] = 1.0
    return picture.reshape(height, width, 4)


def waves(points: Array) -> Array:
    return (0.5 + 0.4 * np.sin(points * (3.0, 4.0, 5.0) + (0.0, 1.0, 2.0))).astype(np.float32)


def around(target: Array, distance: float, n: int) -> list[PhotoCamera]:
    angles = 2 * np.pi * np.arange(n) / n
    ways = np.stack([np.sin(angles), 0.3 * (-1.0) ** np.arange(n), np.cos(angles)], axis=1)
    return [
        PhotoCamera(position=tuple(target + distance * way), target=tuple(target), fov=45.0)
        for way in ways
    ]


def two_walls() -> Mesh:
    """A wall, and a smaller one half as far from z = 3 before its middle; both in one atlas."""
    wall, screen = plane(), plane()
    assert wall.uvs is not None and screen.uvs is not None
    wall = wall.replace(uvs=wall.uvs * (0.5, 1.0), name="wall")
    screen = screen.replace(
        positions=(screen.positions - (0.5, 0.5, 0.0)) * 0.25 + (0.5, 0.5, 1.5),
        uvs=screen.uvs * (0.5, 1.0) + (0.5, 0.0),
        name="screen",
    )
    return join_meshes([wall, screen])


def test_a_photograph_of_one_color_gives_it_wherever_it_is_seen() -> None:
    sphere = uv_sphere(16, 24)
    camera = PhotoCamera(position=(0.0, 0.0, 4.0), target=(0.0, 0.0, 0.0))
    found = bake_photos(sphere, [Photo(image=solid(RED), camera=camera)], EVEN)
    np.testing.assert_array_equal(
        found.values[found.has_color], np.tile(RED, (found.has_color.sum(), 1))
    )
    np.testing.assert_array_equal(found.values[~found.has_color], 0.0)
    assert found.report.texels_unseen == found.unseen.sum() > 0
    # Seen from distance 4, a point of the unit sphere is 80 degrees off where z = 0.4145 or so:
    # cos(80) of the angle at the point between its normal z and (4 - z) / |...|.
    z = places(sphere, found)[:, :, 2]
    assert z[found.has_color].min() > 0.3
    assert found.has_color[z > 0.5].all()


def test_the_colors_are_those_of_the_picture_not_mirrored_nor_turned() -> None:
    """A plane that fills the picture gets its very texels."""
    image = np.random.default_rng(0).random((64, 64, 3), dtype=np.float32)
    camera = PhotoCamera(
        position=(0.5, 0.5, 2.0), target=(0.5, 0.5, 0.0), fov=float(np.degrees(2 * np.arctan(0.25)))
    )
    found = bake_photos(plane(), [Photo(image=image, camera=camera)], EVEN)
    # Rays to the corners meet the very border: all inside it is seen, and texel centers lie on
    # pixel centers to some 1e-12.
    np.testing.assert_allclose(found.values, image, atol=1e-5)
    assert found.report.unseen_percent == 0.0


def test_parallel_light_by_a_matrix() -> None:
    image = np.random.default_rng(0).random((64, 64, 3), dtype=np.float32)
    # Looks along -z: s = x, t = y, r = depth, q = 1.
    matrix = ((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, -1.0, 0.0), (0, 0, 0, 1.0))
    found = bake_photos(plane(), [Photo(image=image, camera=matrix)], EVEN)
    np.testing.assert_allclose(found.values, image, atol=1e-5)
    hidden = bake_photos(two_walls(), [Photo(image=image, camera=matrix)], EVEN)
    # A quarter by a quarter of the wall lies in the screen's shadow: 8 of 32 by 16 of 64 texels.
    wall = hidden.has_color[:, :32]
    assert (~wall).sum() == 8 * 16
    assert not wall[24:40, 12:20].any()


def test_what_is_hidden_gets_nothing_exactly() -> None:
    """The shadow of the screen is twice its size, by similar triangles."""
    mesh = two_walls()
    colors = {"wall": RED, "screen": GREEN}
    image = take_photo(
        mesh, FRONT, lambda p: np.where(p[:, 2:] > 1.0, colors["screen"], colors["wall"]), 256, 256
    )
    photo = Photo(image=image, camera=FRONT)
    found = bake_photos(mesh, [photo], EVEN)
    points = places(mesh, found)
    shadow = (points[..., 2] < 1.0) & (np.abs(points[..., :2] - 0.5) < 0.25).all(axis=2)
    np.testing.assert_array_equal(found.unseen, shadow)
    through = bake_photos(mesh, [photo], dataclasses.replace(EVEN, occlusion=False))
    assert not through.unseen.any()
    inner = (points[..., 2] > 1.0) & (np.abs(points[..., :2] - 0.5) < 0.11).all(axis=2)
    assert inner.sum() > 1000
    np.testing.assert_allclose(through.values[inner] - GREEN, 0.0, atol=1e-6)


def test_a_margin_keeps_pixels_of_the_outline_out() -> None:
    mesh = two_walls()
    image = take_photo(mesh, FRONT, lambda p: np.where(p[:, 2:] > 1.0, GREEN, RED), 110, 110)
    photo = Photo(image=image[..., :3] + 0.0, camera=FRONT)
    bare = bake_photos(mesh, [photo], dataclasses.replace(EVEN, size=512))
    wide = bake_photos(mesh, [photo], dataclasses.replace(EVEN, size=512, margin=1.5))
    wall = places(mesh, bare)[..., 2] < 1.0
    assert (bare.values[wall & bare.has_color, 1] > 0.05).sum() > 100
    assert (wide.values[wall & wide.has_color, 1] > 0.05).sum() == 0
    assert 0 < (bare.has_color & ~wide.has_color).sum() < 0.1 * wall.sum()


def test_a_curved_surface_does_not_hide_itself() -> None:
    sphere = uv_sphere(64, 96)
    camera = PhotoCamera(position=(0.0, 0.0, 4.0), target=(0.0, 0.0, 0.0), fov=40.0)
    photo = Photo(image=solid(RED, 500, 500), camera=camera)
    options = dataclasses.replace(EVEN, size=256, margin=1.0)
    with_rays = bake_photos(sphere, [photo], options)
    without = bake_photos(sphere, [photo], dataclasses.replace(options, occlusion=False))
    np.testing.assert_array_equal(with_rays.has_color, without.has_color)


def test_weights_of_two_photographs_sum_to_1() -> None:
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
    found = bake_photos(sphere, photos, options)
    sums = found.values.sum(axis=2)
    np.testing.assert_allclose(sums[found.has_color], 1.0, atol=1e-6)
    both = found.has_color & (found.values[..., :2] > 0.05).all(axis=2)
    assert both.sum() > 100
    shares = found.report.photos
    assert shares[0].percent + shares[1].percent == pytest.approx(100.0)
    assert shares[0].percent == pytest.approx(100 * found.values[found.has_color][:, 0].mean())


def test_the_weight_is_the_power_of_the_cosine() -> None:
    """At the middle of a plane seen straight on and at 60 degrees, with a falloff of 1."""
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


def test_the_border_of_a_photograph_weighs_nothing() -> None:
    weights = [
        border_weight_kernel(u, 0.5, 0.1) for u in (-1.0, 0.0, 1e-9, 0.05, 0.1, 0.5, 0.95, 1.0)
    ]
    assert weights[:2] == [0.0, 0.0] and weights[-1] == 0.0
    assert 0.0 < weights[2] < 1e-10
    assert weights[3] == pytest.approx(0.5) == weights[6]
    assert weights[4] == weights[5] == 1.0
    assert border_weight_kernel(0.5, np.nan, 0.1) == 0.0
    assert border_weight_kernel(1e-9, 0.5, 0.0) == 1.0


def test_opacity_weighs_and_clear_pixels_do_not_tint() -> None:
    """Half the picture is clear blue: it gives no color, nor does its border a fringe."""
    image = solid(np.array([*RED, 1.0], np.float32), 32, 32)
    image[:, 16:] = (0.0, 0.0, 1.0, 0.0)
    camera = dataclasses.replace(FRONT, fov=20.0)
    found = bake_photos(plane(), [Photo(image=image, camera=camera)], EVEN)
    assert 0.4 < found.has_color.mean() < 0.6
    assert not found.has_color[:, 36:].any()
    np.testing.assert_allclose(found.values[found.has_color] - RED, 0.0, atol=1e-6)


def test_many_photographs_give_back_the_colors_of_a_mesh() -> None:
    sphere = uv_sphere(32, 48)
    cameras = around(np.zeros(3), 3.0, 6)
    photos = [
        Photo(image=take_photo(sphere, camera, waves, 320, 320), camera=camera)
        for camera in cameras
    ]
    # One sample, at the center of each texel, where the colors are known.
    found = bake_photos(sphere, photos, PhotoOptions(size=512, samples=1))
    error = np.abs(found.values - waves(places(sphere, found)))[found.has_color].max(axis=1)
    # A pixel covers 1/130 of the radius, and up to 1/23 where the surface is at 80 degrees to it:
    # waves 0.4 sin 5x bend by up to 0.4 * 5² / 23² / 8 = 0.0024 between pixels.
    assert np.percentile(error, 99) < 0.0024
    assert np.median(error) < 2e-4
    assert found.report.unseen_percent < 3.0  # about the poles, which lie more than 80 degrees off
    assert found.report.seconds > 0.0


def test_what_is_unseen_is_filled_and_told() -> None:
    sphere = uv_sphere(16, 24)
    camera = PhotoCamera(position=(0.0, 0.0, 4.0), target=(0.0, 0.0, 0.0))
    options = dataclasses.replace(EVEN, fill="push-pull", padding=2)
    found = bake_photos(sphere, [Photo(image=solid(RED), camera=camera)], options)
    np.testing.assert_allclose(found.values, np.broadcast_to(RED, found.values.shape), atol=1e-6)
    report = found.report
    assert any("in no photograph" in warning for warning in report.warnings)
    assert dict(report.table())["texels unseen"].startswith(f"{report.texels_unseen:,} ")
    assert report.to_json()["photos"][0]["texels_seen"] == found.has_color.sum()
    picture = found.unseen_map()
    assert (picture[found.unseen] == (255, 40, 60)).all()


def test_a_photograph_that_sees_nothing_is_told() -> None:
    away = PhotoCamera(position=(0.5, 0.5, 3.0), target=(0.5, 0.5, 6.0))
    photo = Photo(image=solid(RED), camera=away, name="sky.jpg")
    found = bake_photos(plane(), [photo], EVEN)
    assert not found.has_color.any()
    assert any(
        warning.startswith("sky.jpg: it shows no texel") for warning in found.report.warnings
    )


def test_a_photograph_can_have_coordinates_of_its_own() -> None:
    """A mesh whose coordinates are turned by a quarter looks its texels up turned."""
    image = np.random.default_rng(0).random((64, 64, 3), dtype=np.float32)
    mesh = plane()
    assert mesh.uvs is not None
    turned = mesh.replace(uvs=np.stack([mesh.uvs[:, 1], 1 - mesh.uvs[:, 0]], axis=1))
    found = bake_photos(mesh, [Photo(image=image, mapped=turned)], EVEN)
    np.testing.assert_allclose(found.values, np.rot90(image), atol=1e-5)


def test_coordinates_outside_a_photograph_are_not_in_it() -> None:
    mesh = plane(2, 1)
    assert mesh.uvs is not None
    moved = mesh.replace(uvs=mesh.uvs * (2.0, 1.0))
    found = bake_photos(mesh, [Photo(image=solid(RED), mapped=moved)], EVEN)
    assert found.has_color[:, :32].all() and not found.has_color[:, 32:].any()


def test_of_two_with_own_coordinates_the_one_with_more_texels_counts_more() -> None:
    """One shows the left half large and the right half small, the other the other way round."""
    mesh = plane(2, 1)
    assert mesh.uvs is not None

    def squeezed(middle: float) -> Mesh:
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


def test_threads_change_no_byte() -> None:
    sphere = uv_sphere(16, 24)
    image = np.random.default_rng(0).random((50, 70, 3), dtype=np.float32)
    photos = [Photo(image=image, camera=camera) for camera in around(np.zeros(3), 3.0, 3)]
    photos.append(Photo(image=image, mapped=sphere))
    bakes = [
        bake_photos(sphere, photos, PhotoOptions(size=128, threads=threads)) for threads in (1, 3)
    ]
    assert bakes[0].values.tobytes() == bakes[1].values.tobytes()


def test_size_and_place_change_nothing() -> None:
    sphere = uv_sphere(16, 24)
    image = np.random.default_rng(0).random((50, 70, 3), dtype=np.float32)
    moved = sphere.replace(positions=sphere.positions * 512.0 + (4096.0, 0.0, 0.0))
    (near,) = around(np.zeros(3), 3.0, 1)
    (far,) = around(np.array([4096.0, 0.0, 0.0]), 3.0 * 512, 1)
    one = bake_photos(sphere, [Photo(image=image, camera=near)], EVEN)
    two = bake_photos(moved, [Photo(image=image, camera=far)], EVEN)
    assert (one.has_color != two.has_color).mean() < 1e-3
    seen = one.has_color & two.has_color
    np.testing.assert_allclose(one.values[seen], two.values[seen], atol=1e-5)


def test_wrong_input_is_one_clear_error(tmp_path: Path) -> None:
    with pytest.raises(OptionError, match="photos: there are none"):
        bake_photos(plane(), [])
    for both in ({}, {"camera": FRONT, "mapped": plane()}):
        with pytest.raises(OptionError, match="camera, mapped: give each photograph exactly one"):
            Photo(image=solid(RED), **both)  # type: ignore[arg-type]
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
    for wrong in (
        {"max_angle": 0.0},
        {"falloff": -1.0},
        {"feather": 0.6},
        {"margin": -1.0},
        {"samples": 2},
    ):
        with pytest.raises(OptionError, match=next(iter(wrong))):
            PhotoOptions(**wrong)  # type: ignore[arg-type]


def test_a_photograph_from_a_file_with_nan_and_16_bits(tmp_path: Path) -> None:
    image = solid(RED)
    image[3, 3] = np.nan
    write_image(image, tmp_path / "a.exr", color=True, bits=32)
    found = bake_photos(plane(), [Photo(image=tmp_path / "a.exr", camera=FRONT)], EVEN)
    assert np.isfinite(found.values).all()
    assert found.report.photos[0].name == "a.exr"


@pytest.mark.realdata
def test_a_real_mesh_gets_its_own_colors_back(data_dir: Path) -> None:
    mesh = read_mesh(data_dir / "pairs" / "spot" / "low_uv.obj")
    low, high = mesh.bounds
    cameras = around((low + high) / 2, 1.6 * mesh.diagonal, 6)
    photos = [
        Photo(image=take_photo(mesh, camera, waves, 400, 300), camera=camera) for camera in cameras
    ]
    found = bake_photos(mesh, photos, PhotoOptions(size=512, samples=1))
    error = np.abs(found.values - waves(places(mesh, found)))[found.has_color].max(axis=1)
    # As on a sphere; pixels are 1/170 of the diagonal, which is 2.5 long.
    assert np.percentile(error, 99) < 0.01
    assert np.median(error) < 1e-3
    assert found.report.unseen_percent < 5.0
