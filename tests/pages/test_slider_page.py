"""The page of two versions of a model, in a browser."""

import math

import numpy as np
import pytest

from texbake.pages.picture_pages import write_slider_page
from texbake.rendering.compare_models import ModelComparison

READY = "document.querySelector('#compare').dataset.state === 'ready'"
RED, BLUE, WHITE = (np.full((40, 60, 3), color, np.uint8) for color in (
    (200, 0, 0), (0, 0, 200), (255, 255, 255)
))  # fmt: skip


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """Three views, of which the second is the worst: red before, blue after."""
    path = tmp_path_factory.mktemp("page") / "slider.html"
    comparison = ModelComparison(
        psnr_db=(30.0, 8.5, math.inf), mean_db=12.25,
        views=((0.0, 0.0), (120.0, 10.0), (240.0, -10.0)), before=(RED, RED, WHITE),
        after=(BLUE, BLUE, WHITE), names=("<before>.glb", "after.glb"), n_faces=(1000, 100),
    )  # fmt: skip
    write_slider_page(
        path, comparison, n_bytes=(5_000_000, 400_000), figures=[("materials", "3 to 1")],
        warnings=["an image is missing"], command="texbake lighten 'a b.glb' -o after.glb",
    )  # fmt: skip
    return path


@pytest.fixture
def opened(browser, page):
    browser.open(page)
    browser.wait(READY)
    return browser


def shares(browser):
    picture = browser.picture("#compare .stage").astype(int)
    red = (picture[..., 0] > 150) & (picture[..., 2] < 60)
    blue = (picture[..., 2] > 150) & (picture[..., 0] < 60)
    return float(red.mean()), float(blue.mean())


@pytest.mark.parametrize("width", [1280, 390])
@pytest.mark.parametrize("dark", [False, True])
def test_it_shows_everything_and_asks_for_nothing(browser, page, width, dark):
    browser.open(page, width=width, dark=dark)
    browser.wait(READY)
    text = browser.value("document.querySelector('main').innerText")
    for words in (
        "<before>.glb", "1,000", "5.00 MB", "0.40 MB", "8.0 %", "12.2 dB", "8.5 dB", "equal",
        "3 to 1", "an image is missing", "texbake lighten 'a b.glb'",
    ):  # fmt: skip
        assert words in text, words
    assert browser.complaints() == []
    assert browser.value("document.documentElement.scrollWidth") == width


def test_the_slider_moves_the_border(opened):
    for value, red in (1000, 1.0), (500, 0.5), (0, 0.0):
        opened.set("[name=wipe]", value)
        found = shares(opened)
        # The border, its handle and the names lie over the pictures.
        assert found == pytest.approx((red, 1.0 - red), abs=0.09)


def test_the_border_can_be_dragged(opened):
    x, y, width = opened.value(
        "(() => { const s = document.querySelector('#compare .stage');"
        "s.scrollIntoView({block: 'center'}); const b = s.getBoundingClientRect();"
        "return [b.x, b.y + b.height / 3, b.width]; })()"
    )
    for kind, at in ("mousePressed", 0.5), ("mouseMoved", 0.25), ("mouseReleased", 0.25):
        opened.call(
            "Input.dispatchMouseEvent", type=kind, x=x + at * width, y=y, button="left",
            buttons=1, clickCount=1,
        )  # fmt: skip
    opened.settle()
    assert float(opened.value("document.querySelector('[name=wipe]').value")) == pytest.approx(
        250, abs=5
    )


def test_the_worst_view_is_first_and_others_can_be_chosen(opened):
    caption = "document.querySelector('#compare .caption').textContent"
    assert opened.value(caption) == "View 2: 8.5 dB"
    opened.set("[name=view][value='2']", True)
    assert (opened.value(caption), shares(opened)) == ("View 3: equal", (0.0, 0.0))
    shape = opened.value(
        "(() => { const b = document.querySelector('#compare .stage').getBoundingClientRect();"
        "return b.width / b.height; })()"
    )
    assert shape == pytest.approx(1.5, abs=0.01)
