"""The parts of pages: the frame, three.js, pictures of maps, histograms, words."""

import base64
import hashlib
import io
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st
from markupsafe import Markup
from PIL import Image

from texbake import BakeOptions, bake, write_image
from texbake.mesh.shapes import plane
from texbake.pages import page, pictures
from texbake.pages.asset_page import as_asked, page_options
from texbake.pages.page import as_json, asset, duration, memory, page_html
from texbake.pages.pictures import baked_pictures, file_pictures, miss_picture
from texbake.pages.plots import histogram_svg, ticks


def pixels_of(uri):
    kind, _, data = uri.partition(";base64,")
    assert kind == "data:image/png"
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(data))).convert("RGBA"))


def test_a_page_lets_only_its_own_scripts_run():
    page = page_html(
        "a < b", Markup("<p>x</p>"), scripts=["let a = 1;", "a + 'ü'"], data={"d": "1"}
    )
    (policy,) = re.findall(r'Content-Security-Policy" content="([^"]*)"', page)
    rules = dict(rule.strip().split(" ", 1) for rule in policy.split(";"))
    assert (rules["default-src"], rules["img-src"]) == ("'none'", "data:")
    written = re.findall(r"<script>(.*?)</script>", page, re.DOTALL)
    hashes = [hashlib.sha256(text.encode()).digest() for text in written]
    assert rules["script-src"] == " ".join(
        f"'sha256-{base64.b64encode(digest).decode()}'" for digest in hashes
    )
    assert "<title>a &lt; b</title>" in page
    assert "script-src 'none'" in page_html("", Markup())


def test_a_page_without_a_dark_scheme_has_none():
    assert "prefers-color-scheme" in page_html("", Markup())
    assert "prefers-color-scheme" not in page_html("", Markup(), dark=False)


@pytest.mark.parametrize("text", ["<", "</script>", "<!--<script>", "\\<", "a\u2028<"])
def test_no_text_ends_the_block_that_it_stands_in(text):
    assert "<" not in as_json({"name": text})


def test_three_js_is_whole_and_has_its_license():
    source = asset("three.min.js")
    assert "SPDX-License-Identifier: MIT" in source[:200]
    assert "Three.js Authors" in source[:200]
    for name in "WebGLRenderer", "ShaderMaterial", "BufferGeometry", "WireframeGeometry":
        assert f"t.{name}=" in source
    assert "</script" not in source
    assert (Path(page.__file__).parent / "assets" / "three.LICENSE.txt").is_file()


def test_pictures_of_a_bake_are_its_codes(baked):
    pictures = {picture.name: picture for picture in baked_pictures(baked.maps, {"normal": "Hm."})}
    shown = pixels_of(pictures["normal"].uri)
    assert shown.shape == (96, 96, 4)
    assert pictures["normal"].note == "Hm." and pictures["displacement"].note == ""
    decoded = shown[..., :3] / 127.5 - 1.0
    # Half a step of 8 bits, and flat texels that are written as 128.
    assert np.abs(decoded - baked.maps["normal"].values).max() <= 1.0 / 255.0 + 1e-6
    heights = pictures["displacement"].settings()
    read = (pixels_of(pictures["displacement"].uri)[..., 0] / 255.0 - heights["mid"]) * heights[
        "scale"
    ]
    found = baked.maps["displacement"].values[..., 0]
    assert np.abs(read - found)[baked.has_data].max() <= 0.5 * heights["scale"] / 255.0 + 1e-7


def test_directx_reaches_the_view():
    result = bake(plane(), plane(), BakeOptions(size=8, convention="directx"))
    assert baked_pictures(result.maps)[0].settings()["green"] == -1


def test_maps_are_halved_until_they_fit(monkeypatch, tmp_path):
    noise = np.random.default_rng(0).random((1024, 512, 3), np.float32)
    write_image(noise, tmp_path / "a.png", bits=8)
    (whole,) = file_pictures({"albedo": tmp_path / "a.png"}, codings={"albedo": "color"})
    assert (whole.width, whole.height) == (whole.full_width, whole.full_height) == (512, 1024)
    monkeypatch.setattr(pictures, "MOST_BYTES", 500_000)
    (half,) = file_pictures({"albedo": tmp_path / "a.png"}, codings={"albedo": "color"})
    assert (half.width, half.height) == (256, 512)
    assert (half.full_width, half.full_height) == (512, 1024)
    full = pixels_of(whole.uri)[..., :3].astype(float)
    means = full.reshape(512, 2, 256, 2, 3).mean(axis=(1, 3))
    assert np.abs(pixels_of(half.uri)[..., :3] - means).max() <= 1.0
    monkeypatch.setattr(pictures, "MOST_BYTES", 1)
    (least,) = file_pictures({"albedo": tmp_path / "a.png"}, codings={})
    assert (least.width, least.height) == (256, 512)


def test_numbers_that_stand_for_things_are_not_averaged(monkeypatch, tmp_path):
    codes = np.random.default_rng(1).choice([0.0, 1.0], (512, 512, 3)).astype(np.float32)
    write_image(codes, tmp_path / "ids.png", bits=8)
    monkeypatch.setattr(pictures, "MOST_BYTES", 1)
    (picture,) = file_pictures({"ids": tmp_path / "ids.png"}, codings={"ids": "id"})
    assert picture.width == 256
    assert set(np.unique(pixels_of(picture.uri)[..., :3])) == {0, 255}


def test_heights_of_float_files_are_scaled(tmp_path):
    heights = np.linspace(-0.3, 0.9, 64 * 64, dtype=np.float32).reshape(64, 64, 1)
    write_image(heights, tmp_path / "d.exr", bits=32)
    (picture,) = file_pictures({"d": tmp_path / "d.exr"}, codings={"d": "height"})
    settings = picture.settings()
    read = (pixels_of(picture.uri)[..., 0] / 255.0 - settings["mid"]) * settings["scale"]
    assert np.abs(read - heights[..., 0]).max() <= 0.5 * 1.2 / 255.0 + 1e-6


def test_missed_texels_are_red_and_the_rest_clear():
    missed = np.random.default_rng(2).random((20, 30)) < 0.2
    shown = pixels_of(miss_picture(missed))
    np.testing.assert_array_equal(shown[..., 3], np.where(missed, 255, 0))
    assert (shown[missed][:, 0] == 255).all()


@pytest.mark.parametrize("maps", [("normal",), ("displacement",), ("opacity", "normal")])
def test_what_a_page_adds_changes_nothing(pair, maps):
    options = BakeOptions(maps=maps, size=48, samples=4)
    alone = bake(*pair, options)
    shown = bake(*pair, page_options(options))
    assert set(shown.maps) == {*maps, "normal", "displacement"}
    asked = as_asked(shown, options)
    assert list(asked.maps) == list(maps) and asked.report.options == options
    for name in maps:
        np.testing.assert_array_equal(asked.maps[name].values, alone.maps[name].values)


def test_nothing_is_added_where_it_would_move_samples():
    for options in BakeOptions(samples="adaptive"), BakeOptions(time_budget="20s"):
        assert page_options(options) is options


def test_a_histogram_counts():
    values = np.repeat([0.0, 1.0, 2.0], [100, 300, 50])
    svg = histogram_svg(values, title="t", unit="u")
    heights = [
        float(x)
        for x in re.findall(r'<rect x="[^"]*" y="[^"]*" width="[^"]*" height="([^"]*)"', svg)
    ]
    assert len(heights) == 3
    np.testing.assert_allclose(np.array(heights) / heights[1], [1 / 3, 1.0, 1 / 6], atol=1e-3)
    assert ": 66.67 %" in svg and "median 1<" in svg


def test_a_histogram_of_little():
    assert histogram_svg(np.array([]), title="", unit="") == ""
    assert histogram_svg(np.array([np.nan, np.inf]), title="", unit="") == ""
    for value in 0.0, 3.0, -1e-12, 1e30:
        assert histogram_svg(np.full(9, value), title="", unit="").count("<rect") == 1
    next_to_one = np.array([1.0, np.nextafter(1.0, 2.0)])
    assert histogram_svg(next_to_one, title="", unit="").count("<rect") == 1


@given(st.floats(-1e6, 1e6), st.floats(1e-6, 1e6))
def test_ticks_are_few_round_and_inside(low, width):
    high = low + width
    found = ticks(low, high)
    assert len(found) <= 7
    if width > 1e-3 * abs(low):
        assert len(found) >= 2
        assert low - 1e-6 * width <= min(found) and max(found) <= high + 1e-6 * width
        steps = np.diff(found) / width
        np.testing.assert_allclose(steps, steps[0], rtol=1e-3)


def test_times_read_well():
    assert [duration(s) for s in (0.0123, 65.4, 812.0, 7560.0)] == [
        "12.3 ms", "65.4 s", "13.5 min", "2.1 h",
    ]  # fmt: skip
    assert memory(None) == "–"
