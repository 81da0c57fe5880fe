"""Fronts, knees and savings at equal error, of measurements made by hand."""

import math

import pytest
from hypothesis import given, strategies as st

from texbake.study.knob import Evaluation, Knob, Setting
from texbake.study.result import (
    KnobResult,
    Measurement,
    convergence_order,
    findings,
    knee,
    pareto_front,
    speedups,
)


def result(baseline="fixed"):
    knob = Knob("k", "K", "about", "error", "°", "angle", lambda case: None, baseline)

    def item(label, series, seconds, error):
        return Measurement(Setting(label, label, series), Evaluation(error), (seconds,), None)

    items = (
        item("1", "fixed", 1.0, 8.0), item("4", "fixed", 4.0, 4.0), item("16", "fixed", 16.0, 1.0),
        item("64", "fixed", 64.0, 0.1), item("wide", "adaptive", 2.0, 4.0),
        item("close", "adaptive", 8.0, 0.25),
    )  # fmt: skip
    return KnobResult(knob, "on", "converged", "text", items)


def test_between_two_settings_error_falls_as_a_power_of_time():
    """From 4 to 1/4 in four times the time: an error of 1 lies half way, at twice the time."""
    found = {item.setting.setting.label: item for item in speedups(result())}
    assert list(found) == ["1", "4", "16"]  # nothing adaptive reaches 64 samples
    assert found["16"].share == pytest.approx(4.0 / 16.0)
    assert not found["16"].is_most
    assert (found["4"].share, found["4"].is_most) == (0.5, True)


def test_the_page_says_so_in_a_sentence():
    assert "“adaptive” reaches the 1° of “16” in 0.25 of its time (interpolated)." in findings(
        result()
    )
    assert speedups(result(baseline="")) == []


times_and_errors = st.lists(st.tuples(st.floats(0.001, 1000), st.floats(0.0, 1000)), max_size=30)


@given(times_and_errors)
def test_the_front_is_just_what_no_other_point_beats(points):
    front = pareto_front(points)

    def beaten(p):
        return any(q[0] <= p[0] and q[1] <= p[1] and q != p for q in points)

    assert {points[i] for i in front} == {p for p in points if not beaten(p)}
    chosen = [points[i] for i in front]
    assert chosen == sorted(chosen)
    assert [e for _, e in chosen] == sorted((e for _, e in chosen), reverse=True)


def test_equal_points_are_on_the_front_once_and_what_is_not_finite_never():
    points = [(1.0, 1.0), (1.0, 1.0), (math.nan, 0.0), (0.5, math.inf)]
    assert pareto_front(points) == [0]


@pytest.mark.parametrize("p", [0.25, 0.5, 1.0, 2.0])
def test_the_convergence_order_is_the_exponent_of_a_power_law(p):
    assert convergence_order((2.0, 2.0**-p), (32.0, 32.0**-p)) == pytest.approx(p, rel=1e-12)


def test_a_free_or_perfect_step_pays_without_bound():
    assert convergence_order((1.0, 2.0), (1.0, 1.0)) == math.inf
    assert convergence_order((1.0, 2.0), (9.0, 0.0)) == math.inf


def test_the_knee_of_two_power_laws_is_where_they_meet():
    """Error falls as 1/t up to t = 8, then only as t^-1/4."""
    points = [(t, 1.0 / t if t <= 8.0 else (8.0 / t) ** 0.25 / 8.0) for t in (1, 2, 4, 8, 16, 32)]
    assert knee(points, pareto_front(points)) == 3


def test_a_poor_step_is_taken_where_the_next_makes_up_for_it():
    points = [(1.0, 1.0), (2.0, 0.9), (4.0, 0.1)]
    assert knee(points, pareto_front(points)) == 2
    assert knee([], []) is None
