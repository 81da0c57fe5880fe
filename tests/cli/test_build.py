"""`texbake build` and `texbake watch` as a person runs them."""

import json
import signal
import subprocess
import time

import pytest

PIPELINE = """
[[assets]]
name = "ball"
[[assets]]
name = "large ball"
options.high.radius = 3.0
[steps.high]
do = "make"
shape = "sphere"
resolution = [16, 8]
output = "{asset}.{ext}"
[steps.clean]
do = "repair"
mesh = "high"
"""


@pytest.fixture
def pipeline(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "p.toml"
    path.write_text(PIPELINE)
    return path


def test_a_plan_a_build_and_nothing_left_to_do(pipeline, invoke):
    plan = invoke("build p.toml --plan")
    assert "it has not run before" in plan.stdout and "2 runs, 2 may run" in plan.stdout
    assert not (pipeline.parent / "build").exists()
    done = invoke("build p.toml --jobs 1")
    assert "2 built, 0 current" in done.stdout
    assert (pipeline.parent / "build" / "large ball.ply").is_file()
    assert "0 built, 2 current" in invoke("build p.toml --jobs 1").stdout
    assert "4 current" in invoke("build p.toml --plan").stdout


def test_a_page_does_not_overwrite_the_pipeline_file(pipeline, invoke):
    message = invoke("build p.toml --html p.toml", exit_code=1).stderr
    assert message == "texbake: p.toml: a page cannot be written as '.toml'; use .html\n"
    assert pipeline.read_text() == PIPELINE and not (pipeline.parent / "build").exists()


def test_progress_as_json(pipeline, run):
    done = run("build p.toml --jobs 2 --progress json -o elsewhere")
    assert done.returncode == 0, done.stderr
    events = [json.loads(line) for line in done.stderr.splitlines()]
    assert events[0] == {"event": "began", "done": 0, "total": 4}
    assert events[-1] == {"event": "ended", "done": 4, "total": 4}
    built = [event for event in events if event.get("state") == "built"]
    assert [event["done"] for event in built] == [1, 2, 3, 4]
    assert all(event["seconds"] > 0 and event["seconds_left"] >= 0 for event in built)
    assert (pipeline.parent / "elsewhere" / "build.json").is_file()


def test_failures_are_a_line_each_and_exit_code_1(pipeline, invoke):
    limits = '[steps.limits]\ndo = "check"\nmesh = "clean"\nmax_faces = 3\nfail_on = "never"\n'
    pipeline.write_text(PIPELINE + limits)
    done = invoke("build p.toml --jobs 2", exit_code=1)
    lines = done.stderr.splitlines()
    assert len(lines) == 2
    assert lines[0].startswith("texbake: ball: limits: clean") or "more than max_faces" in lines[0]
    assert "2 failed" in done.stdout
    report = json.loads((pipeline.parent / "build" / "build.json").read_text())
    assert [asset["state"] for asset in report["assets"]] == ["failed", "failed"]


def test_an_error_in_the_file_is_one_line(pipeline, invoke):
    pipeline.write_text(PIPELINE.replace("resolution", "resolutoin"))
    done = invoke("build p.toml", exit_code=1)
    assert done.stderr == (
        "texbake: p.toml:10: steps.high.resolutoin: unknown key; did you mean 'resolution'?\n"
    )
    assert (
        "max-memory: 'lots' is not an amount"
        in invoke("build p.toml --max-memory lots", exit_code=2).stderr
    )


def test_watch_builds_saved_changes_until_it_is_stopped(pipeline, script):
    with subprocess.Popen(
        [script, "watch", "p.toml", "--jobs", "1"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # A shell that runs this in the background has it ignored.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    ) as process:

        def until_watching():
            output = ""
            while not output.endswith("watching ...\n"):
                line = process.stdout.readline()
                assert line, process.stderr.read()
                output += line
            return output

        try:
            assert "2 built" in until_watching()
            pipeline.write_text(PIPELINE.replace("3.0", "4.0"))
            assert "1 built, 1 current" in until_watching()
            process.send_signal(signal.SIGINT)
            deadline = time.monotonic() + 20
            while process.poll() is None:
                assert time.monotonic() < deadline
                time.sleep(0.05)
            assert process.returncode == 130
        finally:
            process.kill()  # or leaving the block would wait for a process that goes on


def test_the_live_table_shows_running_steps_and_their_times():
    from rich.console import Console
    from texbake_cli.live import BuildTable

    from texbake.building.schedule import BuildEvent

    console = Console(width=100, record=True, force_terminal=True, file=open("/dev/null", "w"))  # noqa: SIM115, PTH123
    table = BuildTable(console)
    table.add(BuildEvent(event="began", total=8))
    table.add(
        BuildEvent(event="step", asset="vase", step="bake", state="running", total=8,
                   seconds_left=75.0)
    )  # fmt: skip
    table.add(BuildEvent(event="step", asset="egg", step="low", state="failed", message="why",
                          done=3, total=8))  # fmt: skip
    console.print(table._table())
    text = console.export_text()
    console.file.close()
    assert "egg: low: why" in text
    assert "vase" in text and "bake" in text
    assert "3 of 8 steps" in text and "1:15 left" in text and "1 failed" in text
