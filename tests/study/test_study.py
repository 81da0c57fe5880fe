"""One quick study of every knob: errors in the right order, a page that asks for nothing, files."""

import json
import math
import re
import sys
from dataclasses import replace
from html.parser import HTMLParser
from importlib import import_module
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from texbake.errors import DependencyError, MeshError, OptionError
from texbake.mesh.shapes import cube, plane, uv_sphere
from texbake.study import plots
from texbake.study.knob import TRUTHS, Case, Evaluation, Knob, Setting, knob_named
from texbake.study.knobs.bumps import forward_normals
from texbake.study.options import KNOB_MODULES, KNOB_NAMES, StudyOptions
from texbake.study.plots import place_labels
from texbake.study.result import KnobResult, Measurement, findings, spread
from texbake.study.study import run_study, write_study
from texbake.study.truth.probes import angles_deg
from texbake.study.truth.surfaces import texel_grid, wave_heights, wave_normals, wave_slopes

ONCE = StudyOptions(quick=True, repeats=1, seconds=0.0)  # the run that is judged is timed as well


@pytest.fixture(scope="module")
def quick_study():
    """A study of every knob, which takes long: tests that use it are in this module."""
    return run_study(options=ONCE)


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
    assert result.truth in TRUTHS and len(result.measurements) >= 2
    labels = [item.setting.label for item in result.measurements]
    assert len(set(labels)) == len(labels)
    for item in result.measurements:
        assert math.isfinite(item.error) and item.error >= 0.0
        assert min(item.seconds) > 0.0
        picture = item.outcome.picture
        assert picture.shape == (200, 200, 3) and picture.dtype == np.float32
        # What a screen shows and little beyond: highlights, and overshoots of bicubic lookups.
        assert picture.min() > -0.2 and picture.max() < 4.0
        assert picture.std() > 0.0, "a crop that shows nothing"
    assert result.front and len(result.knees) == len(result.problems)


@pytest.mark.parametrize(("knob", "rising"), [
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
])  # fmt: skip
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


def test_normals_along_seams_are_nearly_those_of_the_surface():
    """Edges turn by 7.5 degrees, and most are several texels long."""
    ball = uv_sphere(24, 48)
    bench = knob_named("atlas-quality").prepare(Case(ball, ball, quick=True, threads=1))
    value = bench.settings[0].value
    outcome = bench.judge(value, bench.work(value))
    assert outcome.figures["seam error, mip level 0 (°)"] < 7.5 / 5


def test_triangles_in_the_picture_are_counted_without_empty_pixels():
    bench = knob_named("tessellation").prepare(Case(quick=True, threads=1))
    frame = bench.work(8.0)
    outcome = bench.judge(8.0, frame)
    bench.close()
    ids = set(frame.face_ids.ravel().tolist())
    assert -1 in ids
    assert outcome.figures["triangles in the picture"] == len(ids - {-1})


EMPTY = {"meta", "img", "br", "link", "hr", "input"}


class Outline(HTMLParser):
    """What a page asks for, its identifiers, and whether its tags close."""

    def __init__(self):
        super().__init__()
        self.requests, self.ids, self.links, self.open, self.text = [], [], [], [], []
        self.unclosed = []

    def handle_starttag(self, tag, attrs):
        for name, value in attrs:
            if name in ("src", "href", "srcset", "data", "poster", "xlink:href"):
                (self.links if value.startswith("#") else self.requests).append(value)
            if name == "id":
                self.ids.append(value)
        if tag not in EMPTY:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.handle_starttag(tag, attrs)
        if tag not in EMPTY:
            self.open.pop()

    def handle_endtag(self, tag):
        if not self.open or self.open.pop() != tag:
            self.unclosed.append(tag)

    def handle_data(self, data):
        self.text.append(data)


@pytest.fixture(scope="module")
def some(quick_study):
    """Every fourth knob, because a plot takes a second."""
    return replace(quick_study, knobs=quick_study.knobs[::4])


@pytest.fixture(scope="module")
def written(some, tmp_path_factory):
    folder = tmp_path_factory.mktemp("study") / "new" / "folder"
    return write_study(some, folder)


@pytest.fixture(scope="module")
def page(written):
    return written[0].read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def outline(page):
    found = Outline()
    found.feed(page)
    return found


def test_all_files_are_there(written, some):
    names = {path.name for path in written}
    pictures = {f"{result.knob.name}.png" for result in some.knobs}
    assert names == {"study.html", "study.json", "all.png", *pictures} and len(pictures) > 4
    assert {path.name for path in written[0].parent.iterdir()} == names
    for path in written:
        if path.suffix == ".png":
            assert path.read_bytes().startswith(b"\x89PNG")


def test_the_page_asks_for_nothing(page, outline):
    words = re.sub(r"base64,[A-Za-z0-9+/=]+", "", page)
    assert not re.search(r"https?:|//[a-z]|@import|<script|<link|<iframe|<object", words)
    assert set(re.findall(r"url\((.)", words)) <= {"#"}
    assert all(value.startswith("data:image/png;base64,") for value in outline.requests)


def test_the_page_is_whole_and_tells_every_knob_and_every_setting(some, outline):
    assert outline.unclosed == [] and outline.open == []
    assert len(set(outline.ids)) == len(outline.ids)
    assert {link[1:] for link in outline.links} <= set(outline.ids)
    text = " ".join(" ".join(outline.text).split())
    for result in some.knobs:
        assert result.knob.name in outline.ids
        labels = [item.setting.label for item in result.measurements]
        for words in result.knob.title, result.truth_text, *labels, *findings(result):
            assert words in text
    pictures = [item.outcome.picture for result in some.knobs for item in result.measurements]
    assert len(outline.requests) == sum(each is not None for each in pictures) > len(some.knobs)
    svg = plots.knob_plot(some.knobs[0]).svg
    assert all(f">{item.setting.label}</text>" in svg for item in some.knobs[0].measurements)


def test_axes_leave_room_around_their_points():
    from matplotlib.figure import Figure

    axes = Figure().subplots()
    dots = [plots.Dot(10.0**i, 10.0 ** (-3 * i), 10.0**i, 10.0**i, str(i), "red") for i in range(3)]
    plots.draw_dots(axes, dots, [], [], label_size=8, x_label="seconds", x_format=str)
    for limits, decades in ((axes.get_xlim(), (0.0, 2.0)), (axes.get_ylim(), (-6.0, 0.0))):
        room = decades[0] - np.log10(limits[0]), np.log10(limits[1]) - decades[1]
        assert room == pytest.approx((room[0], room[0]))
        assert 0.1 < room[0] / (decades[1] - decades[0]) < 0.2


def test_without_matplotlib_one_line_says_what_to_install(monkeypatch, quick_study, tmp_path):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(DependencyError, match=r"texbake\[study\]"):
        write_study(quick_study, tmp_path / "never")
    assert not (tmp_path / "never").exists()


def test_labels_far_apart_lie_beside_their_points_and_crowded_ones_do_not_overlap():
    rng = np.random.default_rng(0)
    points = rng.uniform(100.0, 500.0, (25, 2))
    sizes = np.tile([60.0, 12.0], (25, 1))
    corners = place_labels(points, sizes, (0.0, 0.0, 600.0, 600.0))
    ends = corners + sizes
    assert (corners >= 0.0).all() and (ends <= 600.0).all()
    for i in range(25):
        for j in range(i):
            shared = np.minimum(ends[i], ends[j]) - np.maximum(corners[i], corners[j])
            assert not (shared > 0.5).all()
    assert place_labels(np.array([[50.0, 50.0]]), sizes[:1], (0, 0, 200, 200)).tolist()[0][0] > 50.0


def measured(label, seconds, error, problem=""):
    setting = Setting(label, None, problem=problem)
    return Measurement(setting, Evaluation(error), tuple(seconds), 1000)


def result_of(*measurements):
    knob = Knob("k", "K", "", "error", "°", "angle", prepare=lambda case: None)
    return KnobResult(knob, "s", "converged", "", measurements)


def test_json_has_its_schema(quick_study):
    report = json.loads(json.dumps(quick_study.to_json(), allow_nan=False))
    assert report["schema"] == "texbake-study-1"
    assert [item["knob"] for item in report["knobs"]] == list(KNOB_NAMES)
    for item in report["knobs"]:
        assert {"title", "error", "unit", "kind", "subject", "truth", "truth_text"} <= set(item)
        labels = [setting["setting"] for setting in item["settings"]]
        assert set(item["front"]) <= set(labels)
        assert set(item["stops_paying"]) <= set(item["front"])
        for setting in item["settings"]:
            assert set(setting) == {
                "setting", "series", "problem", "error", "figures", "seconds", "seconds_median",
                "seconds_min", "seconds_max", "peak_bytes",
            }  # fmt: skip
            assert setting["seconds_min"] <= setting["seconds_median"] <= setting["seconds_max"]


def test_settings_compete_only_within_their_problem():
    result = result_of(
        measured("a", [1.0], 1.0, "easy"), measured("b", [2.0], 0.5, "easy"),
        measured("c", [3.0], 9.0, "hard"), measured("d", [4.0], 20.0, "hard"),
    )  # fmt: skip
    assert (result.fronts, result.knees) == ([[0, 1], [2]], [1, 2])


def test_errors_are_the_same_in_every_study_and_for_any_threads(quick_study):
    names = ("bump-gradient", "interpolation", "noise")
    again = run_study(options=replace(ONCE, knobs=names, threads=1))
    before = {item.knob.name: item for item in quick_study.knobs}
    for item in again.knobs:
        assert [m.error for m in item.measurements] == [
            m.error for m in before[item.knob.name].measurements
        ]


def test_a_knob_that_does_not_fit_is_left_out_and_told(tmp_path):
    names = ("low-poly", "noise")
    result = run_study(cube(), cube(), options=replace(ONCE, knobs=names))
    assert [item.knob.name for item in result.knobs] == ["noise"]
    assert list(result.skipped) == ["low-poly"]
    assert "has 12 triangles" in result.to_json()["skipped"]["low-poly"]
    page = write_study(result, tmp_path)[0].read_text(encoding="utf-8")
    assert "low-poly is left out: " in page and "has 12 triangles" in page


def test_a_study_of_nothing_that_fits_is_one_clear_error():
    with pytest.raises(MeshError, match=r"^study low-poly: .* has 12 triangles, too few"):
        run_study(cube(), cube(), options=StudyOptions(quick=True, knobs=("low-poly",)))


def test_half_a_pair_is_refused():
    with pytest.raises(OptionError, match="a high-poly and a low-poly mesh"):
        run_study(plane())


def test_knobs_are_studied_once_and_in_the_order_of_the_list():
    options = StudyOptions(knobs=("noise", "samples", "noise"))
    assert options.ordered_knobs == ("samples", "noise")


def test_no_time_lies_farther_from_the_median_than_is_told():
    item = measured("a", [1.0, 1.0, 3.0], 5.0)
    assert spread(item) == 2.0
    assert "within ±200 % of their median" in findings(result_of(item))[-1]


def test_time_budgets_are_shares_of_the_time_that_16_samples_take(monkeypatch):
    from texbake.study.knobs import baked_maps

    ticks = iter((10.0, 14.0))
    monkeypatch.setattr(baked_maps.time, "perf_counter", lambda: next(ticks))
    done = []
    settings = baked_maps._settings(Case(quick=True), 64, done.append)
    assert [options.samples for options in done] == [16, 16]
    budgets = [setting.value.time_budget for setting in settings if "budget" in setting.label]
    assert budgets == [f"{4.0 * share:.2g}s" for share in baked_maps._QUICK_BUDGETS]
