from hypothesis import given, strategies as st

from texbake.metadata import from_description, to_description

facts = st.dictionaries(
    st.text(), st.text() | st.integers() | st.floats(allow_nan=False, allow_infinity=False)
)


@given(facts)
def test_facts_come_back_exactly(metadata):
    assert from_description(to_description(metadata)) == metadata


@given(facts.filter(bool))
def test_description_is_one_line_of_ascii(metadata):
    description = to_description(metadata)
    assert description.isascii() and "\n" not in description and "\0" not in description


def test_line_breaks_put_in_by_a_format_do_no_harm():
    description = to_description({"texbake:space": "tangent", "texbake:displacement_scale": 0.1})
    broken = description[:20] + "\n" + description[20:]
    assert from_description(broken) == from_description(description) != {}


def test_order_of_the_facts_does_not_matter():
    assert to_description({"a": 1, "b": 2}) == to_description({"b": 2, "a": 1})


def test_other_descriptions_hold_no_facts():
    for description in ("", "a photograph", "[1, 2]", "3", "{", "[" * 100_000):
        assert from_description(description) == {}


def test_values_that_are_no_facts_are_left_out():
    assert from_description('{"a": 1, "b": [2], "c": null}') == {"a": 1}
