"""Samples of pixels against pictures that are drawn whole."""

from dataclasses import replace

import numpy as np
import pytest

from texbake import Light, Lighting, Material, RenderOptions, Scene, SceneObject, render_scene
from texbake.mesh.shapes import cube, icosphere
from texbake.progress import Stages
from texbake.rendering.adaptive_pixels import sampler
from texbake.rendering.adaptive_pixels.pixel_statistics import (
    PixelSums,
    Sides,
    code_means,
    edge_errors,
    shading_errors,
)
from texbake.rendering.adaptive_pixels.sampler import PixelSampler
from texbake.rendering.draw import lay_out, prepare
from texbake.rendering.request import RenderRequest
from texbake.rendering.scene.lights import Environment, Fog
from texbake.rendering.scene.scene import camera_of
from texbake.rendering.scene.textures import ProcedureTexture
from texbake.texture.encoding import encode_srgb

OPTIONS = RenderOptions(width=48, height=32, supersampling=4, max_error=0.01)
LAMP = Light(name="lamp", direction=(1.0, -1.0, -1.0))


def a_scene(name):
    marble = Material(base_color=ProcedureTexture(procedure="marble"), roughness=0.3)
    glass = Material(base_color=(0.2, 0.4, 0.9), opacity=0.4)
    ball, box = (
        SceneObject(mesh=icosphere(2), material=marble),
        SceneObject(mesh=cube(), material=glass),
    )
    sky = Environment(color=(0.3, 0.5, 0.9), background=True)
    return {
        "opaque": Scene(objects=(ball,), lighting=Lighting(lights=(LAMP,))),
        "glass": Scene(objects=(ball, box), lighting=Lighting(lights=(LAMP,))),
        "sky": Scene(objects=(ball,), lighting=Lighting(lights=(LAMP,), environment=sky)),
        "fog": Scene(objects=(ball,), lighting=Lighting(lights=(LAMP,), fog=Fog())),
    }[name]


def sampled(scene, options, sides, *, wanted=None):
    camera = camera_of(scene, options)
    state = lay_out(
        prepare(scene, options), RenderRequest(scene, options, camera), Stages(), all_objects=True
    )
    sums = PixelSums.empty(options.height, options.width)
    sampler = PixelSampler(state)
    everywhere = np.ones(sums.counts.shape, np.bool_)
    sampler.take(everywhere if wanted is None else wanted, sides, sums)
    return sampler, sums


@pytest.mark.parametrize("background", [None, (0.2, 0.3, 0.4)])
@pytest.mark.parametrize("name", ["opaque", "glass", "sky", "fog"])
@pytest.mark.parametrize(("sides", "edges"), [(Sides(4, 4), "supersample"),
                                              (Sides(4, 1), "multisample")])  # fmt: skip
def test_they_are_those_of_a_whole_picture(name, background, sides, edges):
    scene, options = a_scene(name), replace(OPTIONS, background=background)
    _, sums = sampled(scene, options, sides)
    frame = render_scene(scene, replace(options, max_error=None, edges=edges))
    means = sums.means
    color = means[..., :3] / np.maximum(means[..., 3:], 1e-9)
    # The rounding of float32 sums of 16.
    np.testing.assert_allclose(means[..., 3], frame.color[..., 3], atol=1e-6)
    np.testing.assert_allclose(color, frame.color[..., :3], atol=2e-6)
    np.testing.assert_allclose(sums.coverage, frame.coverage, atol=1e-6)


def test_cells_between_one_and_all_are_small_pixels():
    """2 x 2 cells of 2 x 2 samples are the picture of twice the size, scaled down."""
    scene = a_scene("opaque")
    plain = replace(scene.objects[0].material, base_color=(0.8, 0.3, 0.2))
    scene = replace(scene, objects=(replace(scene.objects[0], material=plain),))
    _, sums = sampled(scene, OPTIONS, Sides(4, 2))
    large = replace(OPTIONS, width=96, height=64, supersampling=2, max_error=None)
    frame = render_scene(scene, large)
    halved = frame.color.reshape(32, 2, 48, 2, 4).mean(axis=(1, 3))
    np.testing.assert_allclose(sums.means[..., :3], halved[..., :3], atol=2e-6)


def test_squares_are_those_of_the_samples():
    """The variance of a pixel half covered by c over b is (c - b)^2 / 4 of its share."""
    white = Material(base_color=(1.0, 1.0, 1.0), shading="unlit")
    scene = Scene(objects=(SceneObject(mesh=cube(), material=white),))
    _, sums = sampled(scene, replace(OPTIONS, background=(0.0, 0.0, 0.0)), Sides(8, 1))
    share = sums.means[..., 0]
    variance = sums.squares[..., 0] / sums.counts - share**2
    np.testing.assert_allclose(variance, share * (1.0 - share), atol=1e-9)
    assert 0.0 < share[sums.coverage < 1.0].max() < 1.0


def assert_same(some, everything, wanted):
    for name in "light", "squares", "covered", "counts":
        assert getattr(some, name)[wanted].tobytes() == getattr(everything, name)[wanted].tobytes()


@pytest.mark.parametrize("sides", [Sides(4, 1), Sides(8, 2), Sides(4, 4)])
@pytest.mark.parametrize("name", ["opaque", "glass", "sky"])
def test_only_what_is_wanted_is_sampled_and_as_in_the_whole_picture(name, sides):
    wanted = np.zeros((32, 48), np.bool_)
    wanted[3:5, 20:30] = wanted[30, 7] = wanted[17:20, 22] = True
    sampler, some = sampled(a_scene(name), OPTIONS, sides, wanted=wanted)
    _, everything = sampled(a_scene(name), OPTIONS, sides)
    n_shown = np.count_nonzero(wanted & (everything.coverage > 0.0))
    assert n_shown > 0 and sampler.n_shaded == sides.shaded**2 * n_shown
    assert not some.light[~wanted].any() and not some.counts[~wanted].any()
    assert_same(some, everything, wanted)


@pytest.mark.parametrize("name", ["opaque", "glass"])
def test_strips_hold_all_that_is_wanted(name, monkeypatch):
    _, whole = sampled(a_scene(name), OPTIONS, Sides(4, 1))
    monkeypatch.setattr(sampler, "_WINDOW", 48 * 5 * 16)
    in_strips, strips = sampled(a_scene(name), OPTIONS, Sides(4, 1))
    assert in_strips.n_windows == 7  # of 5 rows, the last of 2
    assert_same(strips, whole, np.ones((32, 48), np.bool_))


# Estimates of errors.
def sums_of(means, deviation=0.0, count=16):
    """Sums of gray pixels with given means and deviations; all are opaque."""
    means = np.asarray(means, np.float64)
    sums = PixelSums.empty(*means.shape)
    sums.counts[...] = count
    sums.light[..., :3] = count * means[..., None]
    sums.squares[..., :3] = count * (means**2 + np.asarray(deviation) ** 2)[..., None]
    sums.light[..., 3] = sums.squares[..., 3] = count
    return sums


def codes_of(sums):
    codes = np.zeros(sums.light.shape, np.float32)
    code_means(sums, codes, threads=1)
    return codes


def once(shape):
    return np.ones(shape, np.int32), np.zeros(shape, np.float32)


def test_codes_are_those_of_a_file():
    means = np.array([[-0.1, 0.0, 0.003, 0.0032, 0.2, 1.0, 7.0]])
    codes = codes_of(sums_of(means))
    np.testing.assert_allclose(codes[..., 0], encode_srgb(means), atol=1e-7)
    assert (codes[..., 3] == 1.0).all()


def test_an_even_picture_has_no_errors():
    sums = sums_of(np.full((4, 5), 0.3))
    assert edge_errors(sums, threads=1).max() < 1e-6  # of squares, in float64
    assert not shading_errors(codes_of(sums), *once((4, 5)), threads=1).any()


def test_a_slope_has_none_and_a_bend_a_quarter_of_it():
    """Codes that grow by 0.1 up to a bend, after which they stay: the second difference is 0.1."""
    codes = np.zeros((3, 5, 4), np.float32)
    codes[..., 0] = [0.0, 0.1, 0.2, 0.2, 0.2]
    errors = shading_errors(codes, *once((3, 5)), threads=1)
    # At the border of the picture the one difference there is counts.
    np.testing.assert_allclose(errors[1], [0.025, 0.0, 0.025, 0.0, 0.0], atol=1e-7)


def test_what_changed_tells_of_finer_shading():
    shaded = np.full((1, 5), 2, np.int32)
    changes = np.array([[0.0, 0.0, 0.3, 0.0, 0.0]], np.float32)
    errors = shading_errors(np.zeros((1, 5, 4), np.float32), shaded, changes, threads=1)
    even = 0.3 / np.sqrt(3.0)  # of a pixel and the two beside it
    np.testing.assert_allclose(errors[0], 0.7 * np.array([0.0, even, 0.3, even, 0.0]), rtol=1e-6)


@pytest.mark.parametrize("count", [16, 64, 256])
def test_edges_leave_less_with_more_samples(count):
    """White over black on half of a pixel: half a step of n^-3/4, coded on the darker side."""
    off = 0.5 * count**-0.75
    error = edge_errors(sums_of([[0.5]], 0.5, count), threads=1)[0, 0]
    assert error == pytest.approx(float(encode_srgb(0.5) - encode_srgb(0.5 - off)), rel=1e-5)


def test_what_the_slope_explains_is_no_edge():
    """Samples of a slope of 0.1 a pixel deviate by 0.1 (1 - 1 / n)^1/2 / sqrt(12)."""
    deviation = 0.1 * np.sqrt((1 - 1 / 16) / 12)
    means = np.broadcast_to([0.2, 0.3, 0.4, 0.5], (3, 4))
    assert edge_errors(sums_of(means, deviation), threads=1)[1, 1:3].max() < 1e-6
    flat = edge_errors(sums_of(np.full((3, 4), 0.3), deviation), threads=1)
    assert flat.min() > 1e-3


def test_a_leap_between_pixels_is_seen_in_both():
    errors = edge_errors(sums_of(np.broadcast_to([0.0, 0.0, 1.0, 1.0], (3, 4))), threads=1)
    off = 0.5 * 16**-0.75
    assert errors[1, 1] == pytest.approx(float(encode_srgb(off)), rel=1e-5)
    assert errors[1, 2] == pytest.approx(float(1.0 - encode_srgb(1.0 - off)), rel=1e-5)
    assert not errors[1, 0] and not errors[1, 3]
