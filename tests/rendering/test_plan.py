"""Effects that nothing calls for never run, and laws that hold for every effect."""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest

import texbake.rendering.draw as drawing
from texbake import (
    Ambient,
    ImageTexture,
    Light,
    Lighting,
    Material,
    RenderOptions,
    Scene,
    SceneObject,
    UnwrapOptions,
)
from texbake.mesh.mesh import UvSet
from texbake.mesh.shapes import plane
from texbake.rendering.camera import Camera
from texbake.rendering.draw import draw, plan_of, prepare
from texbake.rendering.effect import Activation, Effect, Rejection
from texbake.rendering.effects import EFFECTS
from texbake.rendering.plan import compile_plan
from texbake.rendering.request import RenderRequest
from texbake.rendering.scene.lights import AmbientOcclusion, Environment, Fog, Shadow
from texbake.rendering.scene.material import (
    BumpMap,
    Displacement,
    NormalMap,
    Parallax,
    Reflection,
    Refraction,
    Transmission,
)
from texbake.rendering.scene.projected import ProjectedTexture
from texbake.rendering.scene.textures import ProcedureTexture

SMALL = RenderOptions(width=24, height=16, supersampling=2, view=(20.0, 25.0))
SUN = Light(name="sun", direction=(-0.3, -0.6, -1.0))
LAMP = Light(name="lamp", kind="spot", position=(0.5, 0.5, 2.0), direction=(0, 0, -1), angle=90)
ROOM = Environment(color=(0.2, 0.3, 0.4), lighting=True)
HALF = Reflection(strength=0.5, environment="rendered", size=8)
CROSSED = plane().replace(positions=plane().positions[:, [2, 0, 1]] + (0.5, 0.0, 0.0))
TWO_SETS = plane().replace(uv_sets={"second": UvSet(plane().uvs, plane().uv_faces)})
HOOKS = ("load", "prepare", "shade", "dim", "tint", "unneeded", "behind")


def picture(channels=3, **fields):
    pixels = np.random.default_rng(1).random((8, 8, channels)).astype(np.float32)
    return ImageTexture(image=pixels, **fields)


def normals(space="tangent"):
    leaning = np.tile(np.array([0.48, 0.6, 0.64], np.float32), (4, 4, 1))
    return NormalMap(texture=ImageTexture(image=leaning, filter="bilinear"), space=space)


def scene(*materials, meshes=None, lighting=None, **fields):
    """Objects one behind another, the last one in front."""
    objects = tuple(
        SceneObject(
            mesh=(meshes or [plane()] * len(materials))[i],
            material=material,
            transform=np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0.3 * i], [0, 0, 0, 1.0]]),
            name=f"item {i}",
            **fields,
        )
        for i, material in enumerate(materials)
    )
    return Scene(objects=objects, lighting=lighting or Lighting())


def unlit(**fields):
    return Material(shading="unlit", **fields)


def lambert(**fields):
    return Material(shading="lambert", **fields)


@dataclass(frozen=True, kw_only=True)
class Case:
    """A scene that calls for an effect, one near it that does not, and `why`, or why none."""

    wanted: Scene
    unwanted: Scene | None = None
    why: str | None = None
    options: RenderOptions = SMALL
    unwanted_options: RenderOptions = SMALL
    always: str = ""


def lit(*lights, **fields):
    return Lighting(lights=lights, **fields)


def pair(wanted, unwanted, lighting=None, **fields):
    """A case of two materials in one light, by default that of the sun."""
    lighting = lighting or lit(SUN)
    one, other = (scene(each, lighting=lighting) for each in (wanted, unwanted))
    return Case(wanted=one, unwanted=other, **fields)


OCCLUDED = Lighting(ambient=Ambient(color=(1, 1, 1)), occlusion=AmbientOcclusion())
DARK_CORNERS = Case(
    wanted=scene(lambert(), lambert(), meshes=[CROSSED, plane()], lighting=OCCLUDED),
    unwanted=scene(lambert(), lighting=replace(OCCLUDED, ambient=Ambient())),
)
GLASS = Case(wanted=scene(unlit(), unlit(opacity=0.5)), unwanted=scene(unlit(), unlit(opacity=1.0)))
SHADOWED = Case(
    wanted=scene(lambert(), lambert(), lighting=lit(replace(SUN, shadow=Shadow(size=32)))),
    unwanted=scene(lambert(), lambert(), lighting=lit(SUN)),
)
TEXTURED = pair(unlit(base_color=picture()), unlit(base_color=(0.1, 0.2, 0.3)))
FILTERED = pair(
    unlit(base_color=picture(filter="trilinear")), unlit(base_color=picture(filter="bilinear"))
)
SURROUNDED = Case(
    wanted=scene(lambert(), lighting=Lighting(environment=ROOM)),
    unwanted=scene(
        lambert(), lighting=Lighting(environment=replace(ROOM, background=False, lighting=False))
    ),
)
THROUGH = pair(Material(transmission=Transmission()), lambert(transmission=Transmission()))
CASES: dict[str, Case] = {
    "placing": Case(wanted=scene(unlit()), always="a scene has at least one object"),
    "mapping": Case(
        wanted=scene(unlit(base_color=picture()), mapping=UnwrapOptions(method="spherical")),
        unwanted=scene(unlit(), mapping=UnwrapOptions(method="spherical")),
    ),
    "displacement": pair(unlit(displacement=Displacement(texture=picture(1), height=0.1)), unlit()),
    "layers": GLASS,
    "transparency": GLASS,
    "occlusion picture": DARK_CORNERS,
    "ambient occlusion": replace(DARK_CORNERS, why="it has no ambient light to darken"),
    "lights": pair(lambert(), unlit(), why="no object in the picture is lit"),
    "shadow maps": SHADOWED,
    "shadows": SHADOWED,
    "light profiles": Case(
        wanted=scene(lambert(), lighting=lit(replace(LAMP, profile=picture()))),
        unwanted=scene(lambert(), lighting=lit(LAMP)),
    ),
    "environment": SURROUNDED,
    "background": replace(SURROUNDED, why="its environment is not shown as the background"),
    "irradiance": SURROUNDED,
    "environment light": SURROUNDED,
    "prefiltered environment": pair(Material(), lambert(), Lighting(environment=ROOM)),
    "rendered environment": Case(
        wanted=scene(
            unlit(reflection=HALF),
            unlit(reflection=HALF, base_color=(0.9, 0.2, 0.1), double_sided=True),
        ),
        unwanted=scene(unlit(reflection=Reflection(environment="scene")), unlit()),
    ),
    "positions": Case(
        wanted=scene(lambert(), lighting=lit(LAMP)), unwanted=scene(lambert(), lighting=lit(SUN))
    ),
    "view directions": pair(Material(shading="blinn-phong"), lambert()),
    "derivatives": FILTERED,
    "mip maps": FILTERED,
    "images": TEXTURED,
    "texture coordinates": TEXTURED,
    "further texture coordinates": Case(
        wanted=scene(unlit(base_color=picture(uv_set="second")), meshes=[TWO_SETS]),
        unwanted=scene(unlit(base_color=picture()), meshes=[TWO_SETS]),
    ),
    "procedures": pair(unlit(base_color=ProcedureTexture(procedure="checker")), unlit()),
    "slots": Case(
        wanted=scene(unlit()),
        unwanted=scene(unlit()),
        unwanted_options=replace(SMALL, buffer="object-id"),
    ),
    "projected textures": pair(
        unlit(projected=(ProjectedTexture(texture=picture(), matrix=np.eye(4)),)), unlit()
    ),
    "parallax": pair(
        unlit(base_color=picture(), parallax=Parallax(texture=picture(1), depth=0.02)),
        unlit(base_color=picture()),
    ),
    "vertex normals": pair(lambert(), unlit()),
    "normals": pair(lambert(), lambert(normal_map=normals())),
    "tangents": pair(lambert(normal_map=normals()), lambert(normal_map=normals("object"))),
    "normal map": pair(lambert(normal_map=normals()), unlit(normal_map=normals())),
    "bump map": pair(lambert(bump_map=BumpMap(texture=picture(1))), lambert()),
    "emboss": pair(
        lambert(bump_map=BumpMap(texture=picture(1), form="emboss")),
        lambert(bump_map=BumpMap(texture=picture(1))),
    ),
    "unlit": pair(unlit(), lambert()),
    "lambert": pair(lambert(), Material(shading="blinn-phong")),
    "blinn-phong": pair(Material(shading="blinn-phong"), Material()),
    "metallic-roughness": pair(Material(), lambert()),
    "ambient": Case(
        wanted=scene(lambert(), lighting=Lighting(ambient=Ambient(color=(1, 1, 1)))),
        unwanted=scene(lambert(), lighting=lit(SUN)),
    ),
    "vertex light": pair(lambert(shading_rate="vertex"), lambert(), lit(LAMP)),
    "light map": pair(lambert(light_map=0.5), unlit(light_map=0.5), Lighting()),
    "emission": pair(lambert(emission=(1, 1, 1)), lambert(), Lighting()),
    "refraction": Case(
        wanted=scene(unlit(refraction=Refraction()), lighting=Lighting(environment=ROOM)),
        unwanted=scene(unlit(reflection=Reflection())),
    ),
    "reflection": Case(
        wanted=scene(unlit(reflection=Reflection()), lighting=Lighting(environment=ROOM)),
        unwanted=scene(unlit(refraction=Refraction())),
    ),
    "picture behind": THROUGH,
    "transmission": THROUGH,
    "fog behind": Case(
        wanted=scene(unlit(), lighting=Lighting(fog=Fog())), unwanted=scene(unlit())
    ),
    "fog": Case(wanted=scene(unlit(), lighting=Lighting(fog=Fog())), unwanted=scene(unlit())),
    "buffer": Case(
        wanted=scene(unlit()), unwanted=scene(unlit()), options=replace(SMALL, buffer="depth")
    ),
}


def camera_for(options):
    return Camera.framing(plane(), options=options)


def counted(effects, monkeypatch):
    """The same effects, with a list of the (effect, hook) that were entered."""
    entered: list[tuple[str, str]] = []

    def watched(effect, hook):
        function = getattr(effect, hook)

        def enter(*arguments):
            entered.append((effect.name, hook))
            return function(*arguments)

        return None if function is None else enter

    def computed(state, prepared, effect, result, target, compute=drawing._computed):
        entered.append((effect.name, "load" if result is effect.load else "prepare"))
        return compute(state, prepared, effect, result, target)

    # The functions of `load` and `prepare` are keys, too, so they are watched where they run.
    monkeypatch.setattr(drawing, "_computed", computed)
    others = [hook for hook in HOOKS if hook not in ("load", "prepare")]
    copies = [replace(each, **{hook: watched(each, hook) for hook in others}) for each in effects]
    return tuple(copies), entered


def drawn(the_scene, options=SMALL, effects=EFFECTS):
    return draw(prepare(the_scene, options, effects=effects, threads=2), camera_for(options))


def reasons(plan, name):
    return [item.why for item in plan.left_out if item.name == name]


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda effect: effect.name)
def test_what_is_called_for_is_entered_and_nothing_else(effect, monkeypatch):
    case = CASES[effect.name]  # an effect without a scene is not tested
    copies, entered = counted(EFFECTS, monkeypatch)
    frame = drawn(case.wanted, case.options, copies)
    assert frame.plan.has(effect.name)
    hooks = {hook for hook in HOOKS if getattr(effect, hook) is not None}
    assert {hook for name, hook in entered if name == effect.name} == hooks
    # Nothing is entered that the plan does not list; the pictures of environments have their own.
    listed = {item.name for item in frame.plan.passes}
    if not frame.plan.has("rendered environment"):
        assert {name for name, _ in entered} <= listed
    if case.unwanted is None:
        assert case.always
        return
    copies, entered = counted(EFFECTS, monkeypatch)
    frame = drawn(case.unwanted, case.unwanted_options, copies)
    assert not frame.plan.has(effect.name)
    assert [hook for name, hook in entered if name == effect.name] == []
    assert (case.why or effect.left_out) in reasons(frame.plan, effect.name)
    assert effect.name not in frame.costs.by_name


# Laws of all effects, over the scenes that activate them.
@cache
def picture_with(effect):
    """The scene that activates an effect, and its picture."""
    case = CASES[effect.name]
    return case, drawn(case.wanted, case.options)


def pixels_of(frame):
    return frame.color.tobytes() + frame.coverage.tobytes()


REMOVABLE = [effect for effect in EFFECTS if effect.scene_without(CASES[effect.name].wanted)]


@pytest.mark.parametrize("effect", REMOVABLE, ids=lambda effect: effect.name)
def test_an_effect_changes_its_picture_and_a_scene_without_it_has_no_pass_of_it(effect):
    case, frame = picture_with(effect)
    bare = drawn(effect.scene_without(case.wanted), case.options)
    assert not bare.plan.has(effect.name)
    assert np.abs(frame.color - bare.color).max() > 0.01
    # Also where nothing else would have activated it: the lists agree on what is left.
    assert {item.name for item in bare.plan.passes} <= {item.name for item in EFFECTS}


@pytest.mark.parametrize(
    "effect", [item for item in EFFECTS if item.strength is not None], ids=lambda item: item.name
)
def test_a_strength_of_0_is_the_scene_without_the_effect(effect):
    """Byte for byte; its plan names the key whose value is 0."""
    case = CASES[effect.name].wanted

    def weakened(material):
        value = getattr(material, effect.material_field)
        if value is None:
            return material
        zero = replace(value, **{effect.strength: 0.0}) if effect.strength else (0.0, 0.0, 0.0)
        return replace(material, **{effect.material_field: zero})

    weak = drawn(case.with_materials(weakened))
    bare = drawn(effect.scene_without(case))
    assert pixels_of(weak) == pixels_of(bare) and not weak.plan.has(effect.name)
    why = f"its {effect.strength} is 0" if effect.strength else "it is black"
    assert why in reasons(weak.plan, effect.name)


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda effect: effect.name)
def test_effects_of_the_plan_alone_draw_the_same(effect):
    case, frame = picture_with(effect)
    used = tuple(item.effect for item in frame.plan.passes)
    if frame.plan.has("rendered environment"):
        return  # its pictures have plans of their own
    assert pixels_of(drawn(case.wanted, case.options, used)) == pixels_of(frame)


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda effect: effect.name)
def test_the_order_of_objects_and_lights_changes_nothing(effect):
    case, frame = picture_with(effect)
    lighting = replace(case.wanted.lighting, lights=case.wanted.lighting.lights[::-1])
    turned = replace(case.wanted, objects=case.wanted.objects[::-1], lighting=lighting)
    other = drawn(turned, case.options)
    np.testing.assert_allclose(other.color, frame.color, atol=1e-6)
    np.testing.assert_array_equal(other.coverage, frame.coverage)


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda effect: effect.name)
def test_another_camera_finds_nothing_of_the_picture_before(effect):
    """What a scene keeps for later pictures does not depend on the camera."""
    case, _ = picture_with(effect)
    prepared = prepare(case.wanted, case.options, threads=2)
    first, second = (
        Camera.framing(plane(), options=replace(case.options, view=view))
        for view in ((20.0, 25.0, 2.0), (-40.0, 10.0))
    )
    frames = [draw(prepared, camera) for camera in (first, second, first)]
    assert pixels_of(frames[0]) == pixels_of(frames[2]) != pixels_of(frames[1])
    fresh = draw(prepare(case.wanted, case.options, threads=2), second)
    assert pixels_of(fresh) == pixels_of(frames[1])


# Those for which the inside of a surface is another relief, or another medium.
SIDED = ("displacement", "parallax", "bump map", "emboss", "normal map", "tangents", "refraction",
         "light profiles", "shadow maps", "shadows", "derivatives", "mip maps")  # fmt: skip


@pytest.mark.parametrize(
    "effect", [item for item in EFFECTS if item.name not in SIDED], ids=lambda item: item.name
)
def test_a_surface_that_is_wound_the_other_way_looks_the_same(effect):
    """Where both sides are drawn, normals turn to the eye."""
    case, _ = picture_with(effect)

    def flipped(item):
        mesh = item.mesh
        faces = {"faces": mesh.faces[:, ::-1].copy(), "uv_faces": mesh.uv_faces[:, ::-1].copy()}
        sets = {
            name: UvSet(one.uvs, one.faces[:, ::-1].copy()) for name, one in mesh.uv_sets.items()
        }
        return replace(item, mesh=mesh.replace(**faces, uv_sets=sets))

    options = replace(case.options, back_faces="show")
    turned = replace(case.wanted, objects=tuple(map(flipped, case.wanted.objects)))
    one, other = (drawn(item, options).color for item in (case.wanted, turned))
    np.testing.assert_allclose(other, one, atol=1e-4)


def watching(scene_effects=EFFECTS):
    """All effects, plus one at the end that records the shaded fragments."""
    kept = []
    probe = Effect(
        name="probe", does="looks",
        activations=lambda request: [Activation(i, "the test", "it looks") for i in request.shaded],
        left_out="nothing is shaded", shade=lambda fragments, picture: kept.append(fragments),
    )  # fmt: skip
    return (*scene_effects, probe), kept


@pytest.mark.parametrize(("texture", "wanted"), [
    (ProcedureTexture(procedure="checker"), True),
    (ProcedureTexture(procedure="checker", filtered=False), False),
    (picture(filter="trilinear"), True),
    (picture(filter="nearest"), False),
    ((0.1, 0.2, 0.3), False),
])  # fmt: skip
def test_derivatives_are_found_only_for_what_is_filtered_over_the_pixel(texture, wanted):
    effects, kept = watching()
    frame = drawn(scene(unlit(base_color=texture)), SMALL, effects)
    assert frame.plan.has("derivatives") == wanted
    assert [len(item.changes) > 0 for item in kept] == [wanted] * len(kept) and kept


def entered_by(the_scene, options=SMALL):
    with pytest.MonkeyPatch.context() as monkeypatch:
        copies, entered = counted(EFFECTS, monkeypatch)
        frame = drawn(the_scene, options, copies)
    return frame, set(entered)


def with_item(the_scene, index, **changes):
    objects = list(the_scene.objects)
    objects[index] = replace(objects[index], **changes)
    return replace(the_scene, objects=tuple(objects))


def far_away():
    matrix = np.eye(4)
    matrix[0, 3] = 1e4
    return matrix


def test_no_environment_is_rendered_without_a_reflector_in_view():
    mirror = unlit(reflection=Reflection(environment="rendered", size=4))
    both = scene(unlit(), mirror)
    frame, entered = entered_by(both)
    assert ("rendered environment", "load") in entered
    # Out of the picture: it is not even planned.
    frame, entered = entered_by(with_item(both, 1, transform=far_away()))
    assert not frame.plan.has("rendered environment")
    # Behind another surface: planned, and dropped once that is known.
    hidden = scene(mirror, unlit())
    options = replace(SMALL, view=(0.0, 0.0))
    front = with_item(hidden, 1, mesh=plane().replace(positions=plane().positions * 3 - (1, 1, 0)))
    frame, entered = entered_by(front, options)
    assert frame.plan.has("rendered environment")
    assert not entered & {("rendered environment", hook) for hook in ("load", "prepare")}
    assert frame.costs.by_name["rendered environment"].skipped == "not in the picture"
    # A lone mirror has nothing to show.
    frame, entered = entered_by(scene(mirror))
    assert reasons(frame.plan, "rendered environment") == ["the scene has no other object to show"]


def test_what_is_unlit_or_out_of_the_picture_calls_for_hardly_anything():
    plan = plan_of(prepare(scene(unlit())), camera_for(SMALL))
    assert [item.name for item in plan.passes] == ["placing", "slots", "unlit"]
    away = with_item(scene(Material(), lighting=lit(SUN)), 0, transform=far_away())
    plan = plan_of(prepare(away), camera_for(SMALL))
    assert [item.name for item in plan.passes] == ["placing"]


def fake(name, *, calls=(), needs=(), of="object"):
    return Effect(
        name=name, does=name, of=of, activations=lambda request: list(calls), left_out=f"no {name}",
        needs=needs,
    )  # fmt: skip


def test_needs_are_followed_through_and_lists_out_of_order_are_defects():
    request = RenderRequest(scene(unlit(), unlit()), SMALL, camera_for(SMALL))
    asks = [
        Activation(1, "b", "wants it"),
        Activation(0, "a", "wants it"),
        Rejection("is too late", "c"),
    ]
    effects = [
        fake("sky", of="picture"), fake("ground", needs=("sky",)), fake("idle", needs=("ground",)),
        fake("tree", calls=asks, needs=("ground",)),
    ]  # fmt: skip
    plan = compile_plan(request, effects)
    assert [(item.name, item.targets) for item in plan.passes] == [
        ("sky", (None,)), ("ground", (0, 1)), ("tree", (0, 1)),
    ]  # fmt: skip
    assert [(item.name, item.requested_by, item.why) for item in plan.left_out] == [
        ("idle", "", "no idle"), ("tree", "c", "is too late"),
    ]  # fmt: skip
    with pytest.raises(AssertionError, match="tree comes before ground"):
        compile_plan(request, effects[::-1])
