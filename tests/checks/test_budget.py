"""Profiles, which check the limits of a program, and reports for programs that show findings."""

import base64
import json
import os
import re
import struct
import subprocess
import zlib
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import jsonschema
import numpy as np
import pytest
import yaml

from tests.glb import read_glb
from texbake import CheckOptions, check, write_image, write_mesh
from texbake.checks.budget import AssetFile
from texbake.checks.check import check_files
from texbake.checks.report_formats import junit_of, sarif_of
from texbake.mesh.shapes import icosphere, uv_sphere
from texbake.targets import PROGRAMS

ROOT = Path(__file__).parents[2]
LIMITS = PROGRAMS["gltf-web"].limits
WEB = CheckOptions(profile="gltf-web")
# What SARIF 2.1.0 requires of the objects that are written, and the words of its enumerations.
TEXT = {"type": "object", "required": ["text"], "properties": {"text": {"type": "string"}}}
LEVEL = {"enum": ["none", "note", "warning", "error"]}
SARIF = {
    "type": "object", "required": ["version", "runs"],
    "properties": {
        "version": {"const": "2.1.0"},
        "runs": {
            "type": "array",
            "items": {
                "required": ["tool"],
                "properties": {
                    "tool": {
                        "required": ["driver"],
                        "properties": {
                            "driver": {
                                "required": ["name"],
                                "properties": {
                                    "rules": {
                                        "uniqueItems": True,
                                        "items": {
                                            "required": ["id"],
                                            "properties": {
                                                "shortDescription": TEXT,
                                                "defaultConfiguration": {
                                                    "properties": {"level": LEVEL},
                                                },
                                            },
                                        },
                                    },
                                },
                            },
                        },
                    },
                    "results": {
                        "items": {
                            "required": ["message"], "additionalProperties": False,
                            "properties": {
                                "ruleId": {"type": "string"},
                                "ruleIndex": {"type": "integer", "minimum": -1}, "level": LEVEL,
                                "message": TEXT, "locations": {"type": "array"},
                                "properties": {"type": "object"},
                                "suppressions": {
                                    "items": {
                                        "required": ["kind"],
                                        "properties": {"kind": {"enum": ["inSource", "external"]}},
                                    },
                                },
                            },
                        },
                    },
                },
            },
        },
    },
}  # fmt: skip


def names(report):
    return {finding.name for finding in report.findings}


@pytest.fixture
def textured(tmp_path):
    """Write a ball with an image of a width, as GLB."""

    def write(width):
        ball = uv_sphere(8, 12)
        write_image(np.random.default_rng(0).random((4, width, 3)), tmp_path / "c.png", color=True)
        path = tmp_path / f"ball {width}.glb"
        write_mesh(ball, path, base_color=tmp_path / "c.png")
        return path

    return write


def test_triangles_are_counted_exactly(monkeypatch):
    ball = icosphere(2)
    for most, is_too_many in ((ball.n_faces, False), (ball.n_faces - 1, True)):
        limits = LIMITS.__class__(triangles=most)
        monkeypatch.setitem(PROGRAMS, "gltf-web", _with(limits))
        assert ("too-many-triangles" in names(check(ball, options=WEB))) == is_too_many


def _with(limits):
    return replace(PROGRAMS["gltf-web"], limits=limits)


def test_images_and_bytes_are_those_of_the_file(textured, monkeypatch):
    assert "large-images" not in names(check_files(textured(2048), options=WEB))
    large = check_files(textured(2049), options=WEB)
    assert large.finding("large-images").count == 1
    path = textured(64)
    size = path.stat().st_size
    for most, is_large in ((size, False), (size - 1, True)):
        monkeypatch.setitem(PROGRAMS, "gltf-web", _with(LIMITS.__class__(n_bytes=most)))
        assert ("large-file" in names(check_files(path, options=WEB))) == is_large


def huge_png():
    """Return a PNG file that says it has 70,000 x 70,000 pixels."""
    chunks = ((b"IHDR", struct.pack(">IIBBBBB", 70000, 70000, 8, 2, 0, 0, 0)), (b"IDAT", b"x"))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in (*chunks, (b"IEND", b""))
    )


@pytest.mark.parametrize(
    ("content", "reason"),
    [(None, "missing"), (b"no image", "not an image"), (huge_png(), "i.png: it")],
    ids=["missing", "garbage", "huge"],
)
def test_images_that_cannot_be_read_are_found(textured, tmp_path, content, reason):
    path = as_gltf(textured(64), tmp_path)
    assert "unreadable-images" not in names(check_files(path, options=WEB))
    (tmp_path / "i.png").unlink() if content is None else (tmp_path / "i.png").write_bytes(content)
    found = check_files(path, options=WEB).finding("unreadable-images")
    assert found.count == 1 and reason in found.problem and found.severity == "error"


def as_gltf(path, folder, *, inside=False):
    """Write a GLB file as .gltf, with its buffer and image in files of their own or inside."""
    document, data = read_glb(path)
    (image,), view = (
        document["images"],
        document["bufferViews"][document["images"][0]["bufferView"]],
    )
    start = view.get("byteOffset", 0)
    for name, content, item in (
        ("b.bin", bytes(data), document["buffers"][0]),
        ("i.png", bytes(data[start : start + view["byteLength"]]), image),
    ):
        item["uri"] = name
        if inside:
            kind = "image/png" if item is image else "application/octet-stream"
            item["uri"] = f"data:{kind};base64,{base64.b64encode(content).decode()}"
        else:
            (folder / name).write_bytes(content)
    del image["bufferView"]
    (folder / "a.gltf").write_text(json.dumps(document))
    return folder / "a.gltf"


@pytest.mark.parametrize("inside", [False, True])
def test_the_bytes_of_a_gltf_file_count_once(textured, tmp_path, inside):
    path = as_gltf(textured(64), tmp_path, inside=inside)
    files = [path] if inside else [path, tmp_path / "b.bin", tmp_path / "i.png"]
    assert AssetFile.of(path).n_bytes == sum(file.stat().st_size for file in files)


def test_texels_per_meter_follow_size_and_scale():
    # The ball has an area of about 4 pi, and its coordinates fill the unit square.
    ball = uv_sphere(32, 64)
    density = 1024 / np.sqrt(4 * np.pi)
    for factor, is_low in ((1.05, True), (0.95, False)):
        grown = ball.replace(positions=factor * density / LIMITS.texels_per_meter * ball.positions)
        assert ("few-texels-per-meter" in names(check(grown, options=WEB))) == is_low
        larger = CheckOptions(profile="gltf-web", size=2048)
        assert "few-texels-per-meter" not in names(check(grown, options=larger))


def test_options_that_are_given_win_over_a_profile():
    assert (WEB.size, WEB.padding) == (1024, 4)
    own = CheckOptions(profile="gltf-web", size=256, padding=2)
    assert (own.size, own.padding) == (256, 2)
    assert (CheckOptions().size, CheckOptions().padding) == (1024, 4)
    assert not {"large-file", "large-images"} & names(check(icosphere(1)))


@pytest.fixture
def reports(textured, tmp_path):
    """Findings of all severities, an allowed one, and a file that is not a mesh."""
    (tmp_path / "not a.obj").write_text("f 1 2 x\n")
    options = CheckOptions(profile="gltf-web", allow=("large-images",))
    paths = (textured(2049), tmp_path / "not a.obj")
    return [check_files(path, options=options) for path in paths]


def test_sarif_has_what_its_schema_requires(reports):
    log = json.loads(json.dumps(sarif_of(reports)))
    jsonschema.validate(log, SARIF)
    (run,) = log["runs"]
    rules = run["tool"]["driver"]["rules"]
    found = [finding for report in reports for finding in report.findings]
    assert [result["ruleId"] for result in run["results"]] == [f.name for f in found]
    assert all(rules[result["ruleIndex"]]["id"] == result["ruleId"] for result in run["results"])
    suppressed = [result["ruleId"] for result in run["results"] if "suppressions" in result]
    assert suppressed == ["large-images"]
    uris = {result["locations"][0]["physicalLocation"]["artifactLocation"]["uri"]
            for result in run["results"]}  # fmt: skip
    assert len(uris) == 2 and not any(" " in uri for uri in uris)


def test_sarif_names_files_that_are_not_utf_8():
    report = replace(
        check(icosphere(1)), files=dict.fromkeys(("low", "high"), os.fsdecode(b"\xff.obj"))
    )
    (run,) = sarif_of([report])["runs"]
    place = run["results"][0]["locations"][0]["physicalLocation"]
    assert place["artifactLocation"]["uri"] == "%FF.obj"


def test_junit_counts_what_fails(reports):
    for fail_on in ("error", "note", None):
        suites = ElementTree.fromstring(junit_of(reports, fail_on))
        for suite, report in zip(suites, reports, strict=True):
            assert int(suite.get("tests")) == len(suite)
            failed = suite.findall("testcase/failure")
            assert int(suite.get("failures")) == len(failed)
            assert bool(failed) == (fail_on is not None and report.fails(fail_on))
            assert len(suite.findall("testcase/skipped")) == report.n_allowed
    empty = ElementTree.fromstring(junit_of([replace(check(icosphere(1)), findings=())], "error"))
    assert [case.get("name") for case in empty.iter("testcase")] == ["ready to bake"]


def test_the_hook_takes_what_can_be_read_and_runs_what_there_is():
    (hook,) = yaml.safe_load((ROOT / ".pre-commit-hooks.yaml").read_text())
    assert hook["id"] == "texbake-check" and hook["language"] == "python"
    pattern = re.compile(hook["files"])
    assert all(pattern.search(f"a/b{suffix}") for suffix in (".obj", ".GLB", ".usda", ".usdz"))
    assert not pattern.search("a.py") and not pattern.search("objects")
    assert hook["entry"].split()[:3] == ["texbake", "check", "--each"]


def test_the_action_passes_its_inputs(tmp_path, textured):
    action = yaml.safe_load((ROOT / "action.yml").read_text())
    assert action["runs"]["using"] == "composite"
    steps = action["runs"]["steps"]
    used = set(re.findall(r"inputs\.([\w-]+)", json.dumps(steps)))
    assert used == set(action["inputs"])
    (check_step,) = (step for step in steps if step.get("name") == "Check")
    given = {"path": "**/*.glb", "profile": "gltf-web", "format": "sarif", "output": "out.sarif"}
    values = {name: item.get("default", "") for name, item in action["inputs"].items()} | given
    environment = {key: values[re.search(r"inputs\.([\w-]+)", text)[1]]
                   for key, text in check_step["env"].items()}  # fmt: skip
    path = textured(64).rename(tmp_path / "-a ball.glb")
    done = subprocess.run(
        ["bash", "-e", "-c", check_step["run"]], cwd=tmp_path, env={**os.environ, **environment},
        check=False, capture_output=True, text=True,
    )  # fmt: skip
    report = check_files(path, options=WEB)
    assert done.returncode == report.fails("error"), done.stderr
    (made,) = json.loads((tmp_path / "out.sarif").read_text())["runs"]
    assert {result["ruleId"] for result in made["results"]} == names(report) != set()
