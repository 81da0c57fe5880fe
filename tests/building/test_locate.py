"""Line numbers of keys, in texts that are built so that the lines are known."""

import tomllib

import pytest
from hypothesis import given, strategies as st

from texbake.building import locate
from texbake.building.locate import key_lines, line_of

TEXT = '''# a comment = 1
folder = "a\\nb"   # with = signs, and [brackets]

[[assets]]
name = "x [[y]]"
options.high = {shape = "torus", resolution = [1, 2]}
[assets.options.low]
size = 3

[[assets]]
inputs.high = [
  "a.ply",  # one
  "b.ply",
]
[steps."odd name"]
text = """
[not.a.header]
key = 1
"""
after = "x"
'''


def test_every_key_has_its_line() -> None:
    assert tomllib.loads(TEXT)
    lines = key_lines(TEXT)
    expected = {
        "folder": 2,
        "assets": 4,
        "assets[0]": 4,
        "assets[0].name": 5,
        "assets[0].options.high": 6,
        "assets[0].options.high.shape": 6,
        "assets[0].options.low": 7,
        "assets[0].options.low.size": 8,
        "assets[1]": 10,
        "assets[1].inputs.high": 11,
        "steps.odd name": 15,
        "steps.odd name.text": 16,
        "steps.odd name.after": 20,
    }
    assert {place: lines[place] for place in expected} == expected
    assert "not" not in lines and "not.a.header" not in lines


def test_a_key_without_a_line_has_that_of_its_table() -> None:
    lines = key_lines(TEXT)
    assert line_of(lines, "assets[1].inputs.high[1]") == 11
    assert line_of(lines, "assets[0].options.low.padding") == 7
    assert line_of(lines, "elsewhere") is None


@given(
    st.lists(
        st.tuples(
            st.sampled_from(["", "# note\n", "\n\n"]),
            st.sampled_from(['"text # = ["', "[\n 1,\n 2,\n]", '"""\na\n"""', "{a = 1}", "1.5"]),
        ),
        max_size=12,
    )
)
def test_keys_are_where_they_were_put(parts: list[tuple[str, str]]) -> None:
    text, expected = "", {}
    for number, (before, value) in enumerate(parts):
        text += before
        expected[f"key{number}"] = text.count("\n") + 1
        text += f"key{number} = {value}\n"
    lines = key_lines(text)
    assert {key: lines[key] for key in expected} == expected


def test_a_statement_of_thousands_of_lines_is_given_up():
    parsed = 0

    def loads(text):
        nonlocal parsed
        parsed += len(text)
        raise tomllib.TOMLDecodeError

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(locate.tomllib, "loads", loads)
        assert locate.key_lines("x = [\n" + "1,\n" * 100_000 + "]\n") == {}
    assert parsed < 4_000_000
