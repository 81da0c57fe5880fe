from pathlib import Path

import numpy as np
import pytest

from texbake.errors import FileError, FileFormatError, UvError
from texbake.jobs.layout import check_layout, write_layout
from texbake.mapping.layout import draw_layout
from texbake.mapping.layout_svg import layout_svg
from texbake.mesh.shapes import cube, plane
from texbake.texture.image import read_image


def test_the_suffix_chooses_the_format(tmp_path: Path) -> None:
    mesh = plane(3, 3)
    write_layout(mesh, tmp_path / "a.png", 64, heat=True)
    read = read_image(tmp_path / "a.png", color=True)
    # 0.01: eight bits a channel, sRGB-coded.
    assert np.allclose(read.pixels, draw_layout(mesh, 64, heat=True), atol=0.01)
    write_layout(mesh, tmp_path / "a.SVG", (64, 32))
    assert (tmp_path / "a.SVG").read_text(encoding="utf-8") == layout_svg(mesh, (64, 32))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.SVG", "a.png"]


def test_a_file_that_was_there_stays_if_it_cannot_be_drawn(tmp_path: Path) -> None:
    for name in "a.png", "a.svg":
        (tmp_path / name).write_text("before")
        with pytest.raises(UvError):
            write_layout(cube(), tmp_path / name)
        assert (tmp_path / name).read_text() == "before"


def test_other_names(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=r"'\.gif'; use \.png or \.svg"):
        check_layout(tmp_path / "a.gif")
    with pytest.raises(FileError, match="there is no folder"):
        write_layout(plane(), tmp_path / "no" / "a.svg")
