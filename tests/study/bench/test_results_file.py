"""Result files: their schema, cases for other programs, adapters, and merging."""

import json
import py_compile
import shutil
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import jsonschema
import pytest
from click.testing import CliRunner
from texbake_cli.measurements import bench
from texbake_cli.pipelines import schema

from texbake import BakeOptions, TexbakeError, bake, read_mesh
from texbake.errors import FileFormatError
from texbake.progress import Stages
from texbake.study.bench.results_file import bench_schema, merge_results, read_results
from texbake.study.bench.run import bench_files, export_files
from texbake.study.options import BenchOptions

ADAPTERS = Path(__file__).parents[3] / "integrations" / "bench"
TASKS = ("bake-normals", "bake-displacement", "bake-ao", "simplify")
MACHINE = {"system": "Linux", "processor": "x86_64", "processors": 4}


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cases")
    options = BenchOptions(quick=True, cases=("two-parts", "hard-edges"), tasks=TASKS)
    files = export_files(folder, options).files
    assert {path.parent.name for path in files} == {"two-parts", "hard-edges"}
    return folder


@pytest.fixture
def cases(exported, tmp_path):
    return Path(shutil.copytree(exported, tmp_path / "cases"))


def jobs_of(folder, case, task):
    content = json.loads((folder / case / "settings.json").read_text("utf-8"))
    assert (content["case"], content["triangles"], content["quick"]) == (case, 4000, True)
    return [job for job in content["jobs"] if job["task"] == task]


def result_of(settings, left_out=()):
    contest = {"task": "bake-normals", "case": "two-parts", "triangles": 4000}
    return {
        "format": "texbake-bench", "version": 2, "date": "2026-11-27", "quick": True,
        "programs": {"other": {"version": "1.0", "machine": MACHINE}},
        "contests": [{**contest, "settings": settings, "left_out": list(left_out)}],
    }  # fmt: skip


def baked(folder, job):
    high, low = (read_mesh(folder / "two-parts" / job[key]) for key in ("high", "low"))
    options = BakeOptions(
        size=job["size"], front=job["distance"], back=job["distance"], padding=job["padding"]
    )
    bake(high, low, options).maps["normal"].write(folder / "map.png", bits=16)


def test_an_exported_case_has_all_that_a_program_needs(cases):
    for case in "two-parts", "hard-edges":
        assert len(jobs_of(cases, case, "bake-ao")) == (case == "two-parts")
        for job in jobs_of(cases, case, "bake-normals"):
            high, obj, low = (
                read_mesh(cases / case / job[key]) for key in ("high", "high_obj", "low")
            )
            assert high.n_faces == obj.n_faces and low.uvs is not None
            assert (obj.normals is not None) is job["has_normals"] is (case == "hard-edges")
    assert [job["samples"] for job in jobs_of(cases, "two-parts", "bake-normals")] == [1, 1, 4]


def test_errors_are_measured_from_maps_and_not_believed(cases, tmp_path):
    job = jobs_of(cases, "two-parts", "bake-normals")[1]
    baked(cases, job)
    entry = {"program": "other", "setting": job["setting"], "seconds": [2.0, 1.0]}
    settings = [
        {**entry, "output": "map.png", "form": "tangent", "error": 1e-9},
        {**entry, "setting": "stated", "error": 5.0, "peak_bytes": 7, "figures": {"charts": 2.0}},
        {**entry, "setting": "lost", "output": "gone.png"},
    ]
    left_out = [{"program": "other", "setting": "16", "reason": "exit code 3: no memory"}]
    (cases / "other.json").write_text(json.dumps(result_of(settings, left_out)))
    done = bench_files(tmp_path / "out", merge=[cases / "other.json"] * 2, run=False)
    (contest,) = done.report.contests
    # The same file twice is two programs, each with a name of its own.
    assert contest.programs == ["other", "other (other)"] == list(done.report.versions)
    assert contest.stated == ("other", "other (other)")
    measured, stated = contest.measurements[:2]
    assert 1e-6 < measured.error < 0.1 and measured.median == 1.5
    assert stated.error == 5.0 and stated.peak_bytes == 7
    assert {f.label: f.reason for f in contest.failures} == {
        "16": "exit code 3: no memory",
        "lost": "its file states no error, and gone.png is not there",
    }
    page = (tmp_path / "out" / "bench.html").read_text("utf-8")
    assert "other, lost, failed" in page and "are as its file states them" in page
    merged = tmp_path / "out" / "bench.json"
    jsonschema.validate(json.loads(merged.read_text("utf-8")), bench_schema())
    assert merge_results(None, [merged], Stages(None)).contests[0].programs == contest.programs


def test_what_is_wrong_with_a_result_file_is_one_line(tmp_path):
    path = tmp_path / "x.json"
    good = result_of([{"program": "other", "setting": "a", "seconds": [1.0], "error": 1.0}])
    path.write_text(json.dumps(good))
    assert read_results(path).contests[0].settings[0].error == 1.0
    for changed, message in (
        ({"version": 1}, "version"),
        ({"programs": {"other": {"version": "1", "machine": {**MACHINE, "host": "me"}}}}, "host"),
        ({"contests": [{**good["contests"][0], "task": "paint"}]}, "paint"),
        ({"contests": [{"task": "unwrap"}]}, "case"),
        ({"contests": [{**good["contests"][0], "triangles": 10**12}]}, "triangles"),
    ):
        path.write_text(json.dumps({**good, **changed}))
        with pytest.raises(FileFormatError, match=message) as raised:
            read_results(path)
        assert "\n" not in str(raised.value)
    for key, value, message in (
        ("program", "ghost", "ghost"),
        ("seconds", [0.0], "seconds"),
        ("seconds", [-1.0], "seconds"),
        ("seconds", [1e308], "seconds"),
        ("error", -1.0, "below 0"),
    ):
        path.write_text(json.dumps(result_of([{**good["contests"][0]["settings"][0], key: value}])))
        with pytest.raises(FileFormatError, match=message):
            read_results(path)
    entry = {**good["contests"][0]["settings"][0], "output": "../../secret.png"}
    path.write_text(json.dumps(result_of([entry])))
    with pytest.raises(TexbakeError, match="outside"):
        merge_results(None, [path], Stages(None))
    for text in ("{", "[" * 100_000):
        path.write_text(text)
        with pytest.raises(FileFormatError, match="not a result file"):
            read_results(path)


def test_the_schema_is_printed():
    done = CliRunner().invoke(schema, ["bench"], catch_exceptions=False)
    assert json.loads(done.output) == bench_schema()
    jsonschema.Draft202012Validator.check_schema(bench_schema())


def test_the_command_exports_and_merges(tmp_path):
    words = ["--quick", "--task", "simplify", "--case", "sphere", "--export", tmp_path / "cases"]
    done = CliRunner().invoke(bench, [*map(str, words)], catch_exceptions=False)
    assert done.exit_code == 0 and (tmp_path / "cases" / "sphere" / "settings.json").exists()
    entry = {"program": "other", "setting": "a", "seconds": [1.0], "error": 1.0}
    (tmp_path / "a.json").write_text(json.dumps(result_of([entry])))
    words = ["--merge", tmp_path / "a.json", "-o", tmp_path / "out"]
    done = CliRunner().invoke(bench, [*map(str, words)], catch_exceptions=False)
    assert done.exit_code == 0 and "bench.html" in done.output


def run_adapter(name, *words):
    command = [sys.executable, ADAPTERS / f"{name}.py", *words]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return done.stdout


def test_xnormal_gets_well_formed_files_with_the_right_paths(cases):
    run_adapter("xnormal", cases, "--dry-run")
    found = sorted(cases.glob("*/*.xml"))
    jobs = [
        job
        for case in ("hard-edges", "two-parts")
        for task in TASKS[:3]
        for job in jobs_of(cases, case, task)
    ]
    assert len(found) == len(jobs)
    for path in found:
        tree = ElementTree.parse(path)
        high, low = (Path(item.attrib["File"]) for item in tree.iter("Mesh"))
        assert high.exists() and low.exists() and high.suffix == low.suffix == ".obj"
        maps = tree.find("GenerateMaps").attrib
        assert Path(maps["File"]).parent == path.parent and maps["EdgePadding"] == "16"
        asked = [key for key, value in maps.items() if key.startswith("Gen") and value == "true"]
        assert len(asked) == 1
    sizes = {ElementTree.parse(path).find("GenerateMaps").get("Width") for path in found}
    assert sizes == {"32", "64"}


def test_toolbag_gets_scripts_that_bake_with_its_interface(cases, tmp_path):
    run_adapter("toolbag", cases, "--dry-run")
    found = sorted(cases.glob("*/toolbag-*.py"))
    assert len(found) == len(list(cases.glob("*/toolbag-bake-*.py"))) == 7
    # A stand-in for the module of Toolbag, which notes what is asked of it.
    (tmp_path / "mset.py").write_text(
        "from unittest.mock import MagicMock\nimport sys\nsys.modules['mset'] = MagicMock()\n"
    )
    for path in found:
        py_compile.compile(str(path), doraise=True)
        done = subprocess.run(
            [sys.executable, path], env={"PYTHONPATH": str(tmp_path)}, capture_output=True
        )
        assert done.returncode == 0, done.stderr


def test_an_adapter_times_its_program_and_names_what_failed(cases, tmp_path):
    """With a Python in place of Blender, which bakes nothing."""
    script = (
        "import sys; sys.path.insert(0, sys.argv.pop(1))\n"
        "from adapter import do_jobs, parser\n"
        "def command_of(job, stem):\n"
        "    out = stem.with_suffix('.png')\n"
        "    code = f'open({str(out)!r}, \"w\")' if job['size'] == 32 else 'raise SystemExit(3)'\n"
        "    return ([sys.executable, '-c', code], out, 'tangent') if 'high' in job else None\n"
        "do_jobs(parser('').parse_args(), 'Other', '1.0', lambda j, s: "
        "command_of({'size': 64, **j}, s))\n"
    )
    subprocess.run(
        [sys.executable, "-P", "-c", script, ADAPTERS, cases, "--repeats", "2"], check=True
    )
    report = json.loads((cases / "other.json").read_text("utf-8"))
    jsonschema.validate(report, bench_schema())
    assert [contest["task"] for contest in report["contests"]] == [*TASKS[:2], *TASKS[:3]]
    (entry,) = report["contests"][0]["settings"]
    assert len(entry["seconds"]) == 2 and (cases / entry["output"]).exists()
    assert {item["reason"] for c in report["contests"] for item in c["left_out"]} == {
        "exit code 3: it wrote no file"
    }
    assert run_adapter("blender", "--help")
