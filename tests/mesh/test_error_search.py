"""The search for the fewest faces within an error."""

import math

import pytest

from texbake.mesh.simplify import Trial, search_fewest


@pytest.mark.parametrize("power", [0.5, 1.0, 2.0])
@pytest.mark.parametrize("wanted", [5, 77, 1_000, 90_000])
def test_the_fewest_are_found_in_a_few_tries(power, wanted):
    tried = []

    def attempt(n):
        tried.append(n)
        return Trial(n, n**-power)

    found = search_fewest(attempt, wanted**-power * (1.0 + 1e-12), 4, 100_000, 2_000)
    assert wanted <= found <= 1.021 * wanted + 1
    assert len(tried) <= 12
    assert len(set(tried)) == len(tried)


def test_nothing_fits_but_the_surface_itself():
    assert search_fewest(lambda n: Trial(n, 1.0), 0.0, 4, 5_000, 1_000) == 5_000
    assert search_fewest(lambda n: Trial(n, math.inf), 1.0, 4, 5_000, 1_000) == 5_000


def test_everything_fits():
    assert search_fewest(lambda n: Trial(n, 0.0), 0.0, 4, 5_000, 1_000) == 4


def test_no_more_tries_where_fewer_are_not_possible():
    tried = []

    def attempt(n):
        tried.append(n)
        return Trial(max(n, 300), 0.1)

    assert search_fewest(attempt, 0.5, 4, 5_000, 1_000) <= 300
    assert sum(n < 290 for n in tried) == 1


def test_the_least_count_is_tried_first_and_is_enough():
    tried = []

    def attempt(n):
        tried.append(n)
        return Trial(n, 1.0 / n)

    assert search_fewest(attempt, 0.1, 50, 5_000, 50) == 50
    assert tried == [50]
