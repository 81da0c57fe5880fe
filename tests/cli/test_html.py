"""`--html` of the commands that have it; the pages themselves are tested in tests/pages."""

from html import unescape

import pytest

pytestmark = pytest.mark.usefixtures("small_pictures")

# A command line, and the sections that its page has.
BAKED = ("view", "maps", "errors", "distances", "times", "figures", "again")
LINES = {
    "bake-normals high.ply low.obj -o n.png --size 64": BAKED,
    "bake-displacement high.ply low.obj -o d.exr --size 64": BAKED,
    "bake high.ply low.obj -o maps --maps curvature --size 64": BAKED,
    "bake high.ply low.obj -o maps --size 64 --samples adaptive": (
        "view", "maps", "errors", "times", "figures", "again",
    ),
    "run high.ply -o job --faces 100 --size 128 --padding 2": BAKED,
    "compare high.ply low.obj --size 64": ("view", "errors", "figures", "again"),
}  # fmt: skip


def sections(page):
    return [part.split('"')[0] for part in page.split('<section id="')[1:]]


@pytest.mark.parametrize("line", LINES)
def test_a_page_shows_the_results_and_the_command_that_makes_them(line, workplace, invoke):
    result = invoke(f"{line} --html page.html")
    assert "wrote page.html" in result.output
    page = (workplace / "page.html").read_text(encoding="utf-8")
    assert sections(page) == list(LINES[line])
    assert f">texbake {line} --html page.html</code>" in unescape(page)


def test_a_page_changes_no_other_file(workplace, invoke):
    for samples in "4", "adaptive":
        line = f"bake high.ply low.obj --maps displacement --size 64 --samples {samples}"
        invoke(f"{line} -o alone")
        invoke(f"{line} -o shown --html page.html")
        names = [path.name for path in (workplace / "alone").iterdir()]
        assert names == [path.name for path in (workplace / "shown").iterdir()]
        for name in names:
            alone, shown = (workplace / folder / name for folder in ("alone", "shown"))
            assert alone.read_bytes() == shown.read_bytes()


def test_maps_made_for_the_page_alone_are_named(workplace, invoke):
    invoke("bake high.ply low.obj -o maps --maps displacement --size 64 --html page.html")
    assert not (workplace / "maps" / "normal.png").exists()
    page = (workplace / "page.html").read_text(encoding="utf-8")
    assert page.count("Made for this page; there is no file of it.") == 1


def test_light_maps_have_no_page(workplace, invoke):
    (workplace / "room.toml").write_text("", encoding="utf-8")
    line = "bake-lightmap room.toml -o maps --html page.html"
    assert "no such option '--html'" in invoke(line, 2).output
