"""The page of an asset, in a browser: it draws, answers, and asks for nothing."""

import base64
import io
import re
import time
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from texbake import BakeOptions, Mesh, bake, write_image
from texbake.mesh.shapes import plane, uv_sphere
from texbake.pages import viewer
from texbake.pages.asset_page import AssetPage, write_asset_page
from texbake.rendering.panels import color_angles
from texbake.texture.encoding import encode_srgb

pytestmark = pytest.mark.usefixtures("small_pictures")

READY = "document.querySelector('#view').dataset.state === 'ready'"
MAPS_READY = "document.querySelector('#maps').dataset.state === 'ready'"
VIEW, MAP = "#view canvas", "#maps canvas"
BACKGROUND = np.array([0x26, 0x29, 0x2D])


@pytest.fixture
def opened(browser, page):
    browser.open(page)
    browser.wait(f"{READY} && {MAPS_READY}")
    return browser


def page_of(pair, result):
    return AssetPage(high=pair[0], low=pair[1], baked=result)


def differing(a, b):
    """(H, W) bool: pixels that are not nearly equal."""
    return (np.abs(a.astype(int) - b) > 12).any(axis=2)


def canvas_alone(browser):
    """The view without what lies over it."""
    browser.value(
        "for (const part of document.querySelectorAll('#view .tag, #view .divider'))"
        " part.style.visibility = 'hidden'"
    )
    return browser.picture(VIEW)


@pytest.mark.parametrize("width", [1280, 390])
@pytest.mark.parametrize("dark", [False, True])
def test_it_draws_and_asks_for_nothing(browser, page, width, dark):
    browser.open(page, width=width, dark=dark)
    browser.wait(f"{READY} && {MAPS_READY}")
    drawn = differing(canvas_alone(browser), BACKGROUND)
    assert 0.08 < drawn.mean() < 0.9  # a sphere, neither nothing nor everything
    middle = drawn[drawn.shape[0] // 2, drawn.shape[1] // 2]
    assert middle and not drawn[20, 20]  # past the round corner
    assert not shows_a_still(browser)
    assert browser.complaints() == []
    # Nothing is wider than the window, and what is pressed is large enough to be.
    assert browser.value("document.documentElement.scrollWidth") == width
    if width == 390:
        heights = "[...document.querySelectorAll('button, select')].map(e => e.offsetHeight)"
        assert min(browser.value(heights)) >= 32


def test_the_slider_moves_the_border_between_the_meshes(opened):
    opened.set("[name=left][value=low]", True)
    pictures = {}
    for share in 0, 500, 1000:
        opened.set("[name=wipe]", share)
        pictures[share] = canvas_alone(opened)
    half = pictures[0].shape[1] // 2
    assert differing(pictures[0], pictures[1000]).mean() > 0.03
    # In the middle each side is just what it is when it has all of the view.
    assert not differing(pictures[500][:, : half - 2], pictures[1000][:, : half - 2]).any()
    assert not differing(pictures[500][:, half + 2 :], pictures[0][:, half + 2 :]).any()


def test_the_border_can_be_dragged(opened):
    box = opened.value(
        "(() => { const b = document.querySelector('.divider').getBoundingClientRect();"
        "return [b.x + b.width / 2, b.y + b.height / 2]; })()"
    )
    for kind, x in ("mousePressed", 0), ("mouseMoved", 150), ("mouseReleased", 150):
        opened.call(
            "Input.dispatchMouseEvent", type=kind, x=box[0] + x, y=box[1], button="left",
            buttons=1, clickCount=1,
        )  # fmt: skip
    opened.settle()
    wide = opened.value("document.querySelector('#view canvas').clientWidth")
    moved = float(opened.value("document.querySelector('[name=wipe]').value"))
    assert moved == pytest.approx(500 + 1000 * 150 / wide, abs=3)


def test_lighting_surface_wireframe_and_misses_show(opened):
    opened.set("[name=wipe]", 0)
    last = canvas_alone(opened)
    for control, value in (
        ("[name=light]", 90),
        ("[name=wire]", True),
        ("#view [name=missed]", True),
        ("[name=surface]", "normals"),
        ("[name=surface]", "displacement"),
        ("[name=up]", "z"),
    ):
        opened.set(control, value)
        shown = canvas_alone(opened)
        assert differing(shown, last).mean() > 0.002, control
        last = shown
    assert (differing(last, [255, 31, 61]).mean() < 1.0) and opened.complaints() == []


def test_the_view_answers_to_the_keyboard_and_goes_back(opened):
    opened.value("document.querySelector('#view canvas').focus()")
    opened.press("Home")  # from the first key on, a ring shows what has the focus
    first = canvas_alone(opened)
    for key in "ArrowRight", "ArrowUp", "+":
        before = canvas_alone(opened)
        opened.press(key)
        assert differing(canvas_alone(opened), before).any(), key
    opened.press("Home")
    assert not differing(canvas_alone(opened), first).any()


def test_every_control_has_a_name_and_is_reached(opened):
    nameless = opened.value(
        "[...document.querySelectorAll('button, input, select, canvas')].filter(e => "
        "!(e.ariaLabel || e.textContent.trim() || (e.labels && e.labels.length))).length"
    )
    assert nameless == 0
    reached = "[...document.querySelectorAll('canvas, input, button, select')]"
    assert opened.value(f"{reached}.every(e => e.tabIndex === 0)")


def test_equal_meshes_have_no_error(browser, tmp_path):
    """Every normal of the high-poly mesh comes back through tangents, map and texture."""
    mesh = uv_sphere(24, 32)
    result = bake(mesh, mesh, BakeOptions(size=256, maps=("normal",)))
    write_asset_page(tmp_path / "same.html", page_of((mesh, mesh), result))
    browser.open(tmp_path / "same.html")
    browser.wait(READY)
    browser.set("[name=right][value=error]", True)
    browser.set("[name=wipe]", 0)
    shown = canvas_alone(browser)
    seen = differing(shown, BACKGROUND)
    assert seen.mean() > 0.1
    # 8 bits leave 0.4 degrees at most; 1 degree and a half of the scale's 30 is hardly blue.
    limit = encode_srgb(color_angles(np.full((1, 1), 1.5, np.float32)))[0, 0] * 255.0
    inside = shown[seen]
    assert np.percentile(inside.max(axis=1), 99) <= limit.max() + 1.0


def test_the_error_is_the_angle(browser, tmp_path):
    """A plane whose map says 20 degrees, held against a flat one."""
    low = plane(1, 1)
    angle = np.radians(20.0)
    normals = np.zeros((64, 64, 3), np.float32)
    normals[...] = (0.5 + 0.5 * np.sin(angle), 0.5, 0.5 + 0.5 * np.cos(angle))
    write_image(normals, tmp_path / "n.png", bits=8)
    write_asset_page(
        tmp_path / "p.html", AssetPage(high=low, low=low, files={"normal": tmp_path / "n.png"})
    )
    browser.open(tmp_path / "p.html")
    browser.wait(READY)
    browser.set("[name=right][value=error]", True)
    browser.set("[name=wipe]", 0)
    shown = canvas_alone(browser)
    middle = shown[shown.shape[0] // 2, shown.shape[1] // 2].astype(float)
    expected = encode_srgb(color_angles(np.full((1, 1), 20.0, np.float32)))[0, 0] * 255.0
    # The scale has 24 colors, between which the page interpolates.
    np.testing.assert_allclose(middle, expected, atol=8.0)


def test_green_down_and_green_up_look_the_same(browser, pair, tmp_path):
    shown = []
    for convention in "opengl", "directx":
        result = bake(*pair, BakeOptions(size=96, convention=convention, maps=("normal",)))
        write_asset_page(tmp_path / "c.html", page_of(pair, result))
        browser.open(tmp_path / "c.html")
        browser.wait(READY)
        browser.set("[name=wipe]", 0)
        shown.append(canvas_alone(browser))
    assert differing(*shown).mean() < 1e-3  # but for the rounding of 128 on the other side


def test_object_space_and_tangent_space_look_the_same(browser, pair, tmp_path):
    shown = []
    for space in "tangent", "object":
        result = bake(*pair, BakeOptions(size=512, space=space, maps=("normal",)))
        write_asset_page(tmp_path / "s.html", page_of(pair, result))
        browser.open(tmp_path / "s.html")
        browser.wait(READY)
        browser.set("[name=wipe]", 0)
        shown.append(canvas_alone(browser))
    # Seams differ: tangents do not go on across them, and mip levels mix what lies beside a chart.
    assert differing(*shown).mean() < 0.01


def test_the_map_is_shown_to_the_texel(opened, page):
    text = page.read_text(encoding="utf-8")
    data = re.search(r'id="map-0"[^>]*base64,([^"]*)"', text)[1]
    codes = np.asarray(Image.open(io.BytesIO(base64.b64decode(data))).convert("RGB"))
    opened.value("document.querySelector('#maps canvas').focus()")

    def is_to_the_texel(shown):
        top, left = (shown.shape[0] - 96) // 2, (shown.shape[1] - 96) // 2
        return np.array_equal(shown[top : top + 96, left : left + 96], codes)

    opened.press("1")
    shown = opened.picture_with(MAP, is_to_the_texel)
    assert "texel 48, 48" in opened.value("document.querySelector('.readout').textContent")
    for _ in range(14):
        opened.press("+")
    near = opened.picture(MAP)
    # A texel is a square of one color, with lines of the grid between.
    assert len(np.unique(near.reshape(-1, 3), axis=0)) < 0.02 * near.shape[0] * near.shape[1]
    opened.press("0")
    assert differing(opened.picture(MAP), shown).any()


def test_pictures_come_back_after_the_graphics_process_died(opened):
    before = {selector: opened.picture(selector) for selector in (VIEW, MAP)}
    opened.value(
        "window.restored = new Set(); for (const canvas of document.querySelectorAll('canvas'))"
        "for (const event of ['contextrestored', 'webglcontextrestored'])"
        "canvas.addEventListener(event, () => window.restored.add(canvas))"
    )
    opened.call("Browser.crashGpuProcess")
    opened.wait("window.restored.size === document.querySelectorAll('canvas').length")
    time.sleep(1)  # until then the old picture may still stand there
    for selector, picture in before.items():
        assert not differing(opened.picture(selector), picture).any()


def test_a_canvas_hidden_for_a_moment_keeps_its_zoom(opened):
    opened.value("document.querySelector('#maps [name=one]').click()")
    before = opened.picture(MAP)
    for shown in "none", "":
        opened.value(f"document.querySelector('#maps .stage').style.display = '{shown}'")
        opened.settle()
    assert not differing(opened.picture(MAP), before).any()


def test_maps_change_places_and_lines_come_over_them(opened, baked):
    normal = opened.picture(MAP)
    opened.set("[name=map][value='1']", True)
    displacement = opened.picture(MAP)
    assert differing(normal, displacement).mean() > 0.1
    caption = "document.querySelector('#maps .caption').textContent"
    assert "Made for this page" in opened.value(caption)
    opened.set("[name=layout]", True)
    layout = opened.picture(MAP)
    assert 0.01 < differing(layout, displacement).mean() < 0.5
    opened.set("[name=layout]", False)
    opened.set("#maps [name=missed]", True)
    over = opened.picture(MAP)
    red = ~differing(over, [255, 30, 60])
    side = 0.98 * over.shape[0] / 96
    assert red.sum() / side**2 == pytest.approx(np.count_nonzero(baked.missed), rel=0.1)
    opened.value("document.querySelector('#maps [name=next]').click()")
    assert "missed" in opened.value("document.querySelector('.readout').textContent")
    assert opened.complaints() == []


def test_the_page_shows_what_was_measured(opened, baked):
    text = opened.value("document.body.innerText")
    for label, figure in baked.report.table():
        stage = label.startswith("  ") or label == "total"
        assert stage or (label in text and figure in text)
    for stage in baked.report.stages:
        assert stage.name in text
    assert baked.report.warnings[0] in text
    assert opened.value("document.querySelector('#command').textContent") == "texbake bake 'a b' c"
    assert opened.value("document.querySelectorAll('.histogram rect').length") > 20
    opened.value("document.querySelector('[data-copies]').click()")
    opened.wait("document.querySelector('[data-copies]').textContent === 'Copied'")


def test_files_have_the_histogram_of_their_bake(pair, tmp_path):
    options = BakeOptions(maps=("displacement",), size=(48, 24), front=0.05, back=0.03)
    result = bake(*pair, options)
    assert result.missed.any()
    heights, misses = tmp_path / "d.exr", tmp_path / "m.png"
    result.maps["displacement"].write(heights, bits=32)
    write_image(result.miss_map(), misses)
    files = replace(page_of(pair, None), files={"displacement": heights}, misses=misses)
    for name, page in ("a", page_of(pair, result)), ("b", files):
        write_asset_page(tmp_path / name, page)
    found = [
        re.findall(r"<rect.*?</rect>", (tmp_path / name).read_text("utf-8"), re.DOTALL)
        for name in ("a", "b")
    ]
    assert found[0] == found[1] != []


def shows_a_still(browser):
    """Whether the stage shows a picture of the mesh, over more than half of its height."""
    box, pixels = browser.value(
        "(() => { const i = document.querySelector('#view .still');"
        " return [[i.checkVisibility(), i.clientHeight,"
        " document.querySelector('#view .stage').clientHeight], i.naturalWidth]; })()"
    )
    return box[0] and box[1] > 0.5 * box[2] and pixels > 100


def test_without_scripts_there_is_a_picture_and_a_sentence(browser, page):
    browser.call("Emulation.setScriptExecutionDisabled", value=True)
    try:
        browser.open(page)
        assert shows_a_still(browser)
        assert "Scripts are off" in browser.value("document.body.innerText")
    finally:
        browser.call("Emulation.setScriptExecutionDisabled", value=False)


def test_without_webgl_the_rest_is_there(browser, page):
    script = (
        "const get = HTMLCanvasElement.prototype.getContext;"
        "HTMLCanvasElement.prototype.getContext = function (kind, ...more) {"
        " return kind.includes('webgl') ? null : get.call(this, kind, ...more); };"
    )
    added = browser.call("Page.addScriptToEvaluateOnNewDocument", source=script)
    try:
        browser.open(page)
        browser.wait(f"document.querySelector('#view').dataset.state === 'failed' && {MAPS_READY}")
        assert browser.value("document.querySelector('.failure').checkVisibility()")
        assert "cannot show the 3D view" in browser.value("document.body.innerText")
        assert shows_a_still(browser)
        assert not browser.value("document.querySelector('#view .controls').checkVisibility()")
    finally:
        browser.call("Page.removeScriptToEvaluateOnNewDocument", identifier=added["identifier"])


def test_a_large_mesh_is_simplified_and_the_page_says_so(browser, pair, monkeypatch, tmp_path):
    monkeypatch.setattr(viewer, "MOST_TRIANGLES", 500)
    high, low = pair
    write_asset_page(tmp_path / "l.html", AssetPage(high=high, low=low))
    browser.open(tmp_path / "l.html")
    browser.wait(READY)
    shown = browser.value("texbake.mesh('mesh-high').then(m => m.index.length / 3)")
    assert 100 < shown <= 500
    text = browser.value("document.querySelector('#view').innerText")
    assert f"The high-poly mesh is shown with {shown} of its {high.n_faces:,} triangles." in text


def test_names_cannot_break_the_page(browser, tmp_path):
    name = '</script><img src=x onerror="document.title=1">&".obj'
    mesh = plane(2, 2).replace(name=name)
    low = Mesh(positions=mesh.positions, faces=mesh.faces, name=name)
    write_asset_page(
        tmp_path / "odd ü.html", AssetPage(high=mesh, low=low, command=name, warnings=[name])
    )
    browser.open(tmp_path / "odd ü.html")
    browser.wait(READY)
    assert browser.value("document.querySelector('h1').textContent") == name
    assert browser.value("document.title").startswith(name[:9])
    assert browser.value("document.querySelector('#maps')") is None
    assert browser.complaints() == []


def test_a_page_is_the_same_each_time(pair, baked, tmp_path):
    pages = [tmp_path / "a.html", tmp_path / "b.html"]
    for path in pages:
        write_asset_page(path, page_of(pair, baked))
    assert pages[0].read_bytes() == pages[1].read_bytes()
