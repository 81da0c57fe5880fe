"""Pictures until an error is reached, against closed forms and against many samples."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import cube, icosphere
from texbake.rendering.options import RenderOptions
from texbake.rendering.render import render, render_scene
from texbake.rendering.scene.lights import Light, Lighting
from texbake.rendering.scene.material import Material
from texbake.rendering.scene.scene import CameraView, Scene, SceneObject
from texbake.rendering.scene.textures import ProcedureTexture
from texbake.texture.encoding import encode_srgb

OPTIONS = RenderOptions(width=96, height=64, max_error="2/255")
WHITE = Material(base_color=(1.0, 1.0, 1.0), shading="unlit")


def bumpy_ball():
    """A glossy ball with a fine pattern: edges, highlights and texture, all smaller than pixels."""
    pattern = ProcedureTexture(procedure="noise", scale=9.0, space="object", filtered=False)
    material = Material(base_color=pattern, roughness=0.2)
    return Scene(
        objects=(SceneObject(mesh=icosphere(3), material=material),),
        lighting=Lighting(lights=(Light(name="lamp", direction=(1.0, -1.0, -1.0)),)),
    )


def half_plane(angle):
    """A white triangle that covers all of the picture beyond a line through its middle, turned."""
    far = 50.0
    corners = np.array([[0.0, far, 0.0], [0.0, -far, 0.0], [far, 0.0, 0.0]])
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    corners[:, :2] = corners[:, :2] @ turn.T
    mesh = Mesh(positions=corners, faces=np.array([[0, 2, 1], [0, 1, 2]]))
    return Scene(
        objects=(SceneObject(mesh=mesh, material=WHITE),),
        view=CameraView(position=(0.0, 0.0, 3.0), target=(0.0, 0.0, 0.0), fov=40.0),
    )


def covered_shares(angle, options):
    """(H, W): share of each pixel beyond the line, by 100 x 100 samples."""
    steps = (np.arange(100) + 0.5) / 100
    x = np.arange(options.width)[:, None] + steps - 0.5 * options.width
    y = 0.5 * options.height - np.arange(options.height)[:, None] - steps
    # The line goes through the middle of the picture: its distance needs no scale.
    rows = (x[:, None] * np.cos(angle) + (row * np.sin(angle))[:, None] > 0.0 for row in y)
    return np.stack([row.mean(axis=(1, 2)) for row in rows])


@pytest.mark.parametrize("angle", [0.0, 0.11, 0.9, 1.5])
def test_straight_edges_are_where_they_are(angle):
    options = replace(OPTIONS, background=(0.0, 0.0, 0.0), max_error="3/255")
    frame = render_scene(half_plane(angle), options)
    truth = encode_srgb(covered_shares(angle, options))
    off = 255.0 * np.abs(encode_srgb(frame.color[..., 0]) - truth)
    naive = render_scene(half_plane(angle), replace(options, max_error=None)).color[..., 0]
    # 16 x 16 samples leave up to half a row, 1 / 32, at an edge along a row, which nothing says.
    assert off.max() <= 255.0 * (encode_srgb(1.0) - encode_srgb(1.0 - 1 / 32)) * 4
    assert np.percentile(off, 99.5) <= 3.0
    assert angle == 0.0 or 255.0 * np.abs(encode_srgb(naive) - truth).max() > 4.0 * off.max()
    assert frame.sampling.shaded_percents[1] > 80.0  # edges need few shadings


@pytest.fixture(scope="module")
def ball():
    scene = bumpy_ball()
    frames = {
        bound: render_scene(scene, replace(OPTIONS, max_error=bound))
        for bound in ("16/255", "4/255", "2/255")
    }
    fixed = replace(OPTIONS, max_error=None, supersampling=16, edges="supersample")
    return frames, render_scene(scene, fixed)


def off(frame, truth):
    """(H, W) errors in steps of 255."""
    a, b = (encode_srgb(item.color[..., :3]) for item in (frame, truth))
    return 255.0 * np.abs(a - b).max(axis=-1)[truth.coverage > 0]


def test_errors_are_within_the_bound_for_nearly_all_pixels(ball):
    frames, truth = ball
    for bound, frame in frames.items():
        assert np.mean(off(frame, truth) <= float(bound.split("/")[0])) > 0.97


def test_a_closer_bound_is_a_better_picture_of_more_samples(ball):
    frames, truth = ball
    rms = [np.sqrt(np.mean(off(frame, truth) ** 2)) for frame in frames.values()]
    shadings = [frame.sampling.shadings_per_pixel for frame in frames.values()]
    assert rms == sorted(rms, reverse=True) and shadings == sorted(shadings)


def test_it_beats_fixed_samples_of_as_many_shadings(ball):
    frames, truth = ball
    frame = frames["4/255"]
    fixed = replace(OPTIONS, max_error=None, supersampling=4, edges="supersample")
    other = render_scene(bumpy_ball(), fixed)
    assert frame.sampling.shadings_per_pixel < 16.0
    assert np.percentile(off(frame, truth), 99) < 0.7 * np.percentile(off(other, truth), 99)


def test_the_check_agrees_with_the_truth(ball):
    frames, truth = ball
    sampling = frames["4/255"].sampling
    n_shown = np.count_nonzero(truth.coverage)
    # A pixel that only 16 x 16 samples see a surface in is none of the picture's own.
    assert sampling.n_checked == pytest.approx(0.01 * n_shown, abs=1)
    assert sampling.samples_of_check == 225
    # Of some 25 pixels: three standard deviations of a share of 3 %.
    true_share = 100.0 * np.mean(off(frames["4/255"], truth) <= 4.0)
    assert abs(sampling.errors[0].measured_within_percent - true_share) < 12.0
    for percents in sampling.shaded_percents, sampling.sample_percents:
        assert sum(percents.values()) == pytest.approx(100.0)
    assert list(sampling.errors[0].estimated) == [50, 99, 100]


def test_the_same_bytes_for_any_number_of_threads():
    scene = bumpy_ball()
    one, many = (render_scene(scene, OPTIONS, threads=threads) for threads in (1, 5))
    assert one.color.tobytes() == many.color.tobytes()
    assert one.sampling == many.sampling


def test_without_background_color_is_not_multiplied_by_opacity():
    red = Material(base_color=(0.8, 0.1, 0.1), shading="unlit")
    scene = Scene(objects=(SceneObject(mesh=icosphere(2), material=red),))
    frame = render_scene(scene, replace(OPTIONS, background=None))
    partly = (frame.coverage > 0.0) & (frame.coverage < 1.0)
    assert partly.any()
    np.testing.assert_allclose(frame.color[partly, :3], [[0.8, 0.1, 0.1]] * partly.sum(), rtol=1e-6)
    np.testing.assert_allclose(frame.color[..., 3], frame.coverage, atol=1e-6)


def test_what_is_even_is_sampled_once():
    plain = Scene(
        objects=(SceneObject(mesh=cube(), material=WHITE),),
        view=CameraView(position=(0.0, 0.0, 1.2), target=(0.0, 0.0, 0.0), fov=30.0),
    )
    frame = render_scene(plain, OPTIONS)
    assert (frame.color == 1.0).all()
    assert frame.sampling.shaded_percents == {1: 100.0}
    assert frame.sampling.sample_percents == {16: 100.0}
    assert frame.sampling.errors[0].estimated[100] == 0.0
    assert frame.sampling.errors[0].measured[100] == 0.0


def test_normals_are_of_the_pixels_that_coverage_and_depths_are_of():
    frame = render(icosphere(2), options=OPTIONS)
    plain = render(icosphere(2), options=replace(OPTIONS, max_error=None))
    assert (frame.normals == plain.normals).all()
    assert ((frame.coverage > 0.0) == np.isfinite(frame.depths)).all()


def test_a_picture_with_fixed_samples_loads_nothing_of_it():
    code = (
        "import sys, texbake; from texbake.mesh.shapes import cube;"
        "texbake.render(cube(), options=texbake.RenderOptions(width=16, height=16));"
        "print([m for m in sys.modules if 'adaptive_pixels' in m])"
    )
    found = subprocess.run(
        [sys.executable, "-P", "-c", code], capture_output=True, text=True, check=True
    )
    assert found.stdout.strip() == "[]"
