"""Line numbers of keys, in texts that are built so that the lines are known."""

import tomllib

import pytest

from texbake.building import locate
from texbake.building.file import read_pipeline
from texbake.building.locate import line_of
from texbake.errors import FileFormatError

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


def test_every_key_has_its_line():
    assert tomllib.loads(TEXT)
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
        # That of the table of a key that has no line.
        "assets[1].inputs.high[1]": 11,
        "assets[0].options.low.padding": 7,
        "assets[0].options.low.sizes": 7,
        "elsewhere": None,
        "not": None,
        "not.a.header": None,
    }
    assert {place: line_of(TEXT, place) for place in expected} == expected


def test_brackets_and_quotes_in_texts_end_no_statement():
    texts = ['''"""a\n"" \\""" ["""""''', "'''a\n''['''''", '"\\"["', "'[\\'", "['[', # [\n]"]
    for text in texts:
        for before in texts:
            whole = f'a = {before}\n"" = ""\nb = {text}  # "" [\nc = 1'
            assert tomllib.loads(whole)["c"] == 1
            assert line_of(whole, "c") == 1 + whole.count("\n")


def test_a_key_of_thousands_of_parts_is_one_line(tmp_path):
    path = tmp_path / "a.toml"
    for key in ("a", '"<"'):
        path.write_text("# one\n" + ".".join([key] * 3000) + " = 1\n")
        with pytest.raises(FileFormatError, match="unknown key"):
            read_pipeline(path)


def test_each_statement_is_parsed_once(monkeypatch):
    parsed = []
    parse = tomllib.loads
    monkeypatch.setattr(
        locate.tomllib, "loads", lambda text: (parsed.append(len(text)), parse(text))[1]
    )
    text = "x = [\n" + "1,\n" * 100_000 + "]\ny = 1\n"
    assert line_of(text, "y") == 100_003
    assert sum(parsed) <= len(text)
