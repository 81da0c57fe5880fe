"""Which settings and inputs change the key of a step."""

import dataclasses

import pytest

from texbake.building.digests import canonical, checksum
from texbake.building.resolve import differences, ingredients_of
from texbake.building.steps import STEP_KINDS
from texbake.errors import OptionError

# Inputs that each kind must be given.
GIVEN = {
    "make": {"shape": "sphere"}, "simplify": {"faces": 9}, "export": {"to": "unity"},
    "pack-channels": {"red": "occlusion"}, "run": {"faces": 9},
}  # fmt: skip


def key(name, given, **more):
    kind = STEP_KINDS[name]
    settings = kind.settings({**GIVEN.get(name, {}), **given})
    inputs = more.get("inputs", {"mesh": [{"called": "a.ply", "sha256": "0"}]})
    return checksum(ingredients_of(kind, settings, inputs, more.get("asset", "a")))


@pytest.mark.parametrize("name", STEP_KINDS)
def test_every_setting_changes_the_key_and_written_defaults_do_not(name):
    kind = STEP_KINDS[name]
    written = {
        field.name: field.default
        for field in dataclasses.fields(kind.options)
        if field.name in kind.choices
        and field.name not in GIVEN.get(name, {})
        and field.default is not dataclasses.MISSING
    }
    assert key(name, {}) == key(name, written)
    # Each alone, whatever its value: the key is that of all settings.
    settings = kind.settings(GIVEN.get(name, {}))
    others = [{**settings, changed: "another"} for changed in kind.choices]
    keys = {checksum(ingredients_of(kind, each, {}, "a")) for each in (settings, *others)}
    assert len(keys) == 1 + len(kind.choices)


def test_inputs_change_the_key_and_assets_do_not():
    base = key("repair", {})
    other = {"mesh": [{"called": "a.ply", "sha256": "1"}]}
    called = {"mesh": [{"called": "b.ply", "sha256": "0"}]}
    assert len({base, key("repair", {}, inputs=other), key("repair", {}, inputs=called)}) == 3
    assert key("repair", {}, asset="b") == base


def test_threads_are_not_part_of_the_key():
    assert not any("threads" in kind.choices for kind in STEP_KINDS.values())


def test_canonical_json_has_one_form():
    assert canonical({"b": 1, "a": [1.5, "ö"]}) == '{"a":[1.5,"ö"],"b":1}'.encode()


def test_differences_name_what_changed():
    kind = STEP_KINDS["unwrap"]
    files = {"mesh": [{"called": "a.ply", "sha256": "0"}]}
    before = ingredients_of(kind, kind.settings({}), files, "a")
    now = ingredients_of(
        kind, kind.settings({"size": 512}), {"mesh": [{"called": "a.ply", "sha256": "1"}]}, "a"
    )
    assert differences(before, before) == []
    assert differences(before, now) == ["size: 1024 before, 512 now", "mesh changed: a.ply"]
    assert differences({**before, "texbake": "0.0"}, before)[0].startswith(
        "the version: 0.0 before"
    )


def test_settings_are_checked_by_their_classes():
    with pytest.raises(OptionError, match=r"maps: .*nrmal.* is not one of normal"):
        STEP_KINDS["bake"].settings({"maps": ("nrmal",)})
    with pytest.raises(OptionError, match="format: 'displacement' is not one of the maps"):
        STEP_KINDS["bake"].settings({"format": {"displacement": "exr"}})
    with pytest.raises(OptionError, match="each level must have fewer"):
        STEP_KINDS["simplify"].settings({"faces": (9, 9)})
    with pytest.raises(OptionError, match="max_stretch"):
        STEP_KINDS["check"].settings({"max_stretch": 0.5})
