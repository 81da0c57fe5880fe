"""The page of a layout: the texture and the mesh show the same charts, seams and stretch."""

import numpy as np
import pytest

from texbake import Mesh, unwrap, write_mesh
from texbake.mapping.unwrap import unwrap_with_report
from texbake.mesh.shapes import uv_sphere
from texbake.pages.layout_page import write_layout_page
from texbake.verbs.unwrap import unwrap_files

READY = "document.querySelector('#view').dataset.state === 'ready'"
FLAT, SOLID = "#flat canvas", "#solid canvas"


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    path = tmp_path_factory.mktemp("layout") / "page.html"
    mesh = unwrap(uv_sphere(12, 24).replace(name="<ball>"), size=256)
    write_layout_page(path, mesh, 256, figures=[("charts", "many")])
    return path


def differs(one, other):
    return (np.abs(one.astype(int) - other) > 8).any(axis=2).mean()


def test_a_chart_that_is_pointed_at_is_shown_in_both_pictures(browser, page):
    browser.open(page)
    browser.wait(READY)
    flat, solid = browser.picture(FLAT), browser.picture(SOLID)
    browser.value("document.querySelector('tr[data-chart]').dispatchEvent(new Event('focus'))")
    chosen = browser.picture_with(FLAT, lambda picture: differs(picture, flat) > 0.1)
    assert differs(browser.picture(SOLID), solid) > 0.1
    assert browser.value("document.querySelector('.readout').textContent").startswith("Chart ")
    # What became redder lies in the chart: pointing there shows the same one.
    places = np.argwhere((chosen.astype(int) - flat)[..., 0] > 0)
    y, x = places[len(places) // 2]
    left, top = browser.value(
        f"(() => {{ const b = document.querySelector('{FLAT}').getBoundingClientRect();"
        "return [b.x, b.y]; })()"
    )
    words = browser.value("document.querySelector('.readout').textContent")
    row = "document.querySelector('tr[data-chart]')"
    browser.value(f"{row}.dispatchEvent(new PointerEvent('pointerleave'))")
    assert browser.value("document.querySelector('.readout').textContent") == ""
    browser.call("Input.dispatchMouseEvent", type="mouseMoved", x=left + int(x), y=top + int(y))
    assert browser.value("document.querySelector('.readout').textContent") == words
    assert browser.complaints() == []


def test_stretch_checker_and_seams_can_be_chosen(browser, page):
    browser.open(page)
    browser.wait(READY)
    legend = "document.querySelector('.when-stretch').hidden"
    last = browser.picture(FLAT)
    for color in "stretch", "checker":
        browser.set(f"[name=color][value={color}]", True)
        last = browser.picture_with(FLAT, lambda shown, old=last: differs(shown, old) > 0.1)
        assert browser.value(legend) is (color == "checker")
    browser.set("[name=seams]", False)
    browser.picture_with(FLAT, lambda picture: 0.0 < differs(picture, last) < 0.1)
    assert browser.complaints() == []


def test_in_a_narrow_window_the_pictures_lie_below_each_other(browser, page):
    browser.open(page, width=390, height=800)
    browser.wait(READY)
    assert browser.value("document.documentElement.scrollWidth") <= 390
    flat, solid = (
        browser.value(f"document.querySelector('{name}').getBoundingClientRect().y")
        for name in (FLAT, SOLID)
    )
    assert solid > flat + 200
    assert "&lt;ball&gt;" in page.read_text(encoding="utf-8")


@pytest.mark.parametrize("symmetry", ["auto", "overlap"])
@pytest.mark.parametrize("turned", [False, True])
def test_the_table_has_the_charts_of_the_figures(tmp_path, symmetry, turned):
    ball = uv_sphere(12, 24).replace(uvs=None, uv_faces=None)
    if turned:  # so that the other half comes first
        ball = ball.replace(faces=ball.faces[::-1])
    mesh, report = unwrap_with_report(ball, symmetry=symmetry)
    write_layout_page(tmp_path / "page.html", mesh, shares=symmetry == "overlap")
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert f"in {report.n_charts} charts" in page
    assert page.count("<tr data-chart") == report.n_charts
    assert ">inf<" not in page


def test_shares_are_those_of_the_whole_surface_where_the_table_leaves_out_charts(tmp_path):
    row = np.arange(500)
    corners = np.stack([row, row + 0.5, row], axis=1).reshape(-1) / 500
    uvs = np.column_stack([corners, np.tile([0.0, 0.0, 1.0], 500)])
    mesh = Mesh(
        positions=np.column_stack([uvs, np.zeros(1500)]),
        faces=np.arange(1500).reshape(-1, 3),
        uvs=uvs,
        uv_faces=np.arange(1500).reshape(-1, 3),
    )
    write_layout_page(tmp_path / "page.html", mesh)
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "The 200 largest." in page
    assert page.count("<td>0.2 %</td>") == 200


def test_unwrap_writes_the_page(tmp_path):
    write_mesh(uv_sphere(6, 8), tmp_path / "ball.obj")
    made = unwrap_files(
        tmp_path / "ball.obj", tmp_path / "uv.obj", html=tmp_path / "page.html", threads=1
    )
    assert tmp_path / "page.html" in made.files
    assert "symmetric Dirichlet energy" in (tmp_path / "page.html").read_text(encoding="utf-8")
