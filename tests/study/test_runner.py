"""Rounds, medians, bounds and peak memory; the work itself moves the clock."""

from collections import Counter
from weakref import WeakSet

import numpy as np
import pytest

from texbake.study.knob import Evaluation, Experiment, Setting
from texbake.study.study import run_experiment, with_peak_memory

MB = 1 << 20


class Machine:
    """Work that takes given times, and records the order of its calls."""

    def __init__(self, lengths):
        self.lengths = {name: list(seconds) for name, seconds in lengths.items()}
        self.now = 100.0
        self.worked, self.judged = [], []

    def clock(self):
        return self.now

    def work(self, name):
        self.worked.append(name)
        seconds = self.lengths[name]
        self.now += seconds.pop(0) if len(seconds) > 1 else seconds[0]
        return name.upper()

    def judge(self, name, product):
        self.now += 1000.0  # must count nowhere
        self.judged.append((name, product))
        return Evaluation(error=float(len(name)))

    def run(self, **options):
        bench = Experiment(
            "nothing", "closed form", "", tuple(Setting(n, n) for n in self.lengths),
            self.work, self.judge,
        )  # fmt: skip
        return run_experiment(bench, clock=self.clock, **options)


def test_each_round_has_every_setting_once_in_a_changing_order():
    machine = Machine({name: [1.0] for name in "abcdef"})
    machine.run(repeats=8, seconds=100.0)
    rounds = [tuple(machine.worked[i : i + 6]) for i in range(0, 6 * 9, 6)]
    assert len(machine.worked) == 6 * 9
    assert rounds[0] == tuple("abcdef")
    assert all(sorted(order) == list("abcdef") for order in rounds)
    assert len(set(rounds[1:])) > 4


def test_the_order_is_the_same_in_every_run_and_another_with_another_seed():
    orders = []
    for seed in ("a knob", "a knob", "another"):
        machine = Machine({name: [1.0] for name in "abcdef"})
        machine.run(repeats=4, seconds=100.0, seed=seed)
        orders.append(machine.worked)
    assert orders[0] == orders[1] != orders[2]


def test_no_product_is_kept_while_the_next_is_made():
    class Product:
        """Weak references to it are possible."""

    alive = WeakSet()

    def work(name):
        assert not alive
        product = Product()
        alive.add(product)
        return product

    experiment = Experiment(
        "nothing", "closed form", "", tuple(Setting(n, n) for n in "ab"),
        work, lambda name, product: Evaluation(error=1.0),
    )  # fmt: skip
    assert len(run_experiment(experiment, repeats=3, seconds=1.0)) == 2


def test_only_the_work_is_timed_and_the_first_run_is_not_counted():
    machine = Machine({"slow": [50.0, 3.0, 1.0, 2.0], "fast": [0.5]})
    slow, fast = machine.run(repeats=3, seconds=100.0)
    assert slow.seconds == pytest.approx((3.0, 1.0, 2.0))
    assert fast.seconds == pytest.approx((0.5, 0.5, 0.5))
    assert slow.median == pytest.approx(2.0)
    report = slow.to_json()
    assert (report["seconds_min"], report["seconds_max"]) == pytest.approx((1.0, 3.0))


def test_products_are_judged_once_each():
    machine = Machine({"ab": [1.0], "cde": [1.0]})
    trials = machine.run(repeats=5, seconds=100.0)
    assert machine.judged == [("ab", "AB"), ("cde", "CDE")]
    assert [trial.outcome.error for trial in trials] == [2.0, 3.0]


def test_slow_settings_are_run_less_often_but_twice():
    machine = Machine({"quick": [1.0], "slow": [6.0], "slowest": [40.0]})
    machine.run(repeats=5, seconds=10.0)
    # Of the slowest the first run counts as one of its two.
    assert Counter(machine.worked) == {"quick": 6, "slow": 3, "slowest": 2}


def test_one_repeat_is_one_run():
    machine = Machine({"a": [1.0]})
    (trial,) = machine.run(repeats=1, seconds=0.5)
    assert len(trial.seconds) == 1


def test_every_run_is_reported():
    steps = []
    machine = Machine({"a": [30.0], "b": [1.0]})
    machine.run(repeats=4, seconds=10.0, advance=steps.append)
    assert sum(steps) == 2 * 5


def test_memory_is_that_of_a_run_in_which_nothing_is_loaded_any_more():
    loaded = []

    def work(name):
        if not loaded:
            loaded.append(bytearray(64 << 20))  # stays, as a compiled kernel does
        return name

    bench = Experiment(
        "nothing", "closed form", "", (Setting("a", "a"), Setting("b", "b")), work,
        lambda name, product: Evaluation(error=1.0),
    )  # fmt: skip
    for trial in run_experiment(bench, repeats=2, seconds=1.0):
        assert trial.peak_bytes is None or trial.peak_bytes < 16 << 20


def test_peak_memory_is_what_the_work_took_at_most():
    def work():
        large = np.ones(64 * MB, np.uint8)
        total = int(large[:: 64 * MB - 1].sum())
        del large
        return total

    result, peak = with_peak_memory(work)
    assert result == 2
    # Where Linux knows it: the array, and little more.
    assert peak is None or 60 * MB < peak < 80 * MB


def test_an_earlier_peak_is_forgotten():
    _, large = with_peak_memory(lambda: np.ones(64 * MB, np.uint8).sum())
    _, small = with_peak_memory(lambda: np.ones(4 * MB, np.uint8).sum())
    if large is not None:
        assert small < large / 4
