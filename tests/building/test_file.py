"""Errors in a pipeline file name the line, the key and what was expected."""

import re
from itertools import pairwise
from pathlib import Path

import pytest

from texbake import BuildOptions, FileError, OptionError
from texbake.building.build import plan_build
from texbake.building.file import read_pipeline
from texbake.errors import FileFormatError
from texbake.limits import ALLOW_OUTSIDE

ASSET = '[[assets]]\nname = "a"\n'
REPAIR = '[steps.r]\ndo = "repair"\nmesh = "high"\n'
LEVELS = '[steps.l]\ndo = "simplify"\nmesh = "high"\nfaces = [9, 8]\n'
MAKE = '[steps.high]\ndo = "make"\nshape = "plane"\n'


@pytest.mark.parametrize(("assets", "steps", "line", "message"), [
    ("", MAKE, None, "assets: it is missing"),
    (ASSET, "", None, "steps: it is missing"),
    ("assets = []\n", MAKE, 1, "assets: it is empty"),
    ('[check]\nallow = ["no-normal"]\n' + ASSET, MAKE + '[steps.x]\ndo = "check"\nmesh = "high"\n',
     2, "check.allow: 'no-normal' is not a kind of finding; did you mean 'no-normals'?"),
    ("[[assets]]\n", MAKE, 1, "assets[0]: it has neither inputs nor a name"),
    (ASSET + "nmae = 3\n", MAKE, 3, "assets[0].nmae: unknown key; did you mean 'name'?"),
    ("[[assets]]\nname = 3\n", MAKE, 2, "assets[0].name: 3 is not text"),
    (ASSET + 'steps = ["hihg"]\n', MAKE, 3, "no step 'hihg'; did you mean 'high'?"),
    (ASSET + "options.hihg = {}\n", MAKE, 3, "no such step; did you mean 'high'?"),
    (ASSET + "options.high.size = 3\n", MAKE, 3, "assets[0].options.high.size: unknown key"),
    (ASSET, '[steps.x]\nshape = "plane"\n', 3, "steps.x.do: it is missing; it is one of make"),
    (ASSET, '[steps.x]\ndo = "bke"\n', 4,
     "steps.x.do: 'bke' is not a kind of step; did you mean 'bake'?"),
    (ASSET, '[steps.x]\ndo = "export"\nmesh = "high"\ntarget = "unity"\n', 6,
     "steps.x.target: unknown key"),
    (ASSET, '[steps.x]\ndo = "make"\n', 3, "steps.x.shape: it is missing"),
    (ASSET, MAKE + "radius = 2\n", 6, "steps.high.radius: the shape plane does not use it"),
    (ASSET, MAKE + 'width = "wide"\n', 6, "steps.high.width: 'wide' is not a number"),
    (ASSET, MAKE + "resolution = 0\n", 6, "steps.high.resolution: 0 is out of range"),
    (ASSET, MAKE + 'after = "x"\n', 6, "steps.high.after: no step 'x'"),
    (ASSET, MAKE + 'output = "{aset}.{ext}"\n', 6, "{aset}, which is not known; did you mean"),
    (ASSET, MAKE + 'output = "../x.{ext}"\n', 6, "does not lie below the folder of outputs"),
    (ASSET, MAKE + '[steps.a]\ndo = "repair"\nmesh = "hihg"\n', 8, "did you mean 'high'?"),
    (ASSET, MAKE + '[steps.a]\ndo = "repair"\nmesh = "high.uv"\n', 8, "makes no 'uv'"),
    (ASSET, MAKE + '[steps.a]\ndo = "repair"\nmesh = "z.ply"\n', 8, "nor a file there is"),
    (ASSET, '[steps."a.b"]\ndo = "make"\n', 3, "'a.b' is not a name"),
    ('[[assets]]\ninputs.scan = "*.nothing"\n', MAKE, 2, "matches no file"),
    ('[[assets]]\ninputs.high = "p*"\n', MAKE, 2, "a step has the same name"),
    (ASSET + ASSET, MAKE, 4, "two assets are called 'a'"),
    (ASSET + '[[assets]]\nname = "b"\n', MAKE + 'output = "x.{ext}"\n', 8,
     "a high and b high both write 'x.ply'"),
    (ASSET, MAKE + LEVELS + 'output = "x.obj"\n', 10,
     "several outputs are called 'x.obj'; put {output}"),
    (ASSET, MAKE + 'output = "x.ply"\n' + REPAIR + 'output = "x.ply/y.ply"\n', 10,
     "x.ply/y.ply would lie in x.ply, which a high"),
    ('[[assets]]\nname = "../a"\n', MAKE, 2, "'../a' is not a name for files"),
    ('[[assets]]\nname = "{stm}"\n', MAKE, 2, "{stm}, which is not known"),
])  # fmt: skip
def test_bad_files(assets, steps, line, message, write):
    path = write(assets, steps)
    with pytest.raises(FileFormatError) as caught:
        plan_build(path)
    text = str(caught.value)
    where = f"{path}:{line}: " if line else f"{path}: "
    assert text.startswith(where), text
    assert message in text
    assert "\n" not in text


def test_steps_that_wait_for_one_another(write):
    steps = """
[steps.a]
do = "repair"
mesh = "c"
[steps.b]
do = "repair"
mesh = "a"
[steps.c]
do = "repair"
mesh = "b"
"""
    with pytest.raises(FileFormatError, match="the steps wait for one another") as caught:
        plan_build(write(ASSET, steps))
    names = re.findall(r"\b[abc]\b(?= needs|$)", str(caught.value))
    assert len(names) == 4 and names[0] == names[-1] and set(names) == {"a", "b", "c"}
    needs = {"a": "c", "b": "a", "c": "b"}
    assert all(needs[one] == other for one, other in pairwise(names))


def test_an_output_over_an_input(write, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "a.ply").write_text("x")
    steps = REPAIR + 'output = "a.ply"\n'
    with pytest.raises(FileFormatError, match=r"a\.ply is also an input"):
        plan_build(write('[[assets]]\ninputs.high = "out/*.ply"\n', steps, 'folder = "out"\n'))


@pytest.mark.parametrize(("output", "message"), [
    ("p.toml", r"p\.toml is this file itself"),
    ("raw.ply", r"raw\.ply is also an input"),
    ("build.json", r"'build.json' is reserved for the build's own files"),
    (".texbake/x.ply", r"'.texbake/x.ply' is reserved for the build's own files"),
    ("{asset}.obj", r"'a.obj' has the wrong suffix for a .ply file; end it with .{ext}"),
    ("{asset.{ext}", r"has {asset.{ext}, which is not known|has an unmatched brace"),
    ("{asset", "has an unmatched brace"),
    ("a\\u0000.ply", "has a character that file names cannot have"),
])  # fmt: skip
def test_harmful_outputs(output, message, write, tmp_path):
    (tmp_path / "raw.ply").write_text("x")
    steps = f'[steps.r]\ndo = "repair"\nmesh = "./raw.ply"\noutput = "{output}"\n'
    if output in ("p.toml", "build.json"):  # a folder has no suffix to mind
        steps = steps.replace('"repair"', '"mipmap"').replace("mesh", "image")
    path = write(ASSET, steps)
    with pytest.raises(FileFormatError, match=message):
        plan_build(path.rename(tmp_path / "p.toml"), BuildOptions(folder=tmp_path))


def test_only_takes_names_with_brackets_as_they_are(write, tmp_path):
    (tmp_path / "a[1].ply").write_text("x")
    path = write(
        '[[assets]]\ninputs.high = "a*.ply"\n', '[steps.r]\ndo = "repair"\nmesh = "high"\n'
    )
    assert [step.asset for step in plan_build(path, BuildOptions(only=("a[1]",)))] == ["a[1]"]


def test_a_name_matched_twice(write, tmp_path):
    for folder in "one", "two":
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "a.ply").write_text("x")
    steps = REPAIR + 'output = "{asset}.ply"\n'
    with pytest.raises(FileFormatError, match=r":2: .*one/a.ply and .*two/a.ply both give .*'a'"):
        plan_build(write('[[assets]]\ninputs.high = "*/a.ply"\n', steps))
    assets = '[[assets]]\ninputs.high = "*/a.ply"\nname = "{folder}_{stem}"\n'
    assert [step.asset for step in plan_build(write(assets, steps))] == ["one_a", "two_a"]


@pytest.mark.parametrize("name", ["a b", "größe", 'it\'s "quoted"', "[1]", "a#b", "100%"])
def test_odd_names(name, write, tmp_path):
    folder = tmp_path / name
    folder.mkdir()
    (folder / f"{name}.ply").write_text("x")
    steps = REPAIR + 'output = "{asset}.ply"\n'
    quoted = f"{name}/{name}.ply".replace("\\", "\\\\").replace('"', '\\"')
    (step,) = plan_build(write(f'[[assets]]\ninputs.high = "{quoted}"\n', steps))
    assert (step.asset, step.state) == (name, "runs")


def test_sidecars_are_found_by_the_stem(write, tmp_path):
    for name in "a_high.ply", "b_high.ply", "a_high_cage.ply":
        (tmp_path / name).write_text(name)
    assets = '[[assets]]\ninputs.high = "?_high.ply"\ninputs.cage = "{stem}_cage.ply"\n'
    steps = '[steps.r]\ndo = "repair"\nmesh = "cage"\n'
    states = {step.asset: (step.state, step.why) for step in plan_build(write(assets, steps))}
    assert (states["a_high"][0], states["b_high"][0]) == ("runs", "fails")
    assert "b_high_cage.ply: there is no such file" in states["b_high"][1]


def test_not_toml(write):
    with pytest.raises(FileFormatError, match=r"it is not TOML: .*line 1"):
        plan_build(write("a = \n", ""))
    with pytest.raises(FileError, match="there is no such file"):
        plan_build("nowhere.toml")


def test_only_names_assets(write):
    path = write()
    steps = plan_build(path, BuildOptions(only=("e*",)))
    assert {step.asset for step in steps} == {"egg"}
    with pytest.raises(OptionError, match="no asset is called 'bal'; did you mean 'ball'"):
        plan_build(path, BuildOptions(only=("bal",)))


def test_chosen_steps_of_an_asset_bring_their_inputs(write):
    path = write('[[assets]]\nname = "a"\nsteps = "low"\n')
    assert [step.step for step in plan_build(path)] == ["high", "low"]


@pytest.mark.skipif(not Path("/proc/self/mem").exists(), reason="Linux has such a file")
def test_a_file_that_cannot_be_read_is_one_error():
    with pytest.raises(FileError, match="cannot be read"):
        read_pipeline("/proc/self/mem")


def test_a_folder_that_links_lead_to_is_outside(write, tmp_path, monkeypatch):
    monkeypatch.delenv(ALLOW_OUTSIDE, raising=False)
    elsewhere, inner = tmp_path / "elsewhere", tmp_path / "inner"
    elsewhere.mkdir()
    inner.mkdir()
    (inner / "link").symlink_to(elsewhere)
    path = write(ASSET, MAKE, 'folder = "link/x"\n').rename(inner / "p.toml")
    with pytest.raises(FileError, match=r"links lead from 'link/x' out of its folder; .*outside"):
        plan_build(path)
    assert not list(elsewhere.iterdir())
    plan_build(path, BuildOptions(folder=tmp_path / "named"))
    monkeypatch.setenv(ALLOW_OUTSIDE, "1")
    plan_build(path)
