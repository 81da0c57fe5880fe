"""Small pipelines, and workers that run in this process."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from texbake.building.build import build
from texbake.building.options import BuildOptions
from texbake.building.progress import ENDED, BuildEvent
from texbake.building.report import BuildResult
from texbake.building.task import Task, TaskOutcome, run_task
from texbake.building.workers import LocalWorkers

STEPS = """
[steps.high]
do = "make"
shape = "sphere"
resolution = [24, 16]

[steps.low]
do = "unwrap"
mesh = "high"
method = "spherical"
output = "{asset}_{step}.{ext}"

[steps.maps]
do = "bake"
high = "high"
low = "low"
size = 32
padding = 1
output = "{asset}_{output}.{ext}"
"""
ASSETS = """
[[assets]]
name = "ball"

[[assets]]
name = "egg"
options.high.radius = 2.0
"""


class Inline:
    """Does tasks in this process, and remembers them."""

    def __init__(self, slots: int = 2) -> None:
        self.slots, self.threads = slots, 1
        self.tasks: list[Task] = []
        self.most_at_once = 0
        self._begun: list[tuple[int, Task]] = []

    def submit(self, number: int, task: Task) -> None:
        self.tasks.append(task)
        self._begun.append((number, task))
        self.most_at_once = max(self.most_at_once, len(self._begun))

    def finished(self, timeout: float | None) -> list[tuple[int, TaskOutcome]]:
        if timeout == 0.0:
            return []
        number, task = self._begun.pop(0)
        return [(number, run_task(task))]

    def close(self) -> None:
        pass

    @property
    def steps(self) -> list[str]:
        return [f"{task.asset}.{task.step}" for task in self.tasks]


@pytest.fixture
def inline() -> type[Inline]:
    return Inline


@pytest.fixture
def write(tmp_path: Path) -> Callable[..., Path]:
    """Write a pipeline file; without steps or assets, those of this module."""

    def write(assets: str = ASSETS, steps: str = STEPS, head: str = "") -> Path:
        path = tmp_path / "pipeline.toml"
        path.write_text(head + assets + steps, encoding="utf-8")
        return path

    return write


@pytest.fixture
def run() -> Callable[..., tuple[BuildResult, list[str]]]:
    """Build in this process; return the result and the names of the steps that ran.

    Also check that the events of the build agree with its result.
    """

    def run(path: Path, **options: Any) -> tuple[BuildResult, list[str]]:
        crew, events = Inline(), list[BuildEvent]()
        result = build(path, BuildOptions(**options), listener=events.append, workers=crew)
        first, *between, last = events
        assert (first.event, first.done, last.event) == ("began", 0, "ended")
        assert first.total == last.total == last.done
        ended = [event for event in between if event.state in ENDED]
        assert [event.done for event in ended] == list(range(1, last.total + 1))
        assert {(event.asset, event.step): event.state for event in ended} == {
            (asset.name, step.step): step.state for asset in result.assets for step in asset.steps
        }
        # Steps that need not run, or that another asset has as well, are not waited for.
        assert all(event.seconds_left in (0.0, None) for event in between[-1:])
        return result, crew.steps

    return run


@pytest.fixture
def workers() -> Iterator[Callable[[int], LocalWorkers]]:
    """Make real workers that end with the test."""
    made: list[LocalWorkers] = []

    def workers(slots: int) -> LocalWorkers:
        made.append(LocalWorkers(slots, 1))
        return made[-1]

    yield workers
    for crew in made:
        crew.close()


@pytest.fixture
def contents() -> Callable[[Path], dict[str, bytes]]:
    """Bytes of every output file."""

    def contents(folder: Path) -> dict[str, bytes]:
        return {
            path.relative_to(folder).as_posix(): path.read_bytes()
            for path in sorted(folder.rglob("*"))
            if path.is_file()
            and ".texbake" not in path.relative_to(folder).parts
            and path.name != "build.json"
        }

    return contents
