"""A real scheduler and real workers on the loopback address."""

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from texbake import FileError, OptionError
from texbake.building.build import build
from texbake.building.options import BuildOptions
from texbake.building.progress import BuildEvent

pytest.importorskip("distributed", reason="the extra `dask` is not installed")


class Cluster:
    """Processes of a scheduler and of workers."""

    def __init__(self, folder: Path) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        self.address = f"tcp://127.0.0.1:{port}"
        self.folder = folder
        self.scheduler = self._start(
            "scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard"
        )
        self.workers = [self.add_worker() for _ in range(2)]

    def add_worker(self) -> subprocess.Popen[bytes]:
        return self._start(
            "worker", self.address, "--nthreads", "1", "--no-nanny", "--no-dashboard",
            "--local-directory", str(self.folder), "--death-timeout", "20",
        )  # fmt: skip

    def _start(self, *words: str) -> subprocess.Popen[bytes]:
        return subprocess.Popen(
            [sys.executable, "-P", "-m", "distributed.cli.dask_" + words[0], *words[1:]],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )

    def wait(self) -> None:
        from distributed import Client

        with Client(self.address, timeout=60, set_as_default=False) as client:
            client.wait_for_workers(2, timeout=60)

    def close(self) -> None:
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait()


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    with ExitStack() as stack:
        made = Cluster(tmp_path / "dask")
        stack.callback(made.close)
        made.wait()
        yield made


ASSETS = "".join(
    f'[[assets]]\nname = "{number}"\noptions.high.radius = {1 + number}\n' for number in range(6)
)


@pytest.mark.filterwarnings("ignore")  # of Dask's own, as a worker goes
def test_a_cluster_of_which_one_worker_is_killed(
    write: Any, tmp_path: Path, cluster: Cluster, contents: Callable[..., Any], run: Any
) -> None:
    path = write(ASSETS)
    run(path, folder=tmp_path / "here")
    finished: list[tuple[str | None, str | None]] = []

    def kill(event: BuildEvent) -> None:
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
    assert build(path, options).count_steps("current") == 18

    # And a scheduler that goes away, which what is done survives.
    def end(event: BuildEvent) -> None:
        if event.state == "built":
            cluster.scheduler.kill()
            cluster.scheduler.wait()

    options = BuildOptions(scheduler=cluster.address, folder=tmp_path / "lost")
    with pytest.raises(FileError, match="the scheduler has disappeared; build again"):
        build(path, options, listener=end)
    result, steps = run(path, folder=tmp_path / "lost")
    assert result.ok and len(steps) < 18
    assert contents(tmp_path / "lost") == contents(tmp_path / "here")


@pytest.mark.filterwarnings("ignore")
def test_a_scheduler_that_is_not_there(write: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    from texbake.building import dask_scheduler

    monkeypatch.setattr(dask_scheduler, "_ANSWER_SECONDS", 0.5)
    start = time.monotonic()
    with pytest.raises(FileError, match="no Dask scheduler answers there; start one with"):
        build(write(), BuildOptions(scheduler="tcp://127.0.0.1:9"))
    assert time.monotonic() - start < 10
    with pytest.raises(OptionError, match="is in this process"):
        build(write(head='outputs = "memory://x"\n'), BuildOptions(scheduler="tcp://127.0.0.1:9"))
    with pytest.raises(OptionError, match="jobs, scheduler"):
        build(write(), BuildOptions(scheduler="tcp://127.0.0.1:9", jobs=2))
