"""The overview of a build, in a browser: sorted and filtered."""

import io
import re

import numpy as np
import pytest
from PIL import Image

from texbake.pages import build_page
from texbake.pages.build_page import BuildRow, thumbnail, write_build_page
from texbake.texture.image import write_image

READY = "document.querySelector('#assets').dataset.state === 'ready'"
SHOWN = (
    "[...document.querySelectorAll('tbody tr:not([hidden])')]"
    ".map(row => row.querySelector('b').textContent)"
)
COLUMNS = {
    "error": "error_deg", "misses": "miss_percent", "time": "seconds", "faces": "n_faces",
    "size": "n_bytes",
}  # fmt: skip


def rows_of(n_rows):
    rng = np.random.default_rng(n_rows)
    picture = thumbnail(rng.random((96, 128, 3), np.float32))
    rows = []
    for k in range(n_rows):
        status = ("built", "built", "built", "kept", "failed", "skipped")[rng.integers(6)]
        is_there = status in ("built", "kept")
        rows.append(
            BuildRow(
                name=f"props/{('crate', 'Barrel', 'über')[k % 3]}_{k}",
                status=status,
                message="" if is_there else "low.obj: it has no <uvs>; make some",
                page=f"pages/a b#{k}.html" if is_there else None,
                thumbnail=picture if is_there else None,
                error_deg=float(rng.random() * 9) if is_there else None,
                miss_percent=float(rng.integers(3)) if is_there else None,
                seconds=float(rng.random() * 300) if status == "built" else None,
                n_faces=int(rng.integers(500, 20_000)) if is_there else None,
                n_bytes=int(rng.integers(10**5, 10**7)) if is_there else None,
            )
        )
    return rows


@pytest.fixture(scope="module")
def rows():
    return rows_of(60)


@pytest.fixture(scope="module")
def overview(rows, tmp_path_factory):
    path = tmp_path_factory.mktemp("build") / "build.html"
    write_build_page(path, rows, title="Nightly <props>", command="texbake build p", seconds=812.0)
    return path


def expected(rows, field, *, falls):
    """Unknown values last, equal ones as they were."""
    there = [row for row in rows if getattr(row, field) is not None]
    there.sort(key=lambda row: -getattr(row, field) if falls else getattr(row, field))
    return [row.name for row in there + [r for r in rows if getattr(r, field) is None]]


@pytest.mark.parametrize("width", [1280, 390])
@pytest.mark.parametrize("dark", [False, True])
def test_it_shows_every_asset_and_asks_for_nothing(browser, overview, rows, width, dark):
    browser.open(overview, width=width, dark=dark)
    browser.wait(READY)
    assert browser.value(SHOWN) == [row.name for row in rows]
    text = browser.value("document.body.textContent")
    assert "Nightly <props>" in text and "13.5 min" in text and "no <uvs>" in text
    assert browser.value("document.documentElement.scrollWidth") == width
    browser.wait("document.querySelector('.named img').complete")
    shown = browser.value("document.querySelector('.named img').naturalWidth")
    assert shown == build_page.THUMBNAIL_PX
    assert browser.complaints() == []


@pytest.mark.parametrize("column", COLUMNS)
def test_columns_sort_both_ways(browser, overview, rows, column):
    browser.open(overview)
    browser.wait(READY)
    button = f"document.querySelector('[data-column={column}]')"
    for falls, word in (True, "descending"), (False, "ascending"):
        browser.value(f"{button}.click()")
        assert browser.value(SHOWN) == expected(rows, COLUMNS[column], falls=falls)
        assert browser.value(f"{button}.parentNode.ariaSort") == word
    assert browser.value("document.querySelectorAll('[aria-sort]').length") == 1


def test_names_sort_as_people_do_and_failures_come_first(browser, overview, rows):
    browser.open(overview)
    browser.wait(READY)
    browser.value("document.querySelector('[data-column=name]').click()")

    def key(row):
        word, number = row.name.lower().replace("ü", "u").rsplit("_", 1)
        return word, int(number)

    assert browser.value(SHOWN) == [row.name for row in sorted(rows, key=key)]
    browser.value("document.querySelector('[data-column=status]').click()")
    shown = browser.value("[...document.querySelectorAll('tbody tr')].map(row => row.className)")
    assert shown == sorted(shown, key=["failed", "skipped", "built", "kept"].index)


def test_a_phone_sorts_by_a_list(browser, overview, rows):
    browser.open(overview, width=390)
    browser.wait(READY)
    assert browser.value("document.querySelector('[name=order]').checkVisibility()")
    browser.set("[name=order]", "error")
    assert browser.value(SHOWN) == expected(rows, "error_deg", falls=True)
    browser.set("[name=order]", "")
    assert browser.value(SHOWN) == [row.name for row in rows]


def test_rows_are_found_by_name_message_and_status(browser, overview, rows):
    browser.open(overview)
    browser.wait(READY)
    browser.set("[name=find]", "BARREL")
    assert browser.value(SHOWN) == [row.name for row in rows if "Barrel" in row.name]
    browser.set("[name=shown]", "failed")
    wanted = [row.name for row in rows if "Barrel" in row.name and row.status == "failed"]
    assert browser.value(SHOWN) == wanted
    assert browser.value("document.querySelector('.count').textContent") == f"{len(wanted)} of 60"
    browser.set("[name=find]", "no <uvs>")
    assert browser.value(SHOWN) == [row.name for row in rows if row.status == "failed"]


def test_links_lead_to_the_pages_of_assets(overview, rows):
    found = re.findall(r'<a href="([^"]*)"', overview.read_text(encoding="utf-8"))
    assert found == [
        row.page.replace(" ", "%20").replace("#", "%23") for row in rows if row.page is not None
    ]


def test_two_thousand_assets(browser, tmp_path):
    rows = rows_of(2000)
    write_build_page(tmp_path / "many.html", rows)
    assert (tmp_path / "many.html").stat().st_size < 15_000_000
    browser.open(tmp_path / "many.html")
    browser.wait(READY)
    browser.value("document.querySelector('[data-column=error]').click()")
    assert browser.value(SHOWN) == expected(rows, "error_deg", falls=True)
    assert browser.complaints() == []


def test_thumbnails_are_small_squares(tmp_path):
    wide = np.zeros((100, 300, 3), np.float32)
    wide[:, 100:200] = 1.0  # the middle is white, the rest would be black
    write_image(wide, tmp_path / "wide.png", color=True)
    for source in wide, tmp_path / "wide.png", str(tmp_path / "wide.png"):
        data = thumbnail(source)
        picture = Image.open(io.BytesIO(data))
        assert picture.size == (build_page.THUMBNAIL_PX,) * 2
        assert np.asarray(picture).min() > 245
        assert len(data) < 4000


def test_too_many_thumbnails_leave_the_worst(monkeypatch, tmp_path):
    picture = thumbnail(np.zeros((8, 8, 3), np.float32))
    monkeypatch.setattr(build_page, "MOST_THUMBNAIL_BYTES", 2 * len(picture))
    rows = [
        BuildRow(name="good", thumbnail=picture, error_deg=0.1),
        BuildRow(name="bad", thumbnail=picture, error_deg=5.0),
        BuildRow(name="broken", status="failed", thumbnail=picture),
    ]
    write_build_page(tmp_path / "b.html", rows)
    text = (tmp_path / "b.html").read_text(encoding="utf-8")
    shown = [bool("<img" in line) for line in re.findall(r"<tr class=.*?</tr>", text, re.DOTALL)]
    assert shown == [False, True, True]
    assert "pictures of the best 1 are left out" in text


def test_a_build_of_nothing(browser, tmp_path):
    write_build_page(tmp_path / "none.html", [])
    browser.open(tmp_path / "none.html")
    browser.wait(READY)
    assert browser.value(SHOWN) == []
    assert "0 assets" in browser.value("document.body.innerText")
    assert browser.complaints() == []
