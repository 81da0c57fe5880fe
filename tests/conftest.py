"""Fixtures shared by all tests."""

import gc
import os
import signal
import sys
from collections import Counter
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import settings

from tests.models import HAS_REAL, REAL
from texbake import RenderOptions

# The same examples in every run. None is too slow: machines are busy.
settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")
# Nor do they depend on what else is collected: no numbers in the code of tests become examples,
# which would also take seconds to find.
with suppress(ImportError):
    from hypothesis.internal.conjecture import providers

    providers._get_local_constants = lambda: providers._local_constants

# Files of tests need not survive a power failure, so that no test waits for the disk.
os.fsync = lambda descriptor: None

# A process that was started in the background, or by nohup, ignores signals, and so would all that
# it starts.
for _name, _handler in (("SIGINT", signal.default_int_handler), ("SIGHUP", signal.SIG_DFL)):
    with suppress(AttributeError, ValueError):  # not on this system, or not in this thread
        if signal.getsignal(_number := getattr(signal, _name)) is signal.SIG_IGN:
            signal.signal(_number, _handler)

# For embreex_oracle and random_scenes.
sys.path[:0] = [str(Path(__file__).parent / room) for room in (".", "rendering")]


# Long ones first, so that no process works alone at the end.
_FIRST = ("study", "docs", "goldens", "pages", "samples", "building", "cli")


def pytest_collection_modifyitems(items):
    """Put long ones first, and mark those that need a library that PyPI has no wheel of."""
    for item in items:
        if "meshoptimizer" in getattr(item, "fixturenames", ()):
            item.add_marker("meshoptimizer")
    tests = Path(__file__).parent
    order = dict(zip(_FIRST, range(len(_FIRST)), strict=True))
    items.sort(key=lambda item: order.get(item.path.relative_to(tests).parts[0], len(order)))


def pytest_collection_finish():
    """Keep the garbage collector away from the many thousand tests: a study calls it each run."""
    gc.collect()
    gc.freeze()


def pytest_unconfigure():
    """Let libraries find at the end that all of their objects are gone."""
    gc.unfreeze()


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_terminal_summary(terminalreporter):
    """Count skipped tests by their reason, just before the last line."""
    result = yield
    skipped = terminalreporter.stats.get("skipped", ())
    reasons = Counter(report.longrepr[2].removeprefix("Skipped: ") for report in skipped)
    for reason, count in reasons.most_common():
        terminalreporter.write_line(f"{count} {'tests' if count > 1 else 'test'} skipped: {reason}")
    return result


@pytest.fixture(scope="session")
def data_dir():
    """Folder of the real meshes, for figures of certain files; without it, the test is skipped."""
    if not HAS_REAL:
        pytest.skip("needs certain real files; name their folder in TEXBAKE_DATA")
    return REAL


@pytest.fixture(scope="session")
def meshoptimizer():
    """The library that codes views of glTF files, without wheels; else the test is skipped."""
    return pytest.importorskip(
        "meshoptimizer",
        reason="meshoptimizer is not installed: pip install 'texbake[meshoptimizer]'",
        exc_type=ImportError,
    )


# The studio's room, which takes a quarter of a second to prefilter.
ROOMS = {"jobs.preview_scene._ROOM_SIZE": 8, "rendering.compare_models._ROOM_PX": 8}
SMALL = ROOMS | {
    "jobs.options._PICTURE_SIZE": 64,
    "jobs.lighten.LARGE_PX": 64,
    "jobs.side_pictures.CHECKER_PICTURE": RenderOptions(width=64, height=64),
    "jobs.side_pictures.FINDINGS_PICTURE": RenderOptions(width=64, height=64, back_faces="show"),
    "rendering.compare_models._PICTURE_PX": 64,
    "pages.asset_page._PICTURE_PX": 64,
}


def draw_small(patch, values=SMALL):
    """Draw the pictures of comparisons and pages at a small size, in this process."""
    for name, value in values.items():
        patch.setattr(f"texbake.{name}", value)


@pytest.fixture
def small_pictures(monkeypatch):
    draw_small(monkeypatch)


@pytest.fixture
def small_room(monkeypatch):
    draw_small(monkeypatch, ROOMS)
