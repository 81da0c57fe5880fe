"""Builds and workers killed at any moment: the next run completes with the right files."""

import os
import random
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest

from texbake.building.digests import Digests
from texbake.building.store import Store

CODE = """
import sys
from texbake.building.build import build
from texbake.building.options import BuildOptions
result = build(sys.argv[1], BuildOptions(folder=sys.argv[2], jobs=2))
sys.exit(0 if result.ok else 1)
"""
N_KILLS = int(os.environ.get("TEXBAKE_KILLS", "4"))


def start(path, folder):
    return subprocess.Popen([sys.executable, "-P", "-c", CODE, str(path), str(folder)])


def children(parent):
    """Processes that a process has started; Linux only."""
    path = Path(f"/proc/{parent}/task/{parent}/children")
    threads = Path(f"/proc/{parent}/task")
    found = []
    if path.exists():
        for thread in threads.iterdir():
            try:
                found += map(int, (thread / "children").read_text().split())
            except OSError:
                continue
    return found


@pytest.mark.skipif(sys.platform != "linux", reason="finds the workers in /proc")
def test_random_kills(write, tmp_path, contents):
    """`TEXBAKE_KILLS=30` runs as many as the documentation reports."""
    assets = "".join(
        f'[[assets]]\nname = "{number}"\noptions.high.radius = {1 + number / 4}\n'
        for number in range(5)
    )
    path = write(assets)
    assert start(path, tmp_path / "undisturbed").wait() == 0
    expected = contents(tmp_path / "undisturbed")
    assert len(expected) == 20

    random.seed(6)
    folder = tmp_path / "killed"
    kills = 0
    while kills < N_KILLS:
        if kills and kills % 6 == 0:  # from the start again, or all would soon be done
            folder = tmp_path / f"killed{kills}"
        build = start(path, folder)
        time.sleep(random.uniform(0.2, 2.0))
        victims = [build.pid] if random.random() < 0.5 else children(build.pid) or [build.pid]
        with suppress(ProcessLookupError):
            os.kill(random.choice(victims), signal.SIGKILL)
        kills += 1
        if build.pid in victims:
            build.wait()
        else:
            assert build.wait() == 0  # a worker is replaced within the build
        for name, data in contents(folder).items():
            assert data == expected[name], name  # whole or not there
    for folder in tmp_path.glob("killed*"):
        assert start(path, folder).wait() == 0
        assert contents(folder) == expected
        store = Store(str(folder / ".texbake" / "store"))
        entries = list((folder / ".texbake" / "store").glob("??/*"))
        assert len(entries) == 15 and not list((folder / ".texbake" / "store" / "tmp").iterdir())
        for entry in entries:
            manifest = store.find(entry.name)
            store.check(manifest, Digests(tmp_path / "none", trusting=False), ())


def test_two_builds_at_once(write, tmp_path, contents):
    path = write()
    builds = [start(path, tmp_path / "both") for _ in range(2)]
    assert [build.wait() for build in builds] == [0, 0]
    assert len(contents(tmp_path / "both")) == 8
    assert len(list((tmp_path / "both" / ".texbake" / "store").glob("??/*"))) == 6
