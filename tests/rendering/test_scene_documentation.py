"""The documentation of scene files matches the keys that the reader accepts."""

import re
import tomllib
from pathlib import Path

from texbake.rendering.scene.file.schema import TABLES
from texbake.rendering.scene.read import read_scene

PAGE = (Path(__file__).parents[2] / "docs" / "reference" / "scenes.md").read_text(encoding="utf-8")


def section(heading):
    found = re.search(rf"^#+ {re.escape(heading)}\n(.*?)(?=^#|\Z)", PAGE, re.M | re.S | re.I)
    assert found, f"no section {heading!r}"
    return found[1]


def test_the_example_is_read(tmp_path):
    example = re.search(r"```toml\n(.*?)```", PAGE, re.S)[1]
    path = tmp_path / "scene.toml"
    path.write_text(example)
    scene = read_scene(path)
    assert [item.name for item in scene.objects] == ["sphere", "plane"]
    assert scene.objects[0].material.bump_map.height == 0.01
    assert set(tomllib.loads(example)) <= set(TABLES["the file"].keys())


def test_extensions_on_the_page_are_those_that_are_shown():
    from texbake.rendering.scene.gltf import SHOWN

    row = next(line for line in section("glTF").splitlines() if line.startswith("| extensions"))
    assert set(re.findall(r"[A-Z]{3,4}_\w+", row)) == set(SHOWN) - {"KHR_xmp_json_ld"}
