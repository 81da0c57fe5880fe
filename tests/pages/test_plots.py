"""Where the points of line plots lie, and that a file of one stands alone."""

import xml.etree.ElementTree as ET

import pytest

from texbake.pages.plots import LineFrame, line_plots_svg, write_svg

SVG = "{http://www.w3.org/2000/svg}"
FRAMES = [
    LineFrame("one", "x of one", {"a": [(0, 0.0), (10, 20.0)], "<b>": [(0, 10.0), (10, 5.0)]}),
    LineFrame("two", "x of two", {"a": [(0, 5.0), (10, 0.0)], "<b>": [(0, 0.0), (10, 1.0)]}),
]


@pytest.fixture
def picture(tmp_path):
    path = tmp_path / "plot.svg"
    write_svg(line_plots_svg(FRAMES, title="t", y_label="y", x_step=5.0), path)
    return ET.parse(path).getroot()


def points(picture):
    return [
        [tuple(map(float, point.split(","))) for point in line.get("points").split()]
        for line in picture.iter(f"{SVG}polyline")
    ]


def test_lines_share_a_scale_from_zero(picture):
    (left, base), (right, top) = points(picture)[0]
    assert left < right
    # 20 is the top of the frame, 0 its bottom.
    assert points(picture)[1] == [(left, (base + top) / 2), (right, base + (top - base) / 4)]
    (other_left, height), (_, bottom) = points(picture)[2]
    assert height == base + (top - base) / 4
    assert bottom == base
    assert other_left > right


def test_axes_are_labelled(picture):
    texts = [text.text for text in picture.iter(f"{SVG}text")]
    assert texts[:3] == ["a", "<b>", "y"]
    assert texts.count("0°") == texts.count("5°") == texts.count("10°") == 2
    assert {"one", "two", "x of one", "x of two", "20"} <= set(texts)


def test_equal_values_of_zero_are_drawn_at_the_bottom(tmp_path):
    frame = LineFrame("none", "x", {"a": [(0, 0.0), (1, 0.0)]})
    write_svg(line_plots_svg([frame], title="t", y_label="y", x_step=1.0), tmp_path / "p.svg")
    (line,) = points(ET.parse(tmp_path / "p.svg").getroot())
    assert line[0][1] == line[1][1]
