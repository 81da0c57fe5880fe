"""Workers that are killed, and how much memory steps may use together."""

import json
import os
import resource
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace

import pytest

from texbake import BuildOptions, build
from texbake.baking.memory import PROCESS, TREE_FACE
from texbake.building import resolve
from texbake.building.digests import checksum
from texbake.building.resolve import size_by_length, size_of
from texbake.building.schedule import EtaEstimator
from texbake.building.steps import STEP_KINDS
from texbake.building.task import Task, memory_advice, run_task
from texbake.building.workers import LocalWorkers

# Long enough to be met in the middle by whoever kills.
SLOW = """
[steps.slow]
do = "make"
shape = "orange"
triangles = 400_000
output = "{asset}.ply"
"""


def orange_task(tmp_path, number, triangles):
    kind = STEP_KINDS["make"]
    ingredients = {"number": number}
    return Task(
        asset="a", step="make", kind="make",
        settings=kind.settings({"shape": "orange", "triangles": triangles}), inputs={},
        outputs={"mesh": "mesh.ply"}, key=checksum(ingredients), ingredients=ingredients,
        store=str(tmp_path / "store"), threads=1,
    )  # fmt: skip


def wait_for(condition):
    deadline = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.005)


def test_a_killed_worker_is_replaced_and_its_step_done(workers, write):
    crew = workers(2)
    killed = []

    def kill(event):
        if event.state == "running" and event.asset == "a" and not killed:
            wait_for(lambda: crew.process_ids)
            time.sleep(0.3)
            killed.extend(crew.process_ids[:1])
            os.kill(killed[0], signal.SIGKILL)

    assets = "".join(f'[[assets]]\nname = "{n}"\noptions.slow.triangles = {t}\n'
                     for n, t in (("a", 300_000), ("b", 40_000), ("c", 20_000)))  # fmt: skip
    path = write(assets, SLOW)
    result = build(path, listener=kill, workers=crew)
    assert result.ok
    steps = [asset.steps[0] for asset in result.assets]
    assert sorted(step.attempts for step in steps) == [1, 1, 2]
    (noted,) = [step for step in steps if step.attempts == 2]
    assert noted.notes == ("its worker ended; another one ran it",)
    assert killed[0] not in crew.process_ids


def test_a_step_whose_workers_are_killed_twice_fails_and_others_go_on(workers, tmp_path):
    crew = workers(1)
    crew.submit(1, orange_task(tmp_path, 1, 5_000_000))
    crew.submit(2, orange_task(tmp_path, 2, 1_000))
    killed = set()
    for _ in range(2):
        wait_for(lambda: set(crew.process_ids) - killed)
        (worker,) = set(crew.process_ids) - killed
        os.kill(worker, signal.SIGKILL)
        killed.add(worker)
    outcomes = {}
    while len(outcomes) < 2:
        outcomes.update(crew.finished(60))
    assert outcomes[1].error.startswith("its worker ended (SIGKILL), twice; the system may have")
    assert outcomes[2].manifest is not None


def test_workers_end_with_their_build(tmp_path):
    crew = LocalWorkers(1, 1)
    crew.submit(1, orange_task(tmp_path, 1, 5_000_000))
    wait_for(lambda: crew.process_ids)
    (worker,) = crew.process_ids
    crew.close()
    with pytest.raises(ProcessLookupError):
        os.kill(worker, 0)


def test_a_worker_with_another_version_is_refused(tmp_path):
    task = orange_task(tmp_path, 1, 1000)
    outcome = run_task(replace(task, version="9.9"))
    assert outcome.manifest is None
    assert "this build 9.9; install the same there" in outcome.error


def test_a_task_that_was_done_is_not_done_again(tmp_path):
    task = orange_task(tmp_path, 1, 1000)
    first = run_task(task)
    file = next((tmp_path / "store").rglob("mesh.ply"))
    written = file.stat()
    again = run_task(task)
    assert first.manifest and again.manifest == first.manifest
    assert file.stat() == written


def test_two_workers_at_one_task_agree(tmp_path):
    task = orange_task(tmp_path, 1, 50_000)
    outcomes = []
    threads = [threading.Thread(target=lambda: outcomes.append(run_task(task))) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    made = [outcome.manifest["outputs"] for outcome in outcomes if outcome.manifest]
    assert len(made) == 4 and all(outputs == made[0] for outputs in made)
    assert list((tmp_path / "store" / "tmp").iterdir()) == []


def test_steps_share_the_memory(write, inline):
    assets = "".join(f'[[assets]]\nname = "{n}"\noptions.slow.triangles = {1000 + n}\n'
                     for n in range(6))  # fmt: skip
    path = write(assets, SLOW)
    memory = STEP_KINDS["make"].memory(
        STEP_KINDS["make"].settings({"shape": "orange", "triangles": 1000}), {}
    )
    for budget, most in ((int(2.5 * memory), 2), (memory // 2, 1), (100 * memory, 4)):
        crew = inline(slots=4)
        folder = path.parent / str(budget)
        result = build(path, BuildOptions(max_memory=budget, folder=folder), workers=crew)
        assert result.ok
        assert crew.most_at_once == most


def test_triangles_are_counted_without_reading_a_mesh(tmp_path):
    assert run_task(orange_task(tmp_path, 1, 2000)).manifest is not None
    size = size_of(next((tmp_path / "store").rglob("mesh.ply")))
    assert size.n_faces == 2000
    assert size_by_length("a.stl", 84 + 50 * 1000).n_faces == 1001
    assert size_of(tmp_path / "nothing.ply").n_faces == 0
    settings = STEP_KINDS["bake"].settings({"size": 1})
    assert STEP_KINDS["bake"].memory(settings, {"high": (size,)}) > PROCESS + 2000 * TREE_FACE


def test_the_time_left_is_that_of_steps_of_the_same_kind(monkeypatch):
    now = 0.0
    monkeypatch.setattr(time, "perf_counter", lambda: now)
    kinds = {(name, "b"): "bake" for name in "abcd"} | {(name, "u"): "unwrap" for name in "abc"}
    eta = EtaEstimator(kinds, slots=2)
    eta.drop(("c", "u"))
    eta.drop(("c", "u"))
    assert eta.seconds_left() is None
    eta.started(("a", "b"))
    now = 6.0
    assert eta.ended(("a", "b")) == 6.0
    # Three bakes of 6 s are left, and two steps of a kind of which nothing is known yet.
    assert eta.seconds_left() == (3 + 2) * 6.0 / 2
    eta.started(("b", "b"))
    eta.started(("a", "u"))
    now = 8.0
    assert eta.seconds_left() == ((3 + 2) * 6.0 - 2.0 - 2.0) / 2
    eta.ended(("a", "u"))  # 2 s; the mean of both is 4 s
    assert eta.seconds_left() == (3 * 6.0 + 1 * 2.0 - 2.0) / 2


def test_a_worker_that_cannot_be_started_fails_its_step(tmp_path, workers, monkeypatch):
    monkeypatch.setattr(sys, "executable", str(tmp_path / "gone"))
    crew = workers(1)
    for number in range(2):  # the thread goes on
        crew.submit(number, orange_task(tmp_path, number, 100))
        ((answered, outcome),) = crew.finished(20)
        assert answered == number
        assert "no worker can be started: No such file" in outcome.error


def test_an_invalid_answer_fails_its_step(tmp_path, workers, monkeypatch):
    babbler = tmp_path / "babbler"
    babbler.write_text("#!/bin/sh\necho not JSON\nexec sleep 60\n")
    babbler.chmod(0o755)
    crew = workers(1)
    with monkeypatch.context() as patch:
        patch.setattr(sys, "executable", str(babbler))
        crew.submit(0, orange_task(tmp_path, 0, 100))
        ((_, outcome),) = crew.finished(20)
    assert outcome.error == "its worker gave an invalid answer"
    crew.submit(1, orange_task(tmp_path, 1, 100))  # by another
    ((_, outcome),) = crew.finished(60)
    assert outcome.manifest is not None


GB = 1 << 30
COMMAND = [sys.executable, "-P", "-c", "from texbake_cli import run; run()"]


def limited(n_bytes, kind=resource.RLIMIT_AS):
    return lambda: resource.setrlimit(kind, (n_bytes, n_bytes))


@pytest.mark.parametrize(("line", "files", "limits"), [
    ("0::/a/b", {"a/b/memory.max": "max\n", "a/memory.max": f"{3 * GB}\n"}, [3 * GB]),
    ("0::/", {"memory.max": f"{2 * GB}\n"}, [2 * GB]),  # a container sees its own as the root
    ("4:memory:/a", {"memory/a/memory.limit_in_bytes": f"{4 * GB}"}, [4 * GB]),
    ("4:cpu,memory:/gone", {"memory/memory.limit_in_bytes": f"{GB}"}, [GB]),
    ("1:cpu:/a", {"a/memory.max": f"{GB}", "memory.max": f"{GB}"}, []),
])  # fmt: skip
def test_limits_of_control_groups(tmp_path, line, files, limits):
    groups = tmp_path / "cgroup"
    groups.write_text(f"12:pids:/x\n{line}\n")
    for name, text in files.items():
        (tmp_path / "fs" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "fs" / name).write_text(text)
    assert resolve._group_limits(groups, tmp_path / "fs") == limits
    assert resolve._group_limits(tmp_path / "none", tmp_path) == []


def test_advice_says_whether_fewer_jobs_would_help():
    values = {
        "asset": "a", "step": "s", "kind": "make", "settings": {}, "inputs": {}, "outputs": {},
        "key": "", "ingredients": {}, "store": "", "threads": 1, "memory_bytes": 5 * GB,
    }  # fmt: skip
    assert "run fewer jobs" in memory_advice(Task(**values, most_memory=8 * GB))
    assert "run fewer jobs" in memory_advice(Task(**values))
    most = memory_advice(Task(**values, most_memory=3 * GB))
    assert "5.0 GB, of the 3.0 GB that this build may use" in most and "jobs" not in most


def test_a_step_that_does_not_fit_fails_with_one_line(write, tmp_path):
    assets = "".join(f'[[assets]]\nname = "{name}"\noptions.ball.triangles = {n}\n'
                     for name, n in (("large", 20_000_000), ("small", 1000)))  # fmt: skip
    steps = '[steps.ball]\ndo = "make"\nshape = "orange"\noutput = "{asset}.ply"\n'
    done = subprocess.run(
        [*COMMAND, "build", os.fspath(write(assets, steps)), "--jobs", "1", "--quiet"],
        preexec_fn=limited(600 << 20), capture_output=True, text=True,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"}, check=False,
    )  # fmt: skip
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert line.startswith("texbake: large: ball: out of memory; it is estimated to take up to ")
    report = json.loads((tmp_path / "build" / "build.json").read_text())
    assert [asset["state"] for asset in report["assets"]] == ["failed", "built"]
