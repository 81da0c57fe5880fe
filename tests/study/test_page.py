"""The page and the files: complete, and without a request to anywhere."""

import importlib.util
import re
from html.parser import HTMLParser

import numpy as np
import pytest

from texbake.errors import DependencyError
from texbake.pages.page import duration, memory, number
from texbake.pages.pictures import png_of
from texbake.study import plots
from texbake.study.findings import findings
from texbake.study.labels import place_labels
from texbake.study.options import KNOB_NAMES
from texbake.study.write import write_study

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
def written(quick_study, tmp_path_factory):
    folder = tmp_path_factory.mktemp("study") / "new" / "folder"
    return write_study(quick_study, folder)


@pytest.fixture(scope="module")
def page(written):
    return written[0].read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def outline(page):
    found = Outline()
    found.feed(page)
    return found


def test_all_files_are_there(written):
    names = {path.name for path in written}
    assert names == {
        "study.html", "study.json", "study.csv", "contact_sheet.png", "all.png",
        *(f"{name}.png" for name in KNOB_NAMES),
    }  # fmt: skip
    assert {path.name for path in written[0].parent.iterdir()} == names
    for path in written:
        if path.suffix == ".png":
            assert path.read_bytes().startswith(b"\x89PNG")


def test_the_page_asks_for_nothing(page, outline):
    words = re.sub(r"base64,[A-Za-z0-9+/=]+", "", page)
    assert not re.search(r"https?:|//[a-z]|@import|<script|<link|<iframe|<object", words)
    assert set(re.findall(r"url\((.)", words)) <= {"#"}
    assert all(value.startswith("data:image/png;base64,") for value in outline.requests)


def test_the_page_is_whole(outline):
    assert outline.unclosed == [] and outline.open == []
    assert len(set(outline.ids)) == len(outline.ids)
    assert {link[1:] for link in outline.links} <= set(outline.ids)


def test_the_page_tells_every_knob_and_every_setting(quick_study, outline):
    text = " ".join(" ".join(outline.text).split())
    for result in quick_study.knobs:
        assert result.knob.name in outline.ids
        assert result.knob.title in text
        assert result.truth_text in text
        for item in result.measurements:
            assert item.setting.label in text
        for sentence in findings(result):
            assert sentence in text


def test_the_page_has_a_crop_for_each_setting(quick_study, outline):
    n_crops = sum(
        item.outcome.picture is not None
        for result in quick_study.knobs
        for item in result.measurements
    )
    assert len(outline.requests) == n_crops > 2 * len(KNOB_NAMES)


def test_every_point_of_a_plot_is_labelled(quick_study):
    for result in quick_study.knobs[:3]:
        svg = plots.knob_plot(result).svg
        for item in result.measurements:
            assert f">{item.setting.label}</text>" in svg


def test_without_matplotlib_one_line_says_what_to_install(monkeypatch, quick_study, tmp_path):
    monkeypatch.setattr(plots, "find_spec", lambda name: None)
    with pytest.raises(DependencyError, match=r"texbake\[study\]"):
        write_study(quick_study, tmp_path / "never")
    assert not (tmp_path / "never").exists()
    assert importlib.util.find_spec("matplotlib") is not None


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


def test_numbers_read_well():
    assert [number(x) for x in (0.5, 12.0, 1000.0, 0.000123)] == ["0.5", "12", "1,000", "0.000123"]
    assert (duration(0.0123), duration(65.4)) == ("12.3 ms", "65.4 s")
    assert (memory(None), memory(12_300_000), memory(2_500_000_000)) == ("–", "12.3 MB", "2.5 GB")


def test_crops_are_written_as_a_screen_shows_them():
    assert png_of(np.ones((2, 2, 3), np.float32)) != png_of(np.zeros((2, 2, 3), np.float32))
