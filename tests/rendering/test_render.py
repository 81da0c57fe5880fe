from dataclasses import replace

import numpy as np
import pytest
from random_scenes import random_scene

from texbake import FileError, RenderOptions, Scene, SceneObject, read_image, render, write_image
from texbake.mesh.shapes import cube, icosphere, plane, uv_sphere
from texbake.rendering.draw import draw, prepare
from texbake.rendering.scene.scene import camera_of, place_mesh
from texbake.texture.encoding import decode_srgb
from texbake.texture.image import Image

SMALL = RenderOptions(width=160, height=120, supersampling=1)
# Straight onto a plane that faces +z.
FRONT = RenderOptions(width=96, height=96, supersampling=1, view=(0.0, 0.0))


def flat(*normal):
    return np.full((4, 4, 3), np.array(normal) / np.linalg.norm(normal), np.float32)


def everything_of(frame):
    return [
        np.asarray(getattr(frame, name)).tobytes()
        for name in ("color", "normals", "coverage", "face_ids", "depths")
    ]


@pytest.mark.parametrize("mesh", [plane(), uv_sphere(12, 24)])
def test_a_flat_normal_map_changes_nothing(mesh):
    options = RenderOptions(width=160, height=120)
    bare = render(mesh, options=options)
    mapped = render(mesh, normal_map=flat(0, 0, 1), options=options)
    assert bare.coverage.max() == 1.0
    assert everything_of(mapped) == everything_of(bare)


@pytest.mark.parametrize(("mirror", "metadata", "expected"), [
    (False, {}, (0.6, 0.48, 0.64)),
    (False, {"texbake:convention": "directx"}, (0.6, -0.48, 0.64)),
    (True, {}, (-0.6, 0.48, 0.64)),
    (True, {"texbake:space": "object"}, (0.6, 0.48, 0.64)),
    (True, {"texbake:space": "world"}, (0.6, 0.48, 0.64)),
])  # fmt: skip
def test_a_normal_map_bends_normals_in_its_space(mirror, metadata, expected):
    # On a plane with u along x and v along y, tangent space is world space; mirrored in u, x turns.
    mesh = plane(2, 2)
    if mirror:
        mesh = mesh.replace(uvs=mesh.uvs * (-1, 1) + (1, 0))
    pixels = np.full((4, 4, 3), (np.array((0.6, 0.48, 0.64)) + 1) / 2, np.float32)
    frame = render(mesh, normal_map=Image(pixels, metadata), options=FRONT)
    seen = frame.coverage == 1
    assert seen.sum() > 1000
    # float32 colors, halved and doubled again.
    np.testing.assert_allclose(frame.normals[seen] - expected, 0.0, atol=3e-7)


def test_tangents_of_the_file_are_used():
    mesh = plane()
    turned = np.tile(np.array([0, 1, 0, 1], np.float32), (2, 3, 1))  # T is +y, so B is -x
    frame = render(mesh.replace(tangents=turned), normal_map=flat(3, 4, 12), options=FRONT)
    seen = frame.coverage == 1
    np.testing.assert_allclose(frame.normals[seen] - np.array((-4, 3, 12)) / 13, 0.0, atol=3e-7)


def test_maps_come_from_files(tmp_path):
    mesh = uv_sphere(12, 24)
    colors = np.random.default_rng(2).integers(0, 256, (8, 8, 3), np.uint8)
    heights = np.random.default_rng(3).uniform(0, 0.1, (8, 8)).astype(np.float32)
    write_image(colors, tmp_path / "color.png", color=True)
    metadata = {"texbake:displacement_mid": 0.25, "texbake:displacement_scale": 2.0}
    write_image(heights / 2 + np.float32(0.25), tmp_path / "height.exr", bits=32, metadata=metadata)
    from_files = render(
        mesh, albedo=tmp_path / "color.png", displacement=tmp_path / "height.exr", options=SMALL
    )
    albedo = read_image(tmp_path / "color.png", color=True).pixels
    from_arrays = render(mesh, albedo=albedo, displacement=heights, options=SMALL)
    # Coded heights are rounded to float32 once more.
    differing = (from_files.face_ids != from_arrays.face_ids).mean()
    assert differing < 1e-3
    np.testing.assert_allclose(from_files.color, from_arrays.color, atol=2e-3)


def test_displacement_carries_the_frame_of_the_base_along():
    # Without heights, the mapped normals must be those of the mesh that was not displaced, and so
    # must the footprints of pixels on a texture that is seen small.
    mesh = uv_sphere(8, 16)
    noise = np.random.default_rng(4).random((512, 512, 3)).astype(np.float32)
    maps = {"normal_map": flat(0.3, -0.2, 0.9), "albedo": noise}
    options = replace(SMALL, filter="ewa")
    plain = render(mesh, **maps, options=options)
    cut = render(mesh, **maps, displacement=np.zeros((32, 32), np.float32), options=options)
    # Vertices on edges are snapped by themselves, so that the outline may move by 1/256 sample.
    both = (plain.coverage == 1) & (cut.coverage == 1)
    assert ((plain.coverage == 1) != both).sum() < 10
    # float32 weights, twice; but for the few samples that see another face at an edge, where
    # tangents may jump.
    apart = np.abs(plain.normals - cut.normals)[both].max(axis=1)
    assert np.count_nonzero(apart > 1e-6) < 0.002 * len(apart)
    apart = np.abs(plain.color - cut.color)[both].max(axis=1)
    assert np.count_nonzero(apart > 1e-5) < 0.005 * len(apart)


def test_a_back_face_is_shown_with_its_normal_turned():
    options = RenderOptions(width=64, height=64, view=(180.0, 0.0), back_faces="show")
    frame = render(plane(), options=options)
    np.testing.assert_array_equal(frame.normals[32, 32], [0, 0, -1])
    assert render(plane(), options=RenderOptions(view=(180.0, 0.0))).coverage.max() == 0


def test_without_background_the_opacity_is_the_coverage(tmp_path):
    options = RenderOptions(width=80, height=60, supersampling=4, background=None)
    frame = render(icosphere(3), options=options)
    np.testing.assert_array_equal(frame.color[..., 3], frame.coverage)
    assert ((frame.coverage > 0) & (frame.coverage < 1)).any()
    opaque = render(icosphere(3), options=RenderOptions(width=80, height=60, supersampling=4))
    np.testing.assert_array_equal(opaque.color[..., 3], 1.0)
    # Laying it over the background gives the picture with that background.
    behind = decode_srgb(RenderOptions().background).astype(np.float32)
    alpha = frame.color[..., 3:]
    np.testing.assert_allclose(
        frame.color[..., :3] * alpha + behind * (1 - alpha), opaque.color[..., :3], atol=1e-6
    )
    frame.write(tmp_path / "clear.png")
    assert read_image(tmp_path / "clear.png", color=True).pixels.shape == (60, 80, 4)
    opaque.write(tmp_path / "opaque.png")
    written = read_image(tmp_path / "opaque.png", color=True).pixels
    # A step of sRGB is at most 1/255 * 2.3 wide in linear light; half of it for rounding.
    np.testing.assert_allclose(written, opaque.color[..., :3].clip(0, 1), atol=0.0046)


def test_progress_tells_the_stages():
    told = []

    class Sink:
        def started(self, stage, total, unit):
            told.append(stage)

        def advanced(self, stage, done): ...

        def finished(self, stage, seconds): ...

    render(plane(), options=SMALL, progress=Sink())
    assert told == ["place", "rasterize", "prepare light and textures", "shade"]


@pytest.mark.parametrize("stops", [FileError("it is gone"), KeyboardInterrupt()])
def test_what_was_loaded_before_an_error_is_not_loaded_again(monkeypatch, stops):
    loaded, faults = [], [stops]

    def spy(item, **options):
        if len(loaded) == 2 and faults:
            raise faults.pop()
        loaded.append(item.name)
        return place_mesh(item, **options)

    monkeypatch.setattr("texbake.rendering.effects.surfaces.place_mesh", spy)
    prepared = prepare(
        Scene(objects=tuple(SceneObject(mesh=cube(), name=n) for n in "0123")), SMALL
    )
    camera = camera_of(prepared.scene, SMALL)
    with pytest.raises(type(stops)):
        draw(prepared, camera)
    draw(prepared, camera)
    assert loaded == list("0123")


def test_every_number_of_threads_draws_the_same_bytes(images):
    for seed in range(12):
        scene, options = random_scene(seed, images)
        options = replace(options, width=96, height=800)  # more rows than threads get at a time
        camera = camera_of(scene, options)
        one, three = (draw(prepare(scene, options, threads=n), camera) for n in (1, 3))
        assert one.color.tobytes() == three.color.tobytes(), seed
        assert one.depths.tobytes() == three.depths.tobytes(), seed
