"""Pictures of texture coordinates: the checker on the mesh, and layouts as files."""

from dataclasses import replace

import numpy as np
import pytest

from texbake import FileError, OptionError, RenderOptions, draw_layout, read_image
from texbake.errors import FileFormatError, UvError
from texbake.jobs.outputs import check_layout
from texbake.jobs.side_pictures import render_checker, write_layout
from texbake.mapping.layout_svg import layout_svg
from texbake.mesh.shapes import cube, plane

# Straight at the plane, which lies in x and y and looks along z.
FRONT = RenderOptions(width=96, height=96, view=(0.0, 0.0), supersampling=2, background=None)


def front_of(picture):
    margin = 6  # about each, at this size
    middle = margin + (picture.shape[1] - 5 * margin) // 8
    return picture[24:72, middle - 24 : middle + 24]


def hues(picture):
    """Colors without how strongly they are lit."""
    return picture / np.maximum(picture.sum(axis=2, keepdims=True), 1e-3)


def test_coordinates_outside_the_square_repeat_the_checker():
    mesh = plane()
    here = render_checker(mesh, FRONT)
    there = render_checker(mesh.replace(uvs=mesh.uvs + np.array([3.0, -2.0])), FRONT)
    # 1e-3: coordinates lose 2 of their 53 bits.
    assert np.abs(front_of(here) - front_of(there)).mean() < 1e-3
    elsewhere = render_checker(mesh.replace(uvs=mesh.uvs + np.array([0.5, 0.0])), FRONT)
    assert np.abs(front_of(here) - front_of(elsewhere)).mean() > 0.1


def test_mirrored_coordinates_show_the_checker_mirrored():
    mesh = plane()
    upright = front_of(render_checker(mesh, FRONT, n_cells=4))
    mirrored = mesh.replace(uvs=mesh.uvs * np.array([-1.0, 1.0]) + np.array([1.0, 0.0]))
    turned = front_of(render_checker(mirrored, FRONT, n_cells=4))
    # 1e-3: the highlight is not in the middle.
    assert np.abs(hues(upright) - hues(turned)[:, ::-1]).mean() < 1e-3
    assert np.abs(hues(upright) - hues(turned)).mean() > 0.1


def test_four_sides_and_the_same_for_any_number_of_threads():
    # An open plane, culled from behind: only the first of its four sides shows it.
    culled = render_checker(plane(), FRONT, threads=1)
    both = RenderOptions(
        width=96, height=96, view=(0.0, 0.0), supersampling=2, background=None, back_faces="show"
    )
    shown = render_checker(plane(), both, threads=3)
    assert culled.shape == shown.shape
    width = shown.shape[1] // 4
    changed = [
        np.abs(culled - shown)[:width, i * width : (i + 1) * width].max() > 0.1 for i in range(4)
    ]
    assert changed == [False, False, True, False]
    assert render_checker(plane(), both, threads=1).tobytes() == shown.tobytes()


def test_a_checker_repeated_often_is_drawn_with_fewer_texels():
    mesh = plane()
    often = mesh.replace(uvs=mesh.uvs * 8.0)
    picture = front_of(render_checker(often, replace(FRONT, supersampling=4), n_cells=2))
    finer = front_of(render_checker(often, replace(FRONT, supersampling=16), n_cells=2))
    # What more samples would still change is aliasing. Cells are 4 pixels wide here.
    assert np.abs(picture - finer).mean() < 0.02
    assert picture.std() > 0.05  # and the cells can still be told apart


def test_wrong_input():
    with pytest.raises(UvError, match="no texture coordinates"):
        render_checker(cube())
    with pytest.raises(OptionError, match="n_cells"):
        render_checker(plane(), n_cells=99)


def test_the_suffix_chooses_the_format(tmp_path):
    mesh = plane(3, 3)
    write_layout(mesh, tmp_path / "a.png", 64, heat=True)
    read = read_image(tmp_path / "a.png", color=True)
    # 0.01: eight bits per channel, sRGB-coded.
    assert np.allclose(read.pixels, draw_layout(mesh, 64, heat=True), atol=0.01)
    write_layout(mesh, tmp_path / "a.SVG", (64, 32))
    assert (tmp_path / "a.SVG").read_text(encoding="utf-8") == layout_svg(mesh, (64, 32))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.SVG", "a.png"]


def test_a_file_that_was_there_stays_if_it_cannot_be_drawn(tmp_path):
    for name in "a.png", "a.svg":
        (tmp_path / name).write_text("before")
        with pytest.raises(UvError):
            write_layout(cube(), tmp_path / name)
        assert (tmp_path / name).read_text() == "before"


def test_other_names(tmp_path):
    with pytest.raises(FileFormatError, match=r"'\.gif'; use \.png or \.svg"):
        check_layout(tmp_path / "a.gif")
    with pytest.raises(FileError, match="there is no folder"):
        write_layout(plane(), tmp_path / "no" / "a.svg")
