"""Profiles and patches as files, in every layout, and the errors of invalid ones."""

import numpy as np
import pytest

from texbake import FileError, OptionError, make
from texbake.errors import FileFormatError
from texbake.mesh.parametric.bezier import patches_of
from texbake.mesh.parametric.revolution import profile_of


@pytest.fixture
def written(tmp_path):
    """Write text or bytes to a file and return its path."""

    def written(content):
        path = tmp_path / "given.txt"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return written


def assert_one_line(message, shape, **source):
    with pytest.raises(FileFormatError) as caught:
        make(shape, **source)
    (path,) = source.values()
    assert str(caught.value).startswith(f"{path}: ")
    assert message in str(caught.value) and "\n" not in str(caught.value)


# ---- profiles


@pytest.mark.parametrize(
    "text",
    ["0 0\n1 0.5\n1 2\n", "# a jar\n\n0, 0\n 1,0.5 # foot\r\n+1e0\t2.0", "\ufeff0 0\n1 .5\n1 2"],
)
def test_profiles_are_read(written, text):
    assert profile_of(written(text)).tolist() == [[0, 0], [1, 0.5], [1, 2]]


@pytest.mark.parametrize(("content", "message"), [
    ("", "the file is empty"),
    ("1 1\n1 1\n1 1\n", "fewer than two points"),
    ("0 0\n0 1\n", "it lies on the axis"),
    ("0 0\n1 1\n-0.5 2\n", "a radius is negative"),
    ("0 0\n\nnan 1\n", "line 3: 'nan' is not finite"),
    ("0 0\n1\n", "line 2: it has 1 word; a point needs 2 numbers"),
    ("0 0\none two\n", "line 2: 'one' is not a number"),
    (b"0 0\n\0\0 1", "it is not a profile; it holds binary data"),
])  # fmt: skip
def test_wrong_profiles_are_one_clear_line(written, content, message):
    assert_one_line(message, "revolution", profile=written(content))


@pytest.mark.parametrize(("profile", "message"), [
    ([], "of shape"),
    ([(1, 1)], "fewer than two points"),
    ([(0, 0), (0, 1)], "on the axis"),
    ([(1, 0), (-1, 1)], "a radius is negative"),
    ([(1, 0), (1, np.nan)], "not finite"),
    ([(1, 0, 0), (1, 1, 0)], "of shape"),
    ([("a", "b")], "not an array of numbers"),
])  # fmt: skip
def test_wrong_arrays_of_profiles(profile, message):
    with pytest.raises(OptionError, match=message):
        make("revolution", profile=profile)


def test_files_that_are_not_there(tmp_path):
    for options in {"profile": tmp_path / "no.txt"}, {"profile": str(tmp_path)}:
        with pytest.raises(FileError):
            make("revolution", **options)
    with pytest.raises(FileError, match="no such file"):
        make("bezier", patches=tmp_path / "no.txt")


# ---- patches

POINTS = np.arange(84.0).reshape(28, 3) / 8
FIRST = list(range(1, 17))
# The second patch has the last column of the first one for its first.
SECOND = [n for row in range(4) for n in (4 * row + 4, *range(17 + 3 * row, 20 + 3 * row))]
CONTROL = np.array([POINTS[np.array(FIRST) - 1], POINTS[np.array(SECOND) - 1]]).reshape(-1, 4, 4, 3)


def rows(table, separator):
    return [separator.join(f"{number:g}" for number in row) for row in table]


def shared(separator=","):
    """The layout of the classic teapot's data."""
    lines = ["2", *rows([FIRST, SECOND], separator), "28", *rows(POINTS, separator)]
    return "\n".join(lines) + "\n"


def degrees():
    lines = ["2"]
    for patch in CONTROL:
        lines += ["3 3", *rows(patch.reshape(-1, 3), " ")]
    return "\n".join(lines)


def alone():
    return "\n".join(rows(CONTROL.reshape(-1, 3), " "))


@pytest.mark.parametrize("text", [
    shared(), shared(", "), shared(" "), shared().replace("\n", " # of a pot\r\n"),
    shared(",").replace("\n", ",\n"), degrees(), alone(), "2\n" + alone(),
    "# points\n\n" + alone(),
])  # fmt: skip
def test_every_layout_gives_the_same_patches(written, text):
    np.testing.assert_array_equal(patches_of(written(text)), CONTROL)


def without(text, number):
    """Text without one of its lines, counted from 1."""
    lines = text.splitlines()
    del lines[number - 1]
    return "\n".join(lines)


@pytest.mark.parametrize(("content", "message"), [
    ("", "the file is empty"),
    ("# nothing\n", "it has no patches"),
    (b"2\n\0\1\2", "it is not a patch file; it holds binary data"),
    ("It was a dark and stormy night.\n",
     "line 1: 'It was a dark and stormy night.' is not a number of"),
    ("0\n", "line 1: '0' is not a number of patches"),
    ("2\n", "it ends before the number of points"),
    (shared().replace(",16\n", "\n"), "line 2: it has 15 words; patch 1 needs 16 numbers"),
    (shared().replace(",16\n", ",29\n"), "29 is not an index; there are points 1 to 28"),
    (shared().replace("\n1,2,", "\n0,2,"), "0 is not an index"),
    (shared().replace("\n1,2,", "\n1.5,2,"), "1.5 is not an index"),
    (without(shared(), 4), "line 4: '0 0.125 0.25' is not a number of points"),
    (without(shared(), 20), "it has 27 points, and should have 28"),
    (shared().replace("0,0.125,0.25", "0,0.125"), "line 5: it has 2 words; a point needs 3"),
    (without(degrees(), 10), "line 19: a patch begins with "),
    (degrees().replace("3 3", "3 4", 1), "line 2: a patch begins with '3 4'"),
    (without(alone(), 5), "it has 31 points; 2 patches should have 32"),
    ("999999999999\n" + alone(), "it has 32 points; 999,999,999,999 patches should have"),
])  # fmt: skip
def test_a_hole_is_one_clear_line(written, content, message):
    assert_one_line(message, "bezier", patches=written(content))


@pytest.mark.parametrize("layout", ["separate", "counted", "degrees", "shared"])
def test_points_may_have_texture_coordinates(tmp_path, layout):
    points = np.random.default_rng(0).random((16, 5)).round(6)
    lines = [" ".join(map(str, row)) for row in points]
    if layout == "counted":
        lines = ["1", *lines]
    elif layout == "degrees":
        lines = ["1", "3 3", *lines]
    elif layout == "shared":
        lines = ["1", ",".join(str(i + 1) for i in range(16)), "16", *lines]
    path = tmp_path / "patch.txt"
    path.write_text("\n".join(lines))
    np.testing.assert_array_equal(patches_of(path), points.reshape(1, 4, 4, 5))
    path.write_text("\n".join([*lines[:-1], "1 2 3"]))
    with pytest.raises(FileFormatError, match=r"it has 3 words; a point .*needs 5 numbers"):
        patches_of(path)
