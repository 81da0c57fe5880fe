"""Ambient occlusion, bent normals and thickness as maps of whole bakes."""

import dataclasses

import numpy as np
import pytest
from embreex_oracle import EmbreexScene

from texbake.baking import scenes
from texbake.baking.bake import bake, remap
from texbake.baking.options import BakeOptions, SecondaryOptions
from texbake.errors import OptionError
from texbake.mesh.compose import join_meshes
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import icosphere, plane, uv_sphere
from texbake.metadata import THICKNESS_SCALE
from texbake.raycast.scene import RayScene

SHORT = {"front": 0.05, "back": 0.05, "padding": 0}


@pytest.fixture(scope="module")
def ground():
    """A finely divided unit square under a disk of radius 0.2 at height 0.2 over its middle."""
    angles = np.arange(256) * 2 * np.pi / 256
    positions = np.full((257, 3), [0.5, 0.5, 0.2])
    positions[1:, :2] += 0.2 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    k = np.arange(256)
    disk = Mesh(positions=positions, faces=np.stack([0 * k, 1 + k, 1 + (k + 1) % 256], axis=1))
    return join_meshes([plane(8, 8).replace(uvs=None, uv_faces=None), disk])


def below_the_disk(size):
    """Open share of the ground in closed form, at the centers of the texels."""
    at = (np.arange(size) + 0.5) / size
    d2 = (at - 0.5) ** 2 + (at[:, np.newaxis] - 0.5) ** 2
    h2, r2 = 0.04, 0.04
    return 0.5 + (h2 + d2 - r2) / (2 * np.sqrt((h2 + d2 + r2) ** 2 - 4 * d2 * r2))


def test_a_map_of_the_ground_under_a_disk_is_the_closed_form(ground):
    options = BakeOptions(size=64, maps=("ao",), **SHORT)
    result = bake(ground, plane(), options)
    errors = result.maps["ao"].values[..., 0] - below_the_disk(64)
    assert result.has_data.all()
    # 64 rays have half the noise of random ones, and their mean is off by no more than by chance.
    assert errors.std() < 0.5 * np.sqrt(0.25 / 64)
    assert abs(errors.mean()) < 5 * errors.std() / 64
    # 16 samples share the 64 rays as parts of one net; 16 nets of 4 rays have 1.6 times its noise.
    finer = bake(ground, plane(), dataclasses.replace(options, samples=16))
    rest = finer.maps["ao"].values[..., 0] - below_the_disk(64)
    assert rest.std() < 1.1 * errors.std()
    assert finer.report.counts.secondary_rays == 64 * 64**2


@pytest.mark.parametrize("space", ["tangent", "object"])
def test_normals_bend_away_from_the_disk(ground, space):
    options = BakeOptions(size=64, maps=("bent-normal",), space=space, secondary_rays=256, **SHORT)
    bent = bake(ground, plane(), options).maps["bent-normal"].values
    np.testing.assert_allclose(np.linalg.norm(bent, axis=2), 1, atol=1e-6)
    at = (np.arange(64) + 0.5) / 64 - 0.5
    # The plane's tangent space is its object space: u along x, v along y, which is up the image.
    outward = bent[..., 0] * at + bent[..., 1] * at[::-1, np.newaxis]
    radius = np.hypot(at, at[:, np.newaxis])
    assert (outward[(radius > 0.1) & (radius < 0.3)] > 0).all()
    # In the middle no direction is preferred, and far from the disk hardly any.
    assert np.abs(bent[31:33, 31:33, :2].mean(axis=(0, 1))).max() < 0.05
    assert bent[0, 0, 2] > 0.99


def test_a_closed_room_is_dark_and_its_bent_normals_are_its_normals():
    room = uv_sphere(16, 32)
    inside = room.replace(faces=room.faces[:, ::-1], uv_faces=room.uv_faces[:, ::-1])
    maps = ("normal", "ao", "bent-normal")
    result = bake(inside, inside, BakeOptions(size=64, maps=maps, space="object", front=0.1))
    data = result.has_data
    assert (result.maps["ao"].values[data] == 0).all()
    np.testing.assert_allclose(
        result.maps["bent-normal"].values[data], result.maps["normal"].values[data], atol=1e-6
    )


def test_thickness_is_a_length_and_the_files_name_its_scale(tmp_path):
    ball = uv_sphere(48, 96)
    ball = ball.replace(positions=5 * ball.positions)
    result = bake(ball, ball, BakeOptions(size=64, maps=("thickness",)))
    thickness = result.maps["thickness"]
    values = thickness.values[result.has_data]
    np.testing.assert_allclose(values.mean(), 20 / 3, rtol=5e-3)  # facets of 1/96 turn
    for suffix, scale in ("png", values.max()), ("exr", 1.0):
        written = thickness.write(tmp_path / f"thickness.{suffix}")
        assert written.metadata[THICKNESS_SCALE] == scale


def test_the_given_thickness_is_white_and_the_length_of_the_rays(tmp_path):
    ball = icosphere(3)
    low = uv_sphere(16, 32)
    options = BakeOptions(size=32, maps=("thickness",), thickness_distance=0.5, front=0.2, back=0.2)
    result = bake(ball, low, options)
    assert result.maps["thickness"].values.max() < 0.5  # 2 r cos, cut off at a quarter of it
    written = result.maps["thickness"].write(tmp_path / "thickness.png")
    assert written.metadata[THICKNESS_SCALE] == 0.5


def test_outer_and_inner_rays_are_cast_once_for_all_maps_that_need_them(ground):
    for maps, n in ((("ao", "bent-normal"), 1), (("thickness",), 1), (("ao", "thickness"), 2)):
        counts = bake(ground, plane(), BakeOptions(size=16, maps=maps, **SHORT)).report.counts
        assert counts.secondary_rays == n * 64 * 16**2


@pytest.mark.parametrize("scene", [RayScene, EmbreexScene])
def test_misses_and_hits_without_a_normal_cast_no_secondary_rays(scene, monkeypatch):
    monkeypatch.setattr(scenes, "RayScene", scene)
    options = BakeOptions(size=16, maps=("ao", "bent-normal", "thickness"), **SHORT)
    away = plane().replace(positions=plane().positions + np.array([0, 0, 5]))
    missed = bake(away, plane(), options)
    assert missed.report.texels_missed == 256
    # Two sheets back to back share their vertices, whose normals cancel.
    sheet = plane()
    both = Mesh(
        positions=sheet.positions, faces=np.concatenate([sheet.faces, sheet.faces[:, ::-1]])
    )
    found = bake(both, plane(), options)
    assert found.report.texels_missed == 0
    for result in (missed, found):
        assert all(np.isfinite(baked.values).all() for baked in result.maps.values())
    assert missed.report.counts.secondary_rays == 0


def test_kept_hits_make_no_maps_of_rays_that_were_not_cast(ground):
    options = BakeOptions(size=8, maps=("ao", "bent-normal"), keep_hits=True, **SHORT)
    result = bake(ground, plane(), options)
    with pytest.raises(OptionError, match=r"^thickness: .*; bake with it among the maps$"):
        remap(result, ground, plane(), dataclasses.replace(options, maps=("thickness",)))
    plain = bake(ground, plane(), dataclasses.replace(options, maps=("normal",)))
    with pytest.raises(OptionError, match=r"^ao: "):
        remap(plain, ground, plane(), options)


def test_adaptive_samples_cast_secondary_rays_too(ground):
    options = BakeOptions(
        size=32, maps=("normal", "ao", "bent-normal"), samples="adaptive", max_error="1deg", **SHORT
    )
    result = bake(ground, plane(), options)
    assert [summary.name for summary in result.report.sampling.errors] == ["normal"]
    assert result.report.sampling.unbounded == ("ao", "bent-normal")
    assert any("bounds nothing of ao, bent-normal" in warning for warning in result.report.warnings)
    # The check of errors casts more rays of the bake, but no secondary ones.
    covered = result.report.texels_covered
    assert result.report.counts.secondary_rays == 64 * covered
    with pytest.raises(OptionError, match=r"^max_error, .* bound nothing of ao"):
        bake(ground, plane(), dataclasses.replace(options, maps=("ao",)))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"secondary_rays": 100}, "secondary_rays: 100 is not a power of two"),
        ({"secondary_rays": 8192}, "secondary_rays: 8192 is out of range; it must be 1 to 4096"),
        ({"occluder_distance": 0.0}, "occluder_distance: 0.0 is out of range; it must be above 0"),
    ],
)
def test_choices_are_checked(given, message):
    for options in (SecondaryOptions, BakeOptions):
        with pytest.raises(OptionError, match=f"^{message}"):
            options(**given)
