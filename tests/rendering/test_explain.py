"""Output of --explain: passes in order with reasons and costs, and the effects left out."""

import json

import numpy as np
import pytest

from texbake import ImageTexture, Light, Lighting, Material, RenderOptions, Scene, SceneObject
from texbake.mesh.shapes import plane
from texbake.rendering.camera import Camera
from texbake.rendering.draw import draw, plan_of, prepare
from texbake.rendering.effects import EFFECTS
from texbake.rendering.plan import EVERY_PICTURE, plan_report, plan_rows, plan_table
from texbake.rendering.scene.material import NormalMap, Reflection
from texbake.rendering.scene.scene import transform_matrix

OPTIONS = RenderOptions(width=24, height=16, view=(0.0, 0.0))
SUN, DARK = Light(name="sun", direction=(0, -1, -1)), Light(name="off", intensity=0.0)


def mapped(name, z):
    flat = np.zeros((4, 4, 3), np.float32)
    flat[..., 2] = 1.0
    material = Material(shading="lambert", normal_map=NormalMap(texture=ImageTexture(image=flat)))
    return SceneObject(
        mesh=plane(), material=material, name=name, transform=transform_matrix(translate=(0, 0, z))
    )


def scene(n=1):
    return Scene(
        objects=tuple(mapped(f"tile {i}", -0.1 * i) for i in range(n)),
        lighting=Lighting(lights=(SUN, DARK)),
    )


def camera():
    return Camera.framing(plane(), options=OPTIONS)


def explained(the_scene):
    plan = plan_of(prepare(the_scene, OPTIONS), camera())
    frame = draw(prepare(the_scene, OPTIONS), camera())
    return plan, frame


def test_rows_stand_in_the_order_in_which_passes_run():
    plan, _ = explained(scene())
    names = [row.name for row in plan_rows(plan)]
    assert names[0] == "placing" and names[1:3] == ["rasterizing", "fragments"]
    assert names[-1] == "pixels"
    inside = [name for name in names if name not in EVERY_PICTURE]
    order = [effect.name for effect in EFFECTS]
    assert inside == sorted(inside, key=order.index)
    assert set(inside) == {item.name for item in plan.passes}


def test_before_it_is_drawn_nothing_is_known_of_time_and_memory():
    plan, frame = explained(scene())
    assert all(row.milliseconds is None and row.n_bytes is None for row in plan_rows(plan))
    rows = {row.name: row for row in plan_rows(frame.plan, frame.costs)}
    assert all(row.milliseconds >= 0.0 and row.n_bytes >= 0 for row in rows.values())
    assert rows["lambert"].milliseconds > 0.0 and rows["rasterizing"].milliseconds > 0.0
    # Two triangles of three tangents of four float32; depth and triangle of 48 x 32 samples.
    assert rows["tangents"].n_bytes == 2 * 3 * 4 * 4
    assert rows["rasterizing"].n_bytes == 8 * 48 * 32
    # 4 x 4 texels of three float32, and with them 2 x 2 and 1.
    assert rows["images"].n_bytes == 192 and rows["mip maps"].n_bytes == 252


def test_many_askers_of_one_reason_are_counted():
    (row,) = (row for row in plan_rows(explained(scene(4))[0]) if row.name == "normal map")
    assert row.reasons == (
        'its material has a normal map (object "tile 0" and 3 others)',
        'for lambert (object "tile 0" and 3 others)',
    )
    (row,) = (row for row in plan_rows(explained(scene(2))[0]) if row.name == "tangents")
    assert row.reasons == ('for normal map (object "tile 0", object "tile 1")',)


def test_the_table_has_a_head_and_as_many_cells_in_every_row():
    plan, frame = explained(scene(3))
    rows, left_out = plan_table(plan)
    assert rows[0] == ("pass", "called for by")
    assert all(len(row) == 2 for row in rows) and len(rows) == 1 + len(plan_rows(plan))
    rows, _ = plan_table(frame.plan, frame.costs)
    assert rows[0] == ("pass", "called for by", "ms", "kB")
    assert all(len(row) == 4 for row in rows)
    told = dict(left_out)
    assert told["fog"] == "the scene has no fog"
    assert told["lights"] == 'light "off": it is dark'
    present = {item.name for item in plan.passes}
    assert {effect.name for effect in EFFECTS} == present | set(told)


def test_a_pass_that_was_not_needed_after_all_says_so():
    mirror = SceneObject(
        mesh=plane(), name="mirror", transform=transform_matrix(translate=(0, 0, -3)),
        material=Material(shading="unlit", reflection=Reflection(environment="rendered")),
    )  # fmt: skip
    front = SceneObject(
        mesh=plane(), material=Material(shading="unlit"), name="front",
        transform=transform_matrix(scale=9, translate=(-4, -4, 0)),
    )  # fmt: skip
    _, frame = explained(Scene(objects=(mirror, front)))
    rows, _ = plan_table(frame.plan, frame.costs)
    (cells,) = (row for row in rows if row[0] == "rendered environment")
    assert cells == ("rendered environment", "not run: not in the picture", "0.0", "0")
    (entry,) = (
        item
        for item in plan_report(frame.plan, frame.costs)["passes"]
        if item["name"] == "rendered environment"
    )
    assert entry["skipped"] == "not in the picture"


@pytest.mark.parametrize("is_drawn", [False, True])
def test_the_report_is_json_with_every_call(is_drawn):
    plan, frame = explained(scene(2))
    report = plan_report(plan, frame.costs if is_drawn else None)
    assert json.loads(json.dumps(report)) == report
    entries = {entry["name"]: entry for entry in report["passes"]}
    assert entries["normal map"]["called_for_by"][0] == {
        "target": 0, "by": 'object "tile 0"', "why": "its material has a normal map",
    }  # fmt: skip
    assert entries["rasterizing"]["called_for_by"] == [
        {"target": None, "by": "every picture", "why": "it is drawn"}
    ]
    assert [("milliseconds" in entry) for entry in report["passes"]] == [is_drawn] * len(entries)
    assert {"name": "lights", "by": 'light "off"', "why": "it is dark"} in report["left_out"]
    assert {"name": "fog", "by": None, "why": "the scene has no fog"} in report["left_out"]
