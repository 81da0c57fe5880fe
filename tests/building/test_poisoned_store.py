"""A store that somebody else writes to cannot make a build write outside its folder."""

import json
import shutil
from contextlib import suppress

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
def built(tmp_path, write, run):
    """A pipeline of one asset, which is built."""
    write_mesh(uv_sphere(4, 8), tmp_path / "a.ply")
    path = write(STEPS, "")
    run(path)
    return path


def poison(pipeline, change):
    """Change the one manifest of a store, with a checksum that fits; return its key."""
    (path,) = (pipeline.parent / "build").rglob("manifest.json")
    manifest = json.loads(path.read_text())
    del manifest["checksum"]
    change(manifest)
    path.write_text(json.dumps({**manifest, "checksum": checksum(manifest)}))
    return str(manifest["key"])


def outside(manifest):
    (output,) = manifest["outputs"].values()
    output["file"], output["files"][0]["path"] = ".", "../../evil.ply"


@pytest.mark.parametrize("options", [{}, {"verify": True}])
def test_a_manifest_cannot_name_a_file_outside(built, run, tmp_path, options):
    (stored,) = (tmp_path / "build" / ".texbake").rglob("*.ply")
    poison(built, outside)
    # Where the path leads to from the entry there is a file with the right checksum.
    shutil.copy(stored, stored.parents[2] / "evil.ply")
    (tmp_path / "build" / "a.ply").unlink()
    before = {path for path in tmp_path.rglob("*.ply") if path.name == "evil.ply"}
    result, steps = run(built, **options)
    assert steps == ["a.clean"]  # made again
    assert not result.failed
    assert {path for path in tmp_path.rglob("*.ply") if path.name == "evil.ply"} == before
    assert (tmp_path / "build" / "a.ply").is_file()


@pytest.mark.parametrize(
    "name", ["../x", "a/../../x", "/etc/x", "C:/x", "C:x", "a\\..\\..\\x", "a//x", ".", "a/."]
)
def test_names_that_are_not_below_an_entry_are_damage(built, name):
    def change(manifest):
        (output,) = manifest["outputs"].values()
        output["file"] = name

    key = poison(built, change)
    (folder,) = (path for path in (built.parent / "build").rglob("manifest.json"))
    with pytest.raises(DamagedError, match="outside its folder"):
        Store(str(folder.parents[2])).find(key)


def file(**changes):
    """The manifest of a step with one file, of which something is changed; None is left out."""
    listed = {"path": "", "sha256": "0" * 64, "size": 1, **changes}
    files = [{name: value for name, value in listed.items() if value is not None}]
    return json.dumps({"outputs": {"mesh": {"file": "m.ply", "files": files}}})


@pytest.mark.parametrize("content", [
    "[" * 100_000, '{"checksum": "0", "\\ud800": 1}', '{"key": null}', '{"outputs": null}',
    '{"outputs": []}', '{"outputs": {}}', '{"outputs": {"mesh": {}}}',
    '{"outputs": {"mesh": {"file": 3, "files": []}}}', file(path=3), file(path="a\0b"),
    file(path=None), file(sha256=None), file(sha256=3), file(size="large"),
])  # fmt: skip
def test_a_manifest_of_another_shape_is_damage(built, run, content):
    with suppress(RecursionError, ValueError):
        changes = json.loads(content)
        poison(built, lambda manifest: manifest.update(changes))
        content = ""
    if content:
        next((built.parent / "build").rglob("manifest.json")).write_text(content)
    result, steps = run(built)
    assert steps == ["a.clean"]
    assert not result.failed


@pytest.mark.parametrize("name", ["digests.json", "last.json"])
@pytest.mark.parametrize(
    "content", ["[" * 100_000, '{"a": {"clean": [1]}}', '{"a": 5}', "5", "", "5 files", "[] files"]
)
def test_what_a_build_remembers_may_be_anything(name, content, built, run):
    (path,) = (built.parent / "build").rglob(name)
    if content.endswith(" files"):  # in place of each remembered digest, with a checksum that fits
        files = json.loads(path.read_text()).get("files", ())
        files = dict.fromkeys(files, json.loads(content.removesuffix(" files")))
        content = json.dumps({"files": files, "checksum": checksum(files)})
    path.write_text(content)
    assert run(built)[0].count_steps("current") == 1
