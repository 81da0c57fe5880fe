"""A real scheduler and real workers on the loopback address."""

import os
import queue
import signal
import socket
import subprocess
import sys
import threading
import time
from contextlib import ExitStack
from dataclasses import replace
from types import SimpleNamespace

import pytest

from tests.building.dask_cluster import (
    DEADLY,
    ENDING,
    LOGGING,
    OTHER_FOLDERS,
    OTHER_VERSION,
    WITHOUT_TEXBAKE,
    Cluster,
    wait_for,
)
from texbake import BuildOptions, FileError, OptionError, build
from texbake.building import dask_scheduler
from texbake.building.store import Store
from texbake.building.task import Task, TaskOutcome

pytest.importorskip("distributed", reason="the extra `dask` is not installed")


pytestmark = pytest.mark.filterwarnings("ignore")  # of Dask's own, as a worker goes


@pytest.fixture
def cluster(tmp_path):
    with ExitStack() as stack:
        made = Cluster(tmp_path / "dask")
        stack.callback(made.close)
        made.wait(2)
        yield made


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    made = Cluster(tmp_path_factory.mktemp("whole") / "dask")
    made.wait(2)
    yield made
    made.close()


@pytest.fixture
def standing(whole):
    """A cluster that tests share which leave it as it is."""
    whole.forget()
    return whole


ASSETS = "".join(
    f'[[assets]]\nname = "{number}"\noptions.high.radius = {1 + number}\n' for number in range(6)
)


def test_a_cluster_of_which_one_worker_is_killed(write, tmp_path, cluster, contents, run):
    path = write(ASSETS)
    run(path, folder=tmp_path / "here")
    finished = []

    def kill(event):
        if event.state == "built":
            finished.append((event.asset, event.step))
            if len(finished) == 4:
                os.kill(cluster.workers[0].pid, signal.SIGKILL)

    options = BuildOptions(scheduler=cluster.address, folder=tmp_path / "there")
    result = build(path, options, listener=kill)
    assert result.ok
    assert len(finished) == len(set(finished)) == 18  # nothing twice, nothing lost
    assert contents(tmp_path / "there") == contents(tmp_path / "here")
    assert len(list((tmp_path / "there" / ".texbake" / "store").glob("??/*"))) == 18
    # What is stored is not made again, but a step of the killed worker that was not stored yet.
    assert len(cluster.steps_made) == 18 and cluster.made_again == []
    assert sum(cluster.steps_made.values()) <= 19
    assert build(path, options).count_steps("current") == 18

    # And a scheduler that goes away, which what is done survives.
    def end(event):
        if event.state == "built":
            cluster.scheduler.kill()
            cluster.scheduler.wait()

    options = BuildOptions(scheduler=cluster.address, folder=tmp_path / "lost")
    with pytest.raises(FileError, match="the scheduler has disappeared; build again"):
        build(path, options, listener=end)
    result, steps = run(path, folder=tmp_path / "lost")
    assert result.ok and len(steps) < 18
    assert contents(tmp_path / "lost") == contents(tmp_path / "here")


@pytest.fixture
def mute():
    """A server that listens, and is no scheduler."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield f"127.0.0.1:{server.getsockname()[1]}"


def test_a_scheduler_that_is_not_there(write, monkeypatch, mute):
    monkeypatch.setattr(dask_scheduler, "_ANSWER_SECONDS", 0.5)
    for address in ("tcp://127.0.0.1:9", f"tcp://{mute}", "tcp://no.such.host.invalid:8786",
                    "http://127.0.0.1:9", "tcp://127.0.0.1", "tcp://"):  # fmt: skip
        start = time.monotonic()
        with pytest.raises(FileError, match="no Dask scheduler answers there; start one with"):
            build(write(), BuildOptions(scheduler=address))
        assert time.monotonic() - start < 10
    with pytest.raises(OptionError, match="is in this process"):
        build(write(head='outputs = "memory://x"\n'), BuildOptions(scheduler="tcp://127.0.0.1:9"))
    with pytest.raises(OptionError, match="jobs, scheduler"):
        build(write(), BuildOptions(scheduler="tcp://127.0.0.1:9", jobs=2))


def test_workers_that_are_not_fit(write, tmp_path, standing):
    path = write(ASSETS)
    options = BuildOptions(scheduler=standing.address, folder=tmp_path / "there")
    for preload, fault in (
        (OTHER_VERSION, r"has texbake 0\.0\.1, this is .*; install the same there"),
        (WITHOUT_TEXBAKE, "cannot load texbake .*; install .* there"),
        (OTHER_FOLDERS, "does not see the store, .*; share this folder with it"),
    ):
        worker = standing.add_worker(preload)
        standing.wait(3)
        with pytest.raises(FileError, match=f"the worker tcp://.* {fault}"):
            build(path, options)
        standing.end(worker)
    assert not standing.steps_made


def test_two_builds_at_one_store_share_their_steps(write, tmp_path, standing, contents):
    path = write(ASSETS, head=f'store = "{(tmp_path / "store").as_posix()}"\n')
    results = []

    def one(name):
        options = BuildOptions(scheduler=standing.address, folder=tmp_path / name)
        results.append(build(path, options).ok)

    threads = [threading.Thread(target=one, args=(name,)) for name in "ab"]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert results == [True, True]
    assert set(standing.steps_made.values()) == {1} and len(standing.steps_made) == 18
    assert contents(tmp_path / "a") == contents(tmp_path / "b")


def test_a_cluster_whose_workers_all_go(write, tmp_path, cluster, monkeypatch, run):
    monkeypatch.setattr(dask_scheduler, "_LOOK_SECONDS", 0.1)
    monkeypatch.setattr(dask_scheduler, "_GONE_SECONDS", 0.5)
    notes = []

    def end(event):
        if event.event == "note" and event.message:
            notes.append(event.message)
        for worker in list(cluster.workers) if event.state == "built" else ():
            cluster.end(worker)

    options = BuildOptions(scheduler=cluster.address, folder=tmp_path / "there")
    with pytest.raises(FileError, match="all its workers have disappeared; start some with: dask"):
        build(write(ASSETS), options, listener=end)
    assert set(notes) == {
        f"{cluster.address}: it has no workers left; start some with: dask worker {cluster.address}"
    }
    (store,) = tmp_path.glob("**/store")
    # A worker that ends while it commits a step has logged it, but the store does not have it.
    kept = [key for key in cluster.steps_made if Store(str(store)).find(key)]
    assert kept
    _, steps = run(write(ASSETS), folder=tmp_path / "there")
    assert len(steps) == 18 - len(kept)


TASK = Task(
    key="a", asset="a", step="bake", kind="bake", settings={}, inputs={}, outputs={},
    ingredients={}, store="here", threads=1, memory_bytes=8 << 30,
)  # fmt: skip


class Submissions:
    """A client of two workers with different memory, which keeps what is submitted."""

    status = "running"

    def __init__(self):
        self.workers = {
            name: {"nthreads": 2, "memory_limit": limit}
            for name, limit in (("small", 2 << 30), ("large", 32 << 30))
        }
        self.made = []

    def scheduler_info(self, n_workers):
        return {"workers": self.workers}

    def submit(self, *arguments, **options):
        late = [TimeoutError]  # the first time

        def result(timeout):
            if late:
                raise late.pop()
            return TaskOutcome(error="an answer")

        future = SimpleNamespace(**options, done=[], released=[], result=result, status="finished")
        future.add_done_callback = future.done.append
        future.release = lambda: future.released.append(True)
        self.made.append(future)
        return future


def test_a_step_runs_on_workers_that_have_the_memory(monkeypatch):
    monkeypatch.setattr(dask_scheduler, "_LOOK_SECONDS", 0.0)
    client = Submissions()
    workers = object.__new__(dask_scheduler.DaskWorkers)
    vars(workers).update(
        _address="tcp://here:1", _client=client, _outcomes=queue.SimpleQueue(), _gone=None,
        _looked=0.0, _submissions={}, _max_memory=None,
        _memory=dask_scheduler._memory_of_a_task(client.workers),
    )  # fmt: skip
    workers.submit(0, TASK)
    workers.submit(1, replace(TASK, key="b", memory_bytes=1 << 20))
    first, other = client.made
    assert (first.workers, first.allow_other_workers) == (["large"], False)
    assert (other.workers, other.allow_other_workers) == (None, False)
    workers.finished(0.0)
    assert len(client.made) == 2  # both may run
    del client.workers["large"]
    workers.finished(0.0)
    _, _, again = client.made  # rather in chunks than not at all
    assert (again.workers, again.allow_other_workers) == (None, False)
    assert first.released and again.key != first.key
    for future in first, again:
        for call in future.done:
            call(future)
    ((number, outcome),) = workers.finished(0.0)
    assert (number, outcome.error) == (0, "an answer")


def test_a_step_that_ends_its_workers(write, tmp_path, monkeypatch):
    """Dask gives a step up once it has ended some workers; all other assets are finished."""
    monkeypatch.setenv("DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES", "1")
    cluster = Cluster(tmp_path / "dask", n_workers=0)
    try:
        for _ in range(3):
            cluster.add_worker(LOGGING + ENDING)
        cluster.wait(3)
        options = BuildOptions(scheduler=cluster.address, folder=tmp_path / "there")
        result = build(write(ASSETS), options)
    finally:
        cluster.close()
    ended = [(asset.name, step) for asset in result.assets for step in asset.steps if step.error]
    ((asset, step),) = ended
    assert (asset, step.step) == DEADLY
    assert "2 workers ended that were to run this step, the last one tcp://127.0.0.1:" in step.error
    assert "the system may have run out of memory" in step.error and "\n" not in step.error
    assert len(cluster.steps_made) == 17


def test_an_interrupted_build_leaves_no_tasks(write, standing):
    path = write(ASSETS)
    code = "from texbake_cli import run; run()"
    client = subprocess.Popen(
        [sys.executable, "-P", "-c", code, "build", str(path), "--scheduler", standing.address],
        stderr=subprocess.PIPE,
        text=True,
    )
    wait_for(lambda: standing.steps_made)
    client.send_signal(signal.SIGINT)
    said = client.communicate(timeout=30)[1].splitlines()
    assert client.returncode == 128 + signal.SIGINT and len(said) == 1
    standing.ask(
        lambda asked: wait_for(
            lambda: asked.run_on_scheduler(lambda dask_scheduler: not dask_scheduler.tasks)
        )
    )
    n_made = len(standing.steps_made)
    time.sleep(0.3)
    # A step that was running is made to its end; no other one is begun.
    assert len(standing.steps_made) <= n_made + 2 and n_made < 18
    assert build(path, BuildOptions(scheduler=standing.address)).ok
    assert set(standing.steps_made.values()) == {1} and len(standing.steps_made) == 18
