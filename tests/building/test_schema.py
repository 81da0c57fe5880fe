"""The JSON Schemas of pipeline and scene files, held against the samples."""

import json
import tomllib
from pathlib import Path

import jsonschema
import pytest

from texbake.building.file import pipeline_schema, schema_file
from texbake.building.steps import STEP_KINDS
from texbake.rendering.scene.file.schema import scene_schema

SAMPLES = Path(__file__).parents[2] / "samples"
SCENES = sorted((SAMPLES / "scenes").glob("*.toml"))
SCENE = {"objects": [{"shape": "cube"}]}
ASSETS = {"assets": [{"name": "a"}]}


@pytest.fixture(scope="module")
def scene():
    jsonschema.Draft202012Validator.check_schema(scene_schema())
    return jsonschema.Draft202012Validator(scene_schema())


@pytest.fixture(scope="module")
def pipeline():
    jsonschema.Draft202012Validator.check_schema(pipeline_schema())
    return jsonschema.Draft202012Validator(pipeline_schema())


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_every_sample_scene_is_valid(scene, path):
    found = scene.iter_errors(tomllib.loads(path.read_text(encoding="utf-8")))
    assert [error.message for error in found] == []


def test_the_sample_pipeline_is_valid(pipeline):
    text = (SAMPLES / "pipeline.toml").read_text(encoding="utf-8")
    assert [error.message for error in pipeline.iter_errors(tomllib.loads(text))] == []


@pytest.mark.parametrize("wrong", [
    {},
    {**SCENE, "camra": {}},
    {"objects": [{"shape": "kube"}]},
    {**SCENE, "render": {"width": 0}},
    {**SCENE, "render": {"up": "x"}},
    {**SCENE, "lights": [{"kind": "spot", "color": "red"}]},
    {**SCENE, "materials": {"a": {"roughness": 2}}},
    {"objects": [{"shape": "cube", "material": {"base_color": {"procedure": "fog"}}}]},
])  # fmt: skip
def test_a_wrong_scene_is_not_valid(scene, wrong):
    assert not scene.is_valid(wrong)


@pytest.mark.parametrize("step", [
    {"do": "fry"},
    {"do": "bake", "high": "a", "low": "b", "size": 0},
    {"do": "bake", "high": "a", "low": "b", "padding": "wide"},
    {"do": "bake", "low": "b"},
    {"do": "simplify", "mesh": "a", "faces": 500, "quality": "good"},
    {"do": "simplify", "mesh": "a", "faces": 500, "threads": 2},
])  # fmt: skip
def test_a_wrong_step_is_not_valid(pipeline, step):
    assert pipeline.is_valid({**ASSETS, "steps": {"low": {"do": "make", "shape": "plane"}}})
    assert not pipeline.is_valid({**ASSETS, "steps": {"low": step}})


def described(schema, place=""):
    """Every key of a schema with its description."""
    for part in (schema, *schema.get("anyOf", ()), *schema.get("oneOf", ())):
        for key, of_key in part.get("properties", {}).items():
            yield f"{place}.{key}", of_key.get("description")


def test_every_key_is_described():
    keys = [*described(scene_schema()), *described(pipeline_schema())]
    for name, table in scene_schema()["$defs"].items():
        keys += described(table, name)
    for kind in pipeline_schema()["properties"]["steps"]["additionalProperties"]["oneOf"]:
        keys += described(kind, kind["title"])
    assert [key for key, text in keys if not text] == []
    assert len(keys) > 200


def test_every_kind_of_step_has_a_schema():
    kinds = pipeline_schema()["properties"]["steps"]["additionalProperties"]["oneOf"]
    assert [kind["properties"]["do"]["const"] for kind in kinds] == list(STEP_KINDS)


def test_a_schema_can_be_written(tmp_path):
    path = tmp_path / "scene.schema.json"
    assert schema_file(scene_schema(), path).files == (path,)
    assert json.loads(path.read_text(encoding="utf-8")) == scene_schema()
