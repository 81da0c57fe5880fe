"""What is said of errors: shares and percentiles of made ones."""

import numpy as np
import pytest

from texbake.sampling.report import (
    CHECKED_SHARE,
    MOST_CHECKED,
    ErrorSummary,
    SamplingReport,
    check_random,
    n_to_check,
    percent_within,
    percentiles_of,
)


class Report(SamplingReport):
    element, most_samples = "dot", 64


def report(within, max_error="1mm", errors=()):
    return Report(max_error=max_error, sample_percents={}, within_percent=within, n_checked=1234,
                  samples_of_check=9, errors=errors)  # fmt: skip


@pytest.mark.parametrize("within", [0.0, 50.0, 98.99, 99.0, 99.5, 100.0])
def test_more_than_one_in_a_hundred_above_a_bound_is_warned_of(within):
    lines = report(within).warnings
    assert len(lines) == (within < 99.0)
    for line in lines:
        assert line.startswith(f"{100 - within:.2f} % of the dots") and "more than 1mm" in line
        assert "with 64 samples" in line
    assert report(within, max_error=None).warnings == []


@pytest.mark.parametrize("n", [1, 2, 5, 1000])
def test_shares_and_percentiles_of_errors_are_those_of_the_sorted_ones(n):
    errors = np.random.default_rng(n).permutation(n) / 8.0
    assert percent_within(errors, 2.0) == 100.0 * min(17, n) / n  # the bound itself is within
    assert percent_within(errors, None) == percent_within(errors[:0], 0.0) == 100.0
    found = percentiles_of(errors, 3.0)
    assert list(found) == [50, 99, 100] and percentiles_of(errors[:0]) == {}
    for percent, value in found.items():
        assert value == pytest.approx(3.0 * (n - 1) / 8.0 * percent / 100)


def test_a_hundredth_is_checked_up_to_a_limit_and_always_the_same():
    assert [n_to_check(n) for n in (0, 1, 100, 101, 12_345)] == [0, 1, 1, 2, 124]
    assert n_to_check(10**5) == CHECKED_SHARE * 10**5
    assert n_to_check(10**9) == MOST_CHECKED
    assert check_random().random(4).tolist() == check_random().random(4).tolist()


def test_a_row_names_what_was_estimated_and_what_was_measured():
    some = ErrorSummary("normal", "deg", 0.5, {50: 0.1, 99: 0.25, 100: 2.0}, {}, 98.765)
    other = ErrorSummary("height", "mm", None, {}, {50: 3.0, 99: 4.0, 100: 5.0}, 100.0)
    assert report(100.0, errors=(some, other)).table() == [
        (
            "error of normal",
            "estimated 0.1 / 0.25 / 2 (median, p99, greatest) deg, checked on 1,234 dots nothing, "
            "98.77 % of them within 0.5",
        ),
        (
            "error of height",
            "estimated nothing mm, checked on 1,234 dots 3 / 4 / 5 (median, p99, greatest)",
        ),
    ]
