"""A Dask cluster whose network is gone for a minute: nothing is lost, and nothing is made twice.

    python tests/hard_cases/dask_pauses.py [--seconds 60]

In the middle of a build by two workers, one process is stopped (SIGSTOP) for that long: a worker,
the scheduler, or the build itself. Its connections stay open and nobody answers, as where a cable
is pulled. Each build must finish, with the bytes of one on this machine, and each step be made
once. Prints a table in Markdown, and exits with 1 if one does not. Not on Windows.
"""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))  # for the tests

from tests.building.conftest import STEPS
from tests.building.dask_cluster import Cluster, wait_for

ASSETS = "".join(
    f'[[assets]]\nname = "{number}"\noptions.high.radius = {1 + number}\n' for number in range(20)
)
N_STEPS = 60
CODE = "from texbake_cli.main import main; main()"


def build(pipeline: Path, folder: Path, *words: str) -> subprocess.Popen[str]:
    """Start a build."""
    return subprocess.Popen(
        [sys.executable, "-P", "-c", CODE, "build", str(pipeline), "-o", str(folder), *words],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )


def outputs(folder: Path) -> dict[str, bytes]:
    """Return the content of every published file."""
    return {path.name: path.read_bytes() for path in folder.glob("*_*.*") if path.is_file()}


def paused(who: str, pipeline: Path, folder: Path, seconds: float) -> list[str]:
    """Build with a pause of one process; return the cells of a row."""
    cluster = Cluster(folder / "dask")
    try:
        cluster.wait(2)
        start = time.monotonic()
        client = build(pipeline, folder / "there", "--scheduler", cluster.address)
        wait_for(lambda: len(cluster.steps_made) >= 5)
        pids = {
            "worker": cluster.workers[0].pid,
            "scheduler": cluster.scheduler.pid,
            "build": client.pid,
        }
        os.kill(pids[who], signal.SIGSTOP)
        time.sleep(seconds)
        made_meanwhile = len(cluster.steps_made)
        os.kill(pids[who], signal.SIGCONT)
        said = client.communicate()[1].strip()
        made = cluster.steps_made
        return [
            who,
            f"{time.monotonic() - start:.0f} s",
            str(client.returncode),
            f"{made_meanwhile} of {N_STEPS}",
            f"{len(made)} of {N_STEPS}",
            str(sum(made.values()) - len(made)),
            said,
        ]
    finally:
        cluster.close()


def main() -> int:
    """Run all pauses, and print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seconds", type=float, default=60.0)
    seconds = parser.parse_args().seconds
    good = True
    with tempfile.TemporaryDirectory(prefix="texbake-pauses-") as temporary:
        root = Path(temporary)
        pipeline = root / "pauses.toml"
        pipeline.write_text(ASSETS + STEPS)
        build(pipeline, root / "here").communicate()
        print("| stopped | build took | exit code | steps made before it goes on | steps made "
              "| made twice | said | same bytes |")  # fmt: skip
        print("|---|---|---|---|---|---|---|---|")
        for who in ("worker", "scheduler", "build"):
            cells = paused(who, pipeline, root / who, seconds)
            same = outputs(root / who / "there") == outputs(root / "here") != {}
            good &= same and cells[2] == "0" and cells[4] == f"{N_STEPS} of {N_STEPS}"
            good &= cells[5] == "0"
            print(f"| {' | '.join(cells)} | {'yes' if same else 'no'} |", flush=True)
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
