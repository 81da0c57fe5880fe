"""Every knob in its quick form: it runs, and its errors are in the right order."""

import math
from importlib import import_module
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from texbake.study.knob import TRUTHS, Case, Knob, NotApplicable, knob_named
from texbake.study.knobs.bumps import forward_normals
from texbake.study.options import KNOB_MODULES, KNOB_NAMES
from texbake.study.truth.probes import angles_deg
from texbake.study.truth.surfaces import (
    texel_grid,
    wave_heights,
    wave_normals,
    wave_slopes,
)


@pytest.fixture
def errors(quick_study):
    """Error of each setting, by knob and label."""
    return {
        result.knob.name: {m.setting.label: m.error for m in result.measurements}
        for result in quick_study.knobs
    }


def test_every_knob_of_every_module_is_in_the_list():
    folder = Path(import_module("texbake.study.knobs").__file__).parent
    modules = {path.stem for path in folder.glob("*.py")} - {"__init__"}
    assert modules == set(KNOB_MODULES.values())
    knobs = {
        value.name
        for module in modules
        for value in vars(import_module(f"texbake.study.knobs.{module}")).values()
        if isinstance(value, Knob)
    }
    assert knobs == set(KNOB_NAMES)
    assert [knob_named(name).name for name in KNOB_NAMES] == list(KNOB_NAMES)


@pytest.mark.parametrize("name", KNOB_NAMES)
def test_every_knob_runs(quick_study, name):
    result = next(item for item in quick_study.knobs if item.knob.name == name)
    assert result.truth in TRUTHS
    assert len(result.measurements) >= 2
    labels = [item.setting.label for item in result.measurements]
    assert len(set(labels)) == len(labels)
    for item in result.measurements:
        assert math.isfinite(item.error) and item.error >= 0.0
        assert min(item.seconds) > 0.0
        picture = item.outcome.picture
        assert picture is not None
        assert picture.shape == (200, 200, 3) and picture.dtype == np.float32
        assert np.isfinite(picture).all()
        assert picture.std() > 0.0, "a crop that shows nothing"
    assert result.front and len(result.knees) == len(result.problems)


@pytest.mark.parametrize(
    ("knob", "rising"),
    [
        ("texture-size", ["32", "64", "128"]),
        ("samples", ["1", "4", "16", "64"]),
        ("bit-depth", ["8", "16", "float"]),
        ("atlas-quality", ["fast, padding 4", "good, padding 4"]),
        ("bump-gradient", ["forward 1/64", "central 1/64", "analytic 1/64"]),
        ("bump-gradient", ["central 1/32", "central 1/64"]),
        ("bump-form", ["blinn, d = 0.1", "exact, d = 0.1"]),
        ("bump-light", ["emboss, d = 0.1", "blinn, d = 0.1", "exact, d = 0.1"]),
        ("surface-detail", ["bare", "normal map", "displacement", "both"]),
        ("tessellation", ["16 px", "8 px", "4 px"]),
        ("texture-lookup", ["bilinear", "trilinear", "EWA 2", "EWA 4", "EWA 8", "EWA 16"]),
        ("interpolation", ["affine, 1 x 1", "affine, 2 x 2", "affine, 4 x 4", "perspective"]),
        ("environment", ["one lookup", "rendered, 16", "rendered, 64"]),
        ("noise", ["1, float64", "3, float64", "6, float64"]),
        ("low-poly", ["50 fast", "50 best", "200 best"]),
    ],
)
def test_turning_a_knob_up_makes_it_better(errors, knob, rising):
    values = [errors[knob][label] for label in rising]
    assert all(a > b for a, b in pairwise(values)), values


def test_maps_of_a_convex_mesh_change_all_texels_but_for_occlusion(errors):
    found = errors["map-kind"]
    # The rippled sphere has shallow valleys; at few texels they hide some of the sky.
    assert found["ao"] > 90.0
    assert max(found[name] for name in ("normal", "displacement", "curvature", "thickness")) < 1.0


def test_perspective_and_scanline_interpolation_are_exact(errors):
    # Of 1,024 texels: float32 coordinates through sRGB codes and back.
    assert errors["interpolation"]["perspective"] < 1e-3
    assert errors["interpolation"]["scanline"] < 1e-3


def test_first_order_bumps_are_off_in_proportion_to_their_height(errors):
    """Twice d leaves out four times: |d N_u| times the slope d_u, both in proportion to d."""
    excess = {
        d: errors["bump-form"][f"blinn, d = {d}"] - errors["bump-form"][f"exact, d = {d}"]
        for d in (0.01, 0.1)
    }
    assert excess[0.1] > 10.0 * excess[0.01] > 0.0


def test_normalized_embossing_lights_as_the_first_order_form_does(errors):
    normalized, blinn = (
        errors["bump-light"][f"{form}, d = 0.1"] for form in ("emboss normalized", "blinn")
    )
    assert normalized == pytest.approx(blinn, rel=0.02)


def test_eight_bits_round_as_much_as_they_must(errors):
    # 0.170 degrees in the mean over all directions.
    assert errors["bit-depth"]["8"] == pytest.approx(0.17, abs=0.02)
    assert errors["bit-depth"]["float"] < 1e-4


def test_dithering_makes_the_mean_of_flat_areas_more_accurate():
    """A flat tilt of a third of a step: its codes are all wrong the same way without dither."""
    from texbake.study.knobs.baked_maps import _banding, _dithered
    from texbake.texture.encoding import decode_normals, encode_normals

    angle = math.radians(10.0)
    tilt = np.array([math.sin(angle), 0.0021, math.cos(angle)])
    flat = np.broadcast_to(tilt / np.linalg.norm(tilt), (64, 64, 3)).astype(np.float32)
    known = np.ones((64, 64), bool)
    plain, dithered = (
        _banding(decode_normals(encode_normals(values, bits=8)), flat, known)
        for values in (flat, _dithered(flat, 8))
    )
    assert dithered < 0.3 * plain


def test_forward_differences_are_the_slope_half_a_texel_further():
    n = 256
    x, y = texel_grid(n)
    normals = forward_normals(wave_heights(x, y).astype(np.float32)).astype(np.float64)
    along, up = wave_slopes(x + 0.5 / n, y)[0], wave_slopes(x, y + 0.5 / n)[1]
    there = np.stack([-along, -up, np.ones_like(up)], axis=-1)
    there /= np.linalg.norm(there, axis=-1, keepdims=True)
    here = wave_normals(x, y)
    off = angles_deg(normals.reshape(-1, 3), there.reshape(-1, 3)).mean()
    # At the moved place they are of second order, as central differences are.
    assert off < 0.2 * angles_deg(normals.reshape(-1, 3), here.reshape(-1, 3)).mean()


def test_a_users_pair_is_compared_with_separate_rays():
    made = Case(quick=True).made_pair
    bare = made.low.replace(uvs=None, uv_faces=None)
    bench = knob_named("texture-size").prepare(Case(made.high, bare, quick=True))
    assert bench.truth == "rays"
    sizes = [setting.value for setting in bench.settings]
    values = [bench.judge(size, bench.work(size)).error for size in sizes]
    assert all(a > b for a, b in pairwise(values))


def test_a_users_scene_is_drawn_where_a_knob_applies_to_it():
    scenes = import_module("texbake.study.knobs.lighting")
    scene, _ = scenes._made_scene()
    bench = knob_named("shadow-map").prepare(Case(scene=scene, quick=True))
    assert bench.truth == "converged" and bench.subject.startswith("scene")
    coarse, fine = (bench.judge(value, bench.work(value)).error for value in ((2, 0.0), (512, 0.0)))
    assert fine < coarse
    # It has no image, so lookups are studied on the generated floor.
    assert "floor" in knob_named("texture-lookup").prepare(Case(scene=scene, quick=True)).subject


def test_filters_are_studied_on_a_scene_with_an_image():
    from texbake.mesh.shapes import plane
    from texbake.rendering.scene.material import Material
    from texbake.rendering.scene.scene import Scene, SceneObject
    from texbake.rendering.scene.textures import ImageTexture
    from texbake.texture.checker import checker_image

    material = Material(shading="unlit", base_color=ImageTexture(image=checker_image(512, 8)))
    scene = Scene(objects=(SceneObject(mesh=plane(), material=material),), name="board")
    bench = knob_named("texture-lookup").prepare(Case(scene=scene, quick=True))
    assert bench.subject.startswith("board")
    found = {s.label: bench.judge(s.value, bench.work(s.value)).error for s in bench.settings}
    assert found["ewa"] < found["nearest"] and found["trilinear"] < found["nearest"]


def test_a_high_poly_mesh_with_fewer_triangles_than_any_setting_does_not_fit():
    from texbake.mesh.shapes import cube

    unfit = knob_named("low-poly").prepare(Case(cube(), cube()))
    assert isinstance(unfit, NotApplicable)
    assert "has 12 triangles, too few" in unfit.reason


def test_triangles_in_the_picture_are_counted_without_empty_pixels():
    bench = knob_named("tessellation").prepare(Case(quick=True, threads=1))
    frame = bench.work(8.0)
    outcome = bench.judge(8.0, frame)
    bench.close()
    ids = set(frame.face_ids.ravel().tolist())
    assert -1 in ids
    assert outcome.figures["triangles in the picture"] == len(ids - {-1})
