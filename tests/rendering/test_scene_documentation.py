"""The page about scene files is held against what the reader takes."""

import re
import tomllib
from dataclasses import MISSING, fields
from pathlib import Path

import pytest

from texbake.rendering.scene.file.schema import TABLES
from texbake.rendering.scene.read import read_scene

PAGE = (Path(__file__).parents[2] / "docs" / "scenes.md").read_text(encoding="utf-8")
# Defaults that a file does not write as the class holds them, or that depend on something else.
IN_WORDS = {("[render]", "background"), ("[[lights]]", "name"), ("[[lights]]", "position"),
            ("[[objects]]", "name")}  # fmt: skip


def section(heading):
    found = re.search(rf"^#+ {re.escape(heading)}\n(.*?)(?=^#|\Z)", PAGE, re.M | re.S | re.I)
    assert found, f"no section {heading!r}"
    return found[1]


def rows(heading):
    """(keys, default) of each row of a section's table."""
    for line in section(heading).splitlines():
        if line.startswith("| `"):
            keys, default, _ = (cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:4])
            yield re.findall(r"`(\w+)`", keys), default


def written(value):
    """A value as TOML has it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, tuple):
        return f"[{', '.join(map(written, value))}]"
    return f"{value:g}" if isinstance(value, float) else str(value)


@pytest.mark.parametrize("heading", TABLES)
def test_every_key_is_documented_and_no_other(heading):
    documented = [key for keys, _ in rows(heading) for key in keys]
    assert sorted(documented) == sorted(TABLES[heading].keys())


@pytest.mark.parametrize("heading", TABLES)
def test_defaults_are_those_of_the_class(heading):
    table = TABLES[heading]
    sources = {} if table.source is None else {item.name: item for item in fields(table.source)}
    for keys, default in rows(heading):
        key = keys[0]
        required = table.model_fields[key].is_required()
        assert (default == "required") == required, key
        item = sources.get(key)
        told = item is not None and item.default not in (MISSING, None, ())
        if len(keys) == 1 and told and not required and (heading, key) not in IN_WORDS:
            assert default == f"`{written(item.default)}`", key


def test_the_example_is_read(tmp_path):
    example = re.search(r"```toml\n(.*?)```", PAGE, re.S)[1]
    path = tmp_path / "scene.toml"
    path.write_text(example)
    scene = read_scene(path)
    assert [item.name for item in scene.objects] == ["sphere", "plane"]
    assert scene.objects[0].material.bump_map.height == 0.01
    assert set(tomllib.loads(example)) <= set(TABLES["the file"].keys())


def test_extensions_on_the_page_are_those_that_are_shown():
    from texbake.rendering.scene.gltf.read import SHOWN

    row = next(line for line in section("glTF").splitlines() if line.startswith("| extensions"))
    assert set(re.findall(r"[A-Z]{3,4}_\w+", row)) == set(SHOWN) - {"KHR_xmp_json_ld"}
