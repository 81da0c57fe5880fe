"""Stages: what listeners hear, and what is kept for the report."""

import re
import subprocess
import sys
from itertools import count

import pytest

from texbake import progress
from texbake.errors import CancelledError
from texbake.progress import ProgressBar, Stages, peak_memory_bytes, process_times


class Ear:
    def __init__(self):
        self.heard = []

    def started(self, stage, total, unit):
        self.heard.append(("started", stage, total, unit))

    def advanced(self, stage, done):
        self.heard.append(("advanced", stage, done))

    def finished(self, stage, seconds):
        assert seconds >= 0
        self.heard.append(("finished", stage))


def test_a_listener_hears_all_in_order():
    ear = Ear()
    with Stages(ear).stage("cast rays", total=10, unit="rays") as advance:
        advance(4)
        advance(6)
    assert ear.heard == [
        ("started", "cast rays", 10, "rays"),
        ("advanced", "cast rays", 4),
        ("advanced", "cast rays", 10),
        ("finished", "cast rays"),
    ]


def test_a_function_gets_the_share_that_is_done():
    heard = []
    stages = Stages(lambda stage, share: heard.append((stage, share)))
    with stages.stage("cast", total=4) as advance:
        advance(1)
        advance(5)
    with stages.stage("read"):
        pass
    assert heard == [("cast", 0.0), ("cast", 0.25), ("cast", 1.0), ("read", None)]


def test_a_function_that_returns_false_cancels():
    stages = Stages(lambda stage, share: share != 0.5)
    with (
        pytest.raises(CancelledError, match="cancelled while cast was running"),
        stages.stage("cast", total=2) as advance,
    ):
        advance(1)
    assert [record.name for record in stages.records] == ["cast"]


def test_a_stage_that_fails_is_finished_too():
    ear = Ear()
    stages = Stages(ear)
    with pytest.raises(ValueError, match="bad"), stages.stage("read"):
        raise ValueError("bad")
    assert ear.heard[-1] == ("finished", "read")
    assert [record.name for record in stages.records] == ["read"]


def test_parts_of_one_name_add_up_and_are_not_shown():
    ear = Ear()
    stages = Stages(ear)
    with stages.stage("bake", recorded=False):
        for _ in range(3):
            with stages.part("rasterize"):
                pass
            with stages.part("cast"):
                pass
    assert [record.name for record in stages.records] == ["rasterize", "cast"]
    assert [event[1] for event in ear.heard] == ["bake", "bake"]


def test_each_moment_of_the_process_counts_for_the_innermost_stage(monkeypatch):
    """The sum is the age of the process, even if stages are nested or repeated, or fail."""
    clock = count(1.0)
    monkeypatch.setattr(progress.time, "perf_counter", lambda: next(clock))
    monkeypatch.setattr(progress, "process_age", lambda: 0.5)
    with process_times() as times:
        with Stages().part("read"):
            with Stages(Ear()).stage("read file"):
                pass
            with pytest.raises(ValueError, match="bad"), Stages().part("read file"):
                raise ValueError("bad")
        with Stages().part("bake"):
            pass
    with Stages().part("unheard"):
        pass
    times.report()
    seconds = times.end()
    assert list(seconds) == ["start", "read", "read file", "other work", "bake", "report"]
    assert min(seconds.values()) > 0
    assert sum(seconds.values()) == next(clock) - 1.0 - times.start


def test_peak_memory_is_that_of_this_process():
    peak = peak_memory_bytes()
    # A Python process with numpy holds tens of megabytes, and a machine of tests less than a TB.
    assert peak is None or 1e7 < peak < 1e12


def test_peak_memory_is_not_that_of_the_process_before():
    held = bytearray(1 << 29)
    held[:: 1 << 12] = bytes(len(held) >> 12)  # touched, so that it is in memory
    script = "from texbake.progress import peak_memory_bytes; print(peak_memory_bytes())"
    output = subprocess.check_output([sys.executable, "-P", "-c", script], text=True)
    assert output == "None\n" or int(output) < len(held)


def test_true_shows_a_bar_that_ends_as_a_line(capsys, monkeypatch):
    ticks = count(step=0.5)
    monkeypatch.setattr(progress.time, "perf_counter", lambda: next(ticks))
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    stages = Stages(True)
    with stages.stage("cast rays", total=8, unit="rays") as advance:
        advance(2)
        advance(6)
    with stages.stage("weld") as advance:
        advance(1)
    lines = capsys.readouterr().err.split("\n")
    first, half, whole, last = lines[0].split("\r")
    assert first == "" and half.startswith("cast rays [######..................] 25 % ")
    assert whole.startswith(f"cast rays [{'#' * 24}] 100 % ")
    assert last.rstrip().startswith("cast rays: ") and len(last) == len(whole)
    assert lines[1].split("\r")[-1].startswith("weld: ") and lines[2] == ""


def test_a_file_gets_the_times_alone(capsys, monkeypatch):
    ticks = count(step=0.5)
    monkeypatch.setattr(progress.time, "perf_counter", lambda: next(ticks))
    monkeypatch.delitem(sys.modules, "ipykernel", raising=False)
    with Stages(True).stage("cast rays", total=8, unit="rays") as advance:
        advance(8)
    assert re.fullmatch(r"cast rays: \d+\.\d s\n", capsys.readouterr().err)


def test_a_short_stage_leaves_nothing(capsys, monkeypatch):
    monkeypatch.setattr(ProgressBar, "INTERVAL", 1e9)
    with Stages(True).stage("weld"):
        pass
    assert capsys.readouterr().err == ""
