"""Parts matched by name."""

import string

import pytest
from hypothesis import given, settings, strategies as st

from texbake.baking.parts.matching import PartsOptions, base_of, match_names, pair_names
from texbake.errors import MeshError, OptionError

OPTIONS = PartsOptions(match_by_name=True)


def matched(high, low, options=OPTIONS):
    return match_names(high, low, options).to_json()


def test_numbers_may_follow_and_letters_may_not():
    found = matched(
        ["body_high", "Body_HIGH_01", "body_high.002", "body_high3", "body_highlight"], ["BODY_low"]
    )
    assert found["matches"] == [{
        "base": "BODY", "low": "BODY_low",
        "high": ["body_high", "Body_HIGH_01", "body_high.002", "body_high3"],
    }]  # fmt: skip
    assert found["high_left_over"] == ["body_highlight"]


def test_ignored_parts_are_not_matched():
    found = matched(["a_high", "a_high_ignore", "b_high_ignored"], ["a_low", "c_low_ignore", "d"])
    assert found["matches"] == [{"base": "a", "low": "a_low", "high": ["a_high"]}]
    assert found["high_ignored"] == ["a_high_ignore"]
    assert (found["low_ignored"], found["low_left_over"]) == (["c_low_ignore"], ["d"])
    # `_ignored` is not the suffix `_ignore`, so this is a part of b.
    assert [m["base"] for m in matched(["b_high_ignored"], ["b_low"])["matches"]] == ["b"]


def test_suffixes_may_contain_special_characters():
    options = PartsOptions(match_by_name=True, high_suffix=".hp+", low_suffix="(lp)")
    assert matched(["a.hp+2"], ["A(LP)"], options)["matches"][0]["base"] == "A"


@pytest.mark.parametrize(("high", "low", "message"), [
    (["a_high"], ["a_low", "A_LOW"], "a_low, A_LOW: two low-poly parts have the same name"),
    (["a_high"], ["b_low"], "no low-poly part .* matches a high-poly part"),
    ([], [], "no low-poly part"),
])  # fmt: skip
def test_parts_that_cannot_be_matched_are_one_line(high, low, message):
    with pytest.raises(MeshError, match=message) as caught:
        match_names(high, low, OPTIONS)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("wrong", [
    {"match_by_name": True, "high_suffix": ""},
    {"match_by_name": True, "high_suffix": "_LOW"},
])  # fmt: skip
def test_options_are_checked(wrong):
    with pytest.raises(OptionError):
        PartsOptions(**wrong)


BASES = st.text(string.ascii_lowercase, min_size=1, max_size=6)


@settings(max_examples=30)
@given(st.lists(BASES, min_size=1, max_size=6, unique=True), st.randoms(use_true_random=False))
def test_every_part_is_matched_left_over_or_ignored_once(bases, random):
    high = [f"{base}_high_{k}" for base in bases for k in range(random.randint(0, 3))]
    high.append(f"{bases[0]}_high")
    random.shuffle(high)
    low = [f"{base}_low" for base in bases]
    found = match_names(high, low, OPTIONS)
    used = [i for match in found.matches for i in match.highs]
    assert sorted([*used, *found.high_left, *found.high_ignored]) == list(range(len(high)))
    lows = [match.low for match in found.matches]
    assert sorted([*lows, *found.low_left, *found.low_ignored]) == list(range(len(low)))
    for match in found.matches:
        assert {base_of(high[i], "_high") for i in match.highs} == {match.base}


@pytest.mark.parametrize("choice", [{"high_suffix": "_hp"}, {"low_suffix": "_lp"}])
def test_options_of_matching_need_matching(choice):
    with pytest.raises(OptionError, match="match_by_name"):
        PartsOptions(**choice)
    PartsOptions(match_by_name=True, **choice)


@pytest.mark.parametrize(("high", "low", "matches"), [
    (["a", "b_high", "c_ignore"], ["a_low", "B"], {"a_low": ["a"], "B": ["b_high"]}),
    (["b", "A"], ["a", "b", "z_ignore"], {"a": ["A"], "b": ["b"]}),
    (["a", "b", "b_high.001"], ["a_high", "b"], {"a_high": ["a"], "b": ["b", "b_high.001"]}),
    (["a"], ["a"], None),
    (["a", "b_ignore"], ["a", "b_ignore"], None),
    (["a", "b", "c"], ["a", "b"], None),
    (["a", "b"], ["a", "b", "c"], None),
    (["a", "b"], ["a", "b", "A_low"], None),
])  # fmt: skip
def test_objects_pair_up_if_every_name_that_is_not_ignored_has_its_match(high, low, matches):
    found = pair_names(high, low, PartsOptions())
    if matches is None:
        assert found is None
        return
    listed = found.to_json()
    assert {match["low"]: match["high"] for match in listed["matches"]} == matches
    assert not listed["low_left_over"] and not listed["high_left_over"]
    assert listed["high_ignored"] == [name for name in high if "ignore" in name]
    assert listed["low_ignored"] == [name for name in low if "ignore" in name]
