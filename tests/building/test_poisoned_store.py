"""A store that somebody else writes to cannot make a build write outside its folder."""

import json
import shutil
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from texbake import write_mesh
from texbake.building.digests import checksum
from texbake.building.store import DamagedError, Store
from texbake.mesh.shapes import uv_sphere

STEPS = """
[[assets]]
inputs.high = "*.ply"
[steps.clean]
do = "repair"
mesh = "high"
output = "{asset}.{ext}"
"""


@pytest.fixture
def built(tmp_path: Path, write: Callable[..., Path], run: Callable[..., Any]) -> Path:
    """A pipeline of one asset, which is built."""
    write_mesh(uv_sphere(4, 8), tmp_path / "a.ply")
    path = write(STEPS, "")
    run(path)
    return path


def poison(pipeline: Path, change: Callable[[dict[str, Any]], None]) -> str:
    """Change the one manifest of a store, with a checksum that fits; return its key."""
    (path,) = (pipeline.parent / "build").rglob("manifest.json")
    manifest = json.loads(path.read_text())
    del manifest["checksum"]
    change(manifest)
    path.write_text(json.dumps({**manifest, "checksum": checksum(manifest)}))
    return str(manifest["key"])


def outside(manifest: dict[str, Any]) -> None:
    (output,) = manifest["outputs"].values()
    output["file"], output["files"][0]["path"] = ".", "../../evil.ply"


@pytest.mark.parametrize("options", [{}, {"verify": True}])
def test_a_manifest_cannot_name_a_file_outside(
    built: Path, run: Callable[..., Any], tmp_path: Path, options: dict[str, bool]
) -> None:
    (stored,) = (tmp_path / "build" / ".texbake").rglob("*.ply")
    poison(built, outside)
    # Where the path leads to from the entry there is a file with the right checksum.
    shutil.copy(stored, stored.parents[2] / "evil.ply")
    (tmp_path / "build" / "a.ply").unlink()
    before = {path for path in tmp_path.rglob("*.ply") if path.name == "evil.ply"}
    result, steps = run(built, **options)
    assert steps == ["a.clean"]  # made anew
    assert not result.failed
    assert {path for path in tmp_path.rglob("*.ply") if path.name == "evil.ply"} == before
    assert (tmp_path / "build" / "a.ply").is_file()


@pytest.mark.parametrize(
    "name", ["../x", "a/../../x", "/etc/x", "C:/x", "C:x", "a\\..\\..\\x", "a//x", ".", "a/."]
)
def test_names_that_are_not_below_an_entry_are_damage(built: Path, name: str) -> None:
    def change(manifest: dict[str, Any]) -> None:
        (output,) = manifest["outputs"].values()
        output["file"] = name

    key = poison(built, change)
    (folder,) = (path for path in (built.parent / "build").rglob("manifest.json"))
    with pytest.raises(DamagedError, match="outside its folder"):
        Store(str(folder.parents[2])).find(key)


def file(**changes: Any) -> dict[str, Any]:
    """The outputs of a manifest with one file."""
    listed = {"path": "", "sha256": "0" * 64, "size": 1, **changes}
    return {"mesh": {"file": "m.ply", "files": [{k: v for k, v in listed.items() if v != "none"}]}}


@pytest.mark.parametrize(
    "outputs",
    [
        None,
        [],
        {},
        {"mesh": {}},
        {"mesh": {"file": 3, "files": []}},
        file(path=3),
        file(path="a\0b"),
        file(path="none"),
        file(sha256="none"),
        file(sha256=3),
        file(size="large"),
    ],
)
def test_a_manifest_of_another_shape_is_damage(
    built: Path, run: Callable[..., Any], outputs: Any
) -> None:
    poison(built, lambda manifest: manifest.update(outputs=outputs))
    result, steps = run(built)
    assert steps == ["a.clean"]
    assert not result.failed


@pytest.mark.parametrize(
    "change",
    [
        lambda text: "[" * 100_000,
        lambda text: text.replace('"key"', '"kind"'),
        lambda text: text.replace('"key"', '"\\ud800": 1, "key"'),
    ],
    ids=["nested", "without key", "half a character"],
)
def test_a_manifest_that_is_none_is_damage(
    built: Path, run: Callable[..., Any], change: Callable[[str], str]
) -> None:
    (path,) = (built.parent / "build").rglob("manifest.json")
    text = change(path.read_text())
    with suppress(ValueError, RecursionError):
        manifest = json.loads(text)
        manifest.pop("checksum")
        text = json.dumps({**manifest, "checksum": checksum(manifest)})
    path.write_text(text)
    result, steps = run(built)
    assert steps == ["a.clean"]
    assert not result.failed


@pytest.mark.parametrize("name", ["digests.json", "last.json"])
@pytest.mark.parametrize("content", ["[" * 100_000, '{"a": {"clean": [1]}}', '{"a": 5}', "5"])
def test_what_a_build_remembers_may_be_anything(
    name: str, content: str, built: Path, run: Callable[..., Any]
) -> None:
    (path,) = (built.parent / "build").rglob(name)
    path.write_text(content)
    assert run(built)[0].count_steps("current") == 1


@pytest.mark.parametrize("entry", [5, [], [[], {}], [[], "x", 7], "xy"])
def test_remembered_digests_may_be_of_any_shape(
    entry: Any, built: Path, run: Callable[..., Any]
) -> None:
    (path,) = (built.parent / "build").rglob("digests.json")
    files = dict.fromkeys(json.loads(path.read_text())["files"], entry)
    path.write_text(json.dumps({"files": files, "checksum": checksum(files)}))
    assert run(built)[0].count_steps("current") == 1
