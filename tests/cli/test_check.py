"""`texbake check`: tables, reports, pictures and exit codes."""

import json
import re
import textwrap
from pathlib import Path
from xml.etree import ElementTree

import pytest

from texbake import CheckOptions, read_image, read_mesh, write_mesh
from texbake.checks.check import check_files


@pytest.fixture(autouse=True)
def at_the_workplace(workplace):
    """Commands of these tests run beside the pair."""


@pytest.fixture
def overlapping():
    """A low-poly mesh whose faces all lie on one triangle of the texture."""
    mesh = read_mesh("low.obj")
    uvs = [[0.1, 0.1], [0.9, 0.1], [0.5, 0.9]]
    write_mesh(mesh.replace(uvs=uvs, uv_faces=[[0, 1, 2]] * mesh.n_faces), "bad.obj")
    return "bad.obj"


def test_the_last_line_says_whether_the_meshes_are_ready(invoke, overlapping):
    text = invoke("check high.ply low.obj").stdout
    assert text.startswith("high-poly mesh  high.ply, 11,400 faces\nlow-poly mesh  low.obj, 112 f")
    refused = invoke(f"check {overlapping}", exit_code=1).stdout.splitlines()
    assert re.match(r"Not ready to bake, \d+ errors?,", refused[-1])
    assert any(re.match("error .* 112 faces  overlapping coordinates", row) for row in refused)
    assert any("texbake unwrap" in row for row in refused)  # what to do
    words = "check low.obj --report r.json"
    ready = invoke(words).stdout.splitlines()[-1]
    assert re.match(r"Ready to bake, \d+ notes?$", ready)
    strict = invoke(f"{words} --fail-on note", exit_code=1).stdout.splitlines()[-1]
    assert strict == f"Not r{ready[1:]}"
    invoke(f"check {overlapping} --fail-on never")


def test_a_missing_file_is_a_finding_among_others(invoke):
    words = "check low.obj missing.obj --each --format junit"
    suites = ElementTree.fromstring(invoke(words, exit_code=1).stdout.encode())
    assert [suite.get("name") for suite in suites] == ["low.obj", "missing.obj"]
    (failure,) = suites[1].iter("failure")
    assert "missing.obj: there is no such file" in str(failure.text)
    invoke(f"{words} --fail-on never")


def test_only_errors_are_explained_unless_asked(invoke, overlapping):
    found = check_files(overlapping).findings
    short = invoke(f"check {overlapping}", exit_code=1).stdout
    full = invoke(f"check {overlapping} --explain", exit_code=1).stdout
    assert {finding.severity for finding in found} > {"error"}
    for finding in found:
        start = "\n".join(textwrap.wrap(finding.problem, 40)[:1])
        assert start in full
        assert (start in short) == (finding.severity == "error")
    assert "--explain" in short
    assert "--explain" not in full


def test_findings_are_allowed_by_name(invoke, overlapping):
    """Allowing every kind of error passes; they are still listed, last, and counted apart."""
    found = check_files(overlapping)
    errors = [finding.name for finding in found.findings if finding.severity == "error"]
    first, allowed = errors[0], " ".join(f"--allow {name}" for name in errors)
    assert "allowed" in invoke(f"check {overlapping} {allowed}").stdout.splitlines()[-4]
    printed = json.loads(invoke(f"check {overlapping} {allowed} --json --report r.json").stdout)
    expected = check_files(overlapping, options=CheckOptions(allow=tuple(errors))).to_json()
    written = json.loads(Path("r.json").read_text())
    assert (
        printed["findings"] == written["findings"] == json.loads(json.dumps(expected["findings"]))
    )
    assert (printed["n_errors"], printed["n_allowed"]) == (0, len(errors))
    assert {f["name"] for f in printed["findings"] if f["allowed"]} == set(errors)
    invoke(f"check {overlapping} --allow no-normals", exit_code=1)
    wrong = invoke(f"check {overlapping} --allow {first[:-1]}", exit_code=2).stderr
    assert f"did you mean '{first}'?" in wrong


def test_pictures_have_a_panel_for_each_finding(invoke, overlapping):
    invoke(f"check high.ply {overlapping} --layout layout.png --sides sides.png", exit_code=1)
    n_low = sum(len(f.faces) > 0 for f in check_files("high.ply", overlapping).findings)
    layout, sides = (read_image(name, color=True).pixels for name in ("layout.png", "sides.png"))
    assert n_low > 0
    assert layout.shape[1] >= min(n_low, 3) * 640
    assert sides.shape[1] > 3 * sides.shape[0] / n_low  # four panels in each row


def test_findings_that_cannot_be_drawn_are_named(invoke):
    result = invoke("check high.ply --layout layout.png")
    assert "layout.png: not drawn" in result.stderr
    assert not Path("layout.png").exists()


def test_quiet_prints_the_table_alone(invoke, overlapping):
    lines = invoke(f"check {overlapping} -q", exit_code=1).stdout.splitlines()
    assert lines[0].split()[0] == "severity"
    assert all(line.split()[0] in ("error", "warning", "note") for line in lines[1:])


def test_remedies_name_the_commands_that_there_are():
    from texbake_cli.main import COMMANDS

    from texbake.checks.kinds import KINDS

    named = {
        name: re.findall(r"texbake ([a-z-]+)", kind.remedy)
        for name, kind in KINDS.items()
        if "texbake " in kind.remedy
    }
    assert all(command in COMMANDS for commands in named.values() for command in commands)
    repairs = ("zero-area-faces", "duplicate-faces", "duplicate-vertices", "unused-vertices",
               "inconsistent-winding", "inside-out-shells", "opposite-sides")  # fmt: skip
    assert all("repair" in named[name] for name in repairs)
    # Whatever another unwrap, a transform or a new surface mends.
    assert {"no-coordinates", "mirrored-coordinates", "far-from-origin", "cracks"} <= set(named)


@pytest.mark.parametrize("form", ["json", "sarif", "junit"])
def test_forms_for_programs_are_alone_on_the_standard_output(invoke, form):
    text = invoke(f"check low.obj high.ply --each --format {form} --verbose").stdout
    if form == "junit":
        assert len(ElementTree.fromstring(text.encode())) == 2
    else:
        assert len(json.loads(text)["meshes" if form == "json" else "runs"]) in (1, 2)
