"""Small pipelines, and workers that run in this process."""

import pytest

from texbake import BuildOptions, build
from texbake.building.resolve import ENDED
from texbake.building.schedule import BuildEvent
from texbake.building.task import run_task
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

    def __init__(self, slots=2):
        self.slots, self.threads = slots, 1
        self.tasks = []
        self.most_at_once = 0
        self._begun = []

    def submit(self, number, task):
        self.tasks.append(task)
        self._begun.append((number, task))
        self.most_at_once = max(self.most_at_once, len(self._begun))

    def finished(self, timeout):
        if timeout == 0.0:
            return []
        number, task = self._begun.pop(0)
        return [(number, run_task(task))]

    def close(self):
        pass

    @property
    def steps(self):
        return [f"{task.asset}.{task.step}" for task in self.tasks]


@pytest.fixture
def inline():
    return Inline


@pytest.fixture
def write(tmp_path):
    """Write a pipeline file; without steps or assets, those of this module."""

    def write(assets=ASSETS, steps=STEPS, head=""):
        path = tmp_path / "pipeline.toml"
        path.write_text(head + assets + steps, encoding="utf-8")
        return path

    return write


@pytest.fixture
def run():
    """Build here, checking the events; return the result and the names of steps that ran."""

    def run(path, **options):
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
def workers():
    made = []

    def workers(slots):
        made.append(LocalWorkers(slots, 1))
        return made[-1]

    yield workers
    for crew in made:
        crew.close()


@pytest.fixture
def contents():
    def contents(folder):
        return {
            path.relative_to(folder).as_posix(): path.read_bytes()
            for path in sorted(folder.rglob("*"))
            if path.is_file()
            and ".texbake" not in path.relative_to(folder).parts
            and path.name != "build.json"
        }

    return contents
