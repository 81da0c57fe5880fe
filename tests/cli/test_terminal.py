"""Progress and tables, as a person and as a program see them."""

import io
import json
import threading

import pytest
from texbake_cli.live import Bars, rate_text
from texbake_cli.progress import JsonLines, Lines
from texbake_cli.terminal import Terminal, columns, table


@pytest.mark.parametrize(("rate", "text"), [
    (0.0, "0.0 rays/s"),
    (7.04, "7.0 rays/s"),
    (812.0, "812 rays/s"),
    (999.6, "1.0 k rays/s"),
    (4_130_000.0, "4.1 M rays/s"),
    (56_000_000.0, "56 M rays/s"),
    (9.9996e14, "999960 G rays/s"),
])  # fmt: skip
def test_rates_have_three_digits_at_most(rate, text):
    assert rate_text(rate, "rays") == text


def test_json_lines_carry_every_field():
    stream = io.StringIO()
    sink = JsonLines(stream)
    sink.started("cast rays", 200, "rays")
    sink.advanced("cast rays", 100)
    sink.advanced("cast rays", 200)  # within a tenth of a second of the one before: not reported
    sink.finished("cast rays", 1.23456)
    sink.started("build", None, "")
    sink.finished("build", 0.5)
    events = [json.loads(line) for line in stream.getvalue().splitlines()]
    assert [event["event"] for event in events] == [
        "started", "advanced", "finished", "started", "finished",
    ]  # fmt: skip
    assert all(
        list(event) == ["event", "stage", "done", "total", "unit", "seconds"] for event in events
    )
    assert events[2] == {
        "event": "finished",
        "stage": "cast rays",
        "done": 200,  # though the last step itself was not reported
        "total": 200,
        "unit": "rays",
        "seconds": 1.235,
    }
    assert events[4]["total"] is None


def test_a_stage_within_a_stage_keeps_its_own_count():
    stream = io.StringIO()
    sink = JsonLines(stream)
    sink.started("outer", 10, "meshes")
    sink.advanced("outer", 3)
    sink.started("inner", 5, "rows")
    sink.finished("inner", 0.1)
    sink.finished("outer", 0.2)
    assert json.loads(stream.getvalue().splitlines()[-1])["done"] == 3


def test_bars_leave_one_line_a_stage():
    from rich.console import Console

    stream = io.StringIO()
    console = Console(file=stream, width=100, force_terminal=True, legacy_windows=False)
    with Bars(console) as bars:
        bars.started("cast rays", 1000, "rays")
        bars.advanced("cast rays", 1000)
        bars.finished("cast rays", 0.5)
        bars.started("[odd] name", None, "")
        bars.finished("[odd] name", 0.25)
    text = stream.getvalue()
    assert f"  {'cast rays':<24}    0.50 s   2.0 k rays/s" in text
    assert f"  {'[odd] name':<24}    0.25 s" in text


def test_table_aligns_values_and_has_no_color_in_a_pipe(capsys):
    table([("Rays", ""), ("cast", "1,000"), ("recovered", "3")])
    assert capsys.readouterr().out == "Rays\ncast       1,000\nrecovered  3\n"


def test_columns_on_a_terminal_are_as_wide_as_their_cells(capsys, monkeypatch):
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    monkeypatch.setenv("COLUMNS", "40")
    columns([("face", "Dirichlet"), ("7", "4.0")], numbers=2)
    assert capsys.readouterr().out.splitlines()[1] == "   7        4.0"
    columns([("why", "px"), (50 * "x", "4")], numbers=1)
    assert capsys.readouterr().out.splitlines()[1] == 35 * "x" + "…   4"
    for n in 1, 3, 5:  # as wide as the terminal, whatever the number of columns
        columns([("why", *"abcde"[1:n]), (50 * "x", *"12345"[1:n])])
        line = capsys.readouterr().out.splitlines()[1]
        assert len(line) == 40 and line.startswith((40 - 3 * (n - 1) - 1) * "x" + "…")


def test_quiet_says_nothing_but_warnings(capsys):
    terminal = Terminal(kind="json", quiet=True)
    with terminal.progress() as progress:
        assert progress is None
    terminal.summary([("a", "b")])
    terminal.wrote([])
    assert capsys.readouterr() == ("", "")
    terminal.warn("padding of two charts meets")
    assert capsys.readouterr() == ("", "texbake: warning: padding of two charts meets\n")


def test_short_work_prints_nothing_where_stderr_is_no_terminal(capsys):
    with Terminal().progress() as progress:
        assert progress is not None
        progress.started("bake", 10, "texels")
        progress.advanced("bake", 5)
        progress.finished("bake", 0.1)
    assert capsys.readouterr() == ("", "")


def timed_lines():
    """Lines on a clock that stands still, what they print, and the time of the clock."""
    printed: list[str] = []
    now = [100.0]
    return Lines(printed.append, lambda: now[0]), printed, now


def test_a_long_stage_is_announced_once():
    lines, printed, now = timed_lines()
    lines.started("bake", 1000, "texels")
    now[0] += 2.0
    lines.advanced("bake", 110)  # not timed for long enough
    now[0] += 3.0
    lines.advanced("bake", 100)  # the first units may be slow
    assert lines.running["bake"].state(now[0]) == "bake: 10 % in 5 s"
    now[0] += 10.0
    lines.advanced("bake", 101)
    now[0] += 10.0
    lines.advanced("bake", 102)
    assert printed == ["bake takes about 2.5 min"]


def test_a_slow_stage_is_announced_before_a_tenth_is_done():
    lines, printed, now = timed_lines()
    lines.started("bake", 1000, "texels")
    now[0] += 29.0
    lines.advanced("bake", 20)
    assert not printed
    now[0] += 1.0
    lines.advanced("bake", 20)
    assert printed == ["bake takes about 25 min"]


def test_a_stage_of_less_than_a_minute_is_not_announced():
    lines, printed, now = timed_lines()
    lines.started("bake", 100, "texels")
    now[0] += 5.0
    lines.advanced("bake", 10)
    assert printed == []


def test_lines_tell_the_state_of_the_innermost_stage():
    lines, printed, now = timed_lines()
    lines.tick()
    lines.started("run", None, "")
    now[0] += 10.0
    lines.tick()
    lines.started("bake", 1000, "texels")
    now[0] += 10.0
    lines.advanced("bake", 250)
    lines.tick()
    lines.finished("bake", 10.0)
    lines.tick()
    lines.started("pad", None, "")
    now[0] += 0.4
    lines.tick()
    assert printed == [
        "run: 10 s", "bake: 25 % in 10 s, about 30 s left", "run: 20 s", "run: 20 s",
    ]  # fmt: skip


def test_lines_are_printed_while_the_work_runs(monkeypatch):
    monkeypatch.setattr(Lines, "INTERVAL", 0.01)
    printed = threading.Event()
    with Lines(lambda text: printed.set()) as lines:
        lines.started("read", None, "")
        assert printed.wait(60.0)
