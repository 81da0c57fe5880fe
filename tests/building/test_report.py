"""The page of a build: what it shows of each asset, and links that lead to files."""

import html.parser
from urllib.parse import unquote

from texbake.building.report import write_overview

STEPS = """
[steps.high]
do = "make"
shape = "sphere"
resolution = [24, 16]

[steps.low]
do = "unwrap"
mesh = "high"
method = "spherical"

[steps.limits]
do = "check"
mesh = "low"
fail_on = "never"

[steps.maps]
do = "bake"
after = "limits"
high = "high"
low = "low"
size = 32
padding = 1

[steps.look]
do = "preview"
mesh = "low"
width = 48
height = 32
output = "{asset}/look.{ext}"

[steps.page]
do = "page"
high = "high"
low = "low"
normal_map = "maps.normal"
size = 48
output = "{asset}/{asset}.{ext}"
"""
ASSETS = """
[[assets]]
name = "big ball"

[[assets]]
name = "bad <1>"
options.limits.max_faces = 10
"""


class Table(html.parser.HTMLParser):
    """Rows of the table: class, texts, links and pictures."""

    def __init__(self, path):
        super().__init__()
        self.rows = []
        self.feed(path.read_text(encoding="utf-8").partition("<tbody>")[2].partition("</tbody>")[0])

    def handle_starttag(self, tag, attrs):
        values = dict(attrs)
        if tag == "tr":
            self.rows.append({"status": values["class"], "text": "", "links": [], "pictures": 0})
        elif tag == "a":
            self.rows[-1]["links"].append(values["href"])
        elif tag == "img":
            self.rows[-1]["pictures"] += 1

    def handle_data(self, data):
        if self.rows:
            self.rows[-1]["text"] += data


def test_each_asset_has_its_row(write, run, tmp_path):
    path = write(ASSETS, STEPS)
    page = tmp_path / "pages" / "overview.html"
    page.parent.mkdir()
    result, _ = run(path)
    write_overview(page, result, command="texbake build x")
    good, bad = Table(page).rows
    assert (good["status"], good["pictures"]) == ("built", 1)
    (link,) = good["links"]
    assert (page.parent / unquote(link)).samefile(path.parent / "build/big ball/big ball.html")
    assert "720" in good["text"] and "0 %" in good["text"] and "°" in good["text"]
    assert (bad["status"], bad["links"]) == ("failed", [])
    assert "limits: " in bad["text"] and "more than max_faces, 10" in bad["text"]
    assert bad["pictures"] == 1  # it looks well, and is refused

    again, _ = run(path)
    small = sorted((path.parent / "build" / ".texbake" / "thumbnails").iterdir())
    before = [file.stat().st_mtime_ns for file in small]
    write_overview(page, again)
    kept, _ = Table(page).rows
    assert kept["status"] == "kept" and kept["pictures"] == 1
    assert [file.stat().st_mtime_ns for file in small] == before


def test_files_without_an_output_are_not_linked(write, run, tmp_path):
    steps = STEPS[: STEPS.rindex("output")]
    result, _ = run(write('[[assets]]\nname = "ball"\n', steps))
    (tmp_path / "build" / "ball" / "look.png").unlink()  # and what is gone has no picture
    write_overview(tmp_path / "a.html", result)
    (row,) = Table(tmp_path / "a.html").rows
    assert row["links"] == [] and row["pictures"] == 0 and row["status"] == "built"


def test_without_a_picture_a_map_stands_for_the_asset(write, run, tmp_path):
    steps = STEPS[: STEPS.index("[steps.look]")]
    for pattern, n in (("", 0), ('output = "{asset}/{output}.{ext}"\n', 1)):
        result, _ = run(write('[[assets]]\nname = "ball"\n', steps + pattern))
        write_overview(tmp_path / "a.html", result)
        (row,) = Table(tmp_path / "a.html").rows
        assert row["pictures"] == n
