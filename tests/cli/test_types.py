"""Values of options, and what a shell completes them to."""

from pathlib import Path

import click
import pytest
from texbake_cli.types import FileOf, NameAndStrength, Names, Numbers, Size, ViewParam

CONTEXT = click.Context(click.Command("test"))
PARAM = click.Option(["--it"])


def completions(kind, start):
    return [(item.value, item.type) for item in kind.shell_complete(CONTEXT, PARAM, start)]


@pytest.mark.parametrize(("kind", "text", "value"), [
    (Size(), "1024", 1024),
    (Size(), "1024x512", (1024, 512)),
    (Size(), "64X32", (64, 32)),
    (ViewParam(), "30,20", (30.0, 20.0)),
    (ViewParam(), "-30.5,90,2.5", (-30.5, 90.0, 2.5)),
    (ViewParam(), "turntable:36", 36),
    # Python's numbers have the digits of any script; those of file formats do not.
    (ViewParam(), "turntable:٣٦", 36),
    (ViewParam(), "٣٠,２０", (30.0, 20.0)),
    (Size(), "１０２４x512", (1024, 512)),
    (Numbers("X,Y,Z", ("x", "y")), "y", "y"),
    (Numbers("X,Y,Z", ("x", "y")), "0, -1,2e-3", (0.0, -1.0, 0.002)),
    (Numbers("S[,T]"), "2", 2.0),
    (Numbers("S[,T]"), "2,-3", (2.0, -3.0)),
    (NameAndStrength(["twirl"]), "twirl", "twirl"),
    (NameAndStrength(["twirl"]), "twirl:-90", ("twirl", -90.0)),
    (Names(["normal", "height"]), "normal", ("normal",)),
    (Names(["normal", "height"]), "height, normal,height", ("height", "normal")),
])  # fmt: skip
def test_text_becomes_a_value(kind, text, value):
    assert kind.convert(text, PARAM, CONTEXT) == value


@pytest.mark.parametrize(("kind", "text"), [
    (Numbers("X,Y,Z", ("x",)), "z"),
    (Numbers("X,Y,Z"), "1,2"),
    (Numbers("S[,T]"), "1,2,3"),
    (Numbers("A,B"), ""),
    (NameAndStrength(["twirl"]), "twirl:much"),
    (Size(), "big"),
    (Size(), ""),
    (ViewParam(), "30"),
    (ViewParam(), "1,2,3,4"),
    (ViewParam(), "turntable:0"),
    (ViewParam(), "turntable:²"),
    (ViewParam(), "turntable:" + 5000 * "9"),
    (ViewParam(), "carousel:4"),
    (Names(["normal"]), "normal,heigth"),
    (Names(["normal"]), ""),
])  # fmt: skip
def test_wrong_text_is_wrong_usage(kind, text):
    with pytest.raises(click.BadParameter):
        kind.convert(text, PARAM, CONTEXT)


def test_the_name_after_the_last_comma_is_completed():
    kind = Names(["normal", "displacement", "height"])
    assert completions(kind, "no") == [("normal", "plain")]
    assert completions(kind, "normal,") == [
        ("normal,displacement", "plain"),
        ("normal,height", "plain"),
    ]


def test_mesh_files_are_completed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in "scan.ply", "scan.PLY", "scan.txt", ".hidden.ply", "other.ply":
        Path(name).touch()
    for name in "scans", "scans/deep":
        Path(name).mkdir()
    Path("scans/a.obj").touch()
    kind = FileOf((".obj", ".ply"))
    assert completions(kind, "scan") == [
        ("scan.PLY", "plain"), ("scan.ply", "plain"), ("scans/", "plain"),
    ]  # fmt: skip
    assert completions(kind, "") == [
        ("other.ply", "plain"), ("scan.PLY", "plain"), ("scan.ply", "plain"), ("scans/", "plain"),
    ]  # fmt: skip
    assert completions(kind, "scans/") == [("scans/a.obj", "plain"), ("scans/deep/", "plain")]
    assert completions(kind, f"{tmp_path}/o") == [(f"{tmp_path}/other.ply", "plain")]
    assert completions(kind, ".h") == [(".hidden.ply", "plain")]


def test_where_no_file_fits_the_shell_finds_folders(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("scans").mkdir()
    assert completions(FileOf((".ply",)), "sc") == [("sc", "file")]
    assert completions(FileOf((".ply",)), "no/such/folder") == []
