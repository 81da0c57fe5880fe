"""A Dask scheduler and workers on the loopback address, which log the steps that they make."""

import os
import socket
import subprocess
import sys
import time
from collections import Counter

# Logs the key of each step that a worker makes. Dask runs this twice in each process.
LOGGING = """
import os
from texbake.building.store import Store
def logged(self, key, *arguments, commit=Store.commit):
    again = " again" * (self.find(key) is not None)
    with open(os.environ["STEPS_MADE"], "a") as file:
        file.write(key + again + chr(10))
    return commit(self, key, *arguments)
if Store.commit.__name__ != "logged":
    Store.commit = logged
"""
# Ends with its process, as if the system had run out of memory, once all other steps are made: a
# step that waits on a worker as it ends counts as one that ended it.
DEADLY = ("3", "maps")
ENDING = f"""
import os
import time
from pathlib import Path
from texbake.building import dask_scheduler
def ending(task, run_task=dask_scheduler.run_task):
    if (task.asset, task.step) == {DEADLY}:
        deadline = time.monotonic() + 60
        while len(Path(os.environ["STEPS_MADE"]).read_text().splitlines()) < 17:
            assert time.monotonic() < deadline
            time.sleep(0.02)
        os._exit(9)
    return run_task(task)
if dask_scheduler.run_task.__name__ != "ending":
    dask_scheduler.run_task = ending
"""
# Workers that something is wrong with.
OTHER_VERSION = "import texbake\ntexbake.__version__ = '0.0.1'\n"
WITHOUT_TEXBAKE = "import sys\nsys.modules['texbake'] = None\n"
OTHER_FOLDERS = """
from texbake.building.locations import LocalFolder
LocalFolder.path = lambda self, name: f"/other{self.place}/{name}"
"""


def wait_for(condition, seconds=60):
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)


class Cluster:
    """Processes of a scheduler and of workers, each with one thread."""

    def __init__(self, folder, n_workers=2):
        folder.mkdir(parents=True)
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        self.address = f"tcp://127.0.0.1:{port}"
        self.folder = folder
        self.scheduler = self._start(
            "scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard"
        )
        self.workers = []
        for _ in range(n_workers):
            self.add_worker()

    def add_worker(self, preload=LOGGING):
        """Start a worker, which runs the code of `preload` first."""
        file = self.folder / f"preload{len(self.workers)}.py"
        file.write_text(preload)
        worker = self._start(
            "worker", self.address, "--nthreads", "1", "--no-nanny", "--no-dashboard",
            "--local-directory", str(self.folder), "--death-timeout", "20",
            "--preload", str(file),
        )  # fmt: skip
        self.workers.append(worker)
        return worker

    def _start(self, *words):
        return subprocess.Popen(
            [sys.executable, "-P", "-m", "distributed.cli.dask_" + words[0], *words[1:]],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env={**os.environ, "STEPS_MADE": str(self.folder / "steps_made")},
        )

    def forget(self):
        """Log from the start again."""
        (self.folder / "steps_made").unlink(missing_ok=True)

    def ask(self, question):
        from distributed import Client

        client = Client
        with client(self.address, timeout=60, set_as_default=False) as made:
            return question(made)

    def wait(self, n_workers):
        self.ask(
            lambda client: wait_for(lambda: len(client.scheduler_info()["workers"]) == n_workers)
        )

    def end(self, worker):
        """Kill a worker, and wait until the scheduler knows."""
        worker.kill()
        worker.wait()
        self.workers.remove(worker)
        self.wait(len(self.workers))

    @property
    def steps_made(self):
        """How often each key was made."""
        return Counter(line.split()[0] for line in self._made())

    @property
    def made_again(self):
        """Keys that were made though the store had their results already."""
        return [line.split()[0] for line in self._made() if line.endswith("again")]

    def _made(self):
        file = self.folder / "steps_made"
        return file.read_text().splitlines() if file.exists() else []

    def close(self):
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait()
