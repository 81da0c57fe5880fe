"""Effects that nothing calls for never run: a scene with and one without each effect."""

import inspect
import sys
import threading
import types
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, replace

import numpy as np
import pytest

from texbake.mapping.options import UnwrapOptions
from texbake.mesh.shapes import cube, plane, uv_sphere
from texbake.mesh.uv_sets import UvSet
from texbake.rendering.camera import Camera
from texbake.rendering.draw import draw, plan_of, prepare
from texbake.rendering.effect import Activation, Effect, Rejection
from texbake.rendering.effects import EFFECTS, images
from texbake.rendering.options import RenderOptions
from texbake.rendering.plan import compile_plan
from texbake.rendering.request import RenderRequest
from texbake.rendering.results import Result
from texbake.rendering.scene.lights import (
    Ambient,
    AmbientOcclusion,
    Environment,
    Fog,
    Light,
    Lighting,
    Shadow,
)
from texbake.rendering.scene.material import (
    BumpMap,
    Displacement,
    Material,
    NormalMap,
    Parallax,
    ProjectedTexture,
    Reflection,
    Refraction,
)
from texbake.rendering.scene.scene import Scene, SceneObject
from texbake.rendering.scene.textures import ImageTexture, ProcedureTexture

SMALL = RenderOptions(width=24, height=16, supersampling=2, view=(20.0, 25.0))
SUN = Light(name="sun", direction=(-0.3, -0.6, -1.0))
LAMP = Light(name="lamp", kind="spot", position=(0.5, 0.5, 2.0), direction=(0, 0, -1), angle=90)
ROOM = Environment(color=(0.2, 0.3, 0.4), lighting=True)
TWO_SETS = plane().replace(uv_sets={"second": UvSet(plane().uvs, plane().uv_faces)})
HOOKS = ("load", "prepare", "shade", "dim", "tint", "unneeded", "behind")


def picture(channels=3, **fields):
    pixels = np.random.default_rng(1).random((8, 8, channels)).astype(np.float32)
    return ImageTexture(image=pixels, **fields)


def normals(space="tangent"):
    flat = np.zeros((4, 4, 3), np.float32)
    flat[..., 2] = 1.0
    return NormalMap(texture=ImageTexture(image=flat, filter="bilinear"), space=space)


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
    """A scene that calls for an effect, and one as near to it as can be that does not.

    `why` is what the plan says of the second; None: what the effect itself says. Without a second
    scene, `always` tells why there can be none.
    """

    wanted: Scene
    unwanted: Scene | None = None
    why: str | None = None
    options: RenderOptions = SMALL
    unwanted_options: RenderOptions = SMALL
    always: str = ""


def lit(*lights, **fields):
    return Lighting(lights=lights, **fields)


OCCLUDED = Lighting(ambient=Ambient(color=(1, 1, 1)), occlusion=AmbientOcclusion())
DARK_CORNERS = Case(
    wanted=scene(lambert(), lighting=OCCLUDED),
    unwanted=scene(lambert(), lighting=replace(OCCLUDED, ambient=Ambient())),
)
GLASS = Case(wanted=scene(unlit(), unlit(opacity=0.5)), unwanted=scene(unlit(), unlit(opacity=1.0)))
SHADOWED = Case(
    wanted=scene(lambert(), lambert(), lighting=lit(replace(SUN, shadow=Shadow(size=32)))),
    unwanted=scene(lambert(), lambert(), lighting=lit(SUN)),
)
TEXTURED = Case(
    wanted=scene(unlit(base_color=picture())),
    unwanted=scene(unlit(base_color=(0.1, 0.2, 0.3))),
)
FILTERED = Case(
    wanted=scene(unlit(base_color=picture(filter="trilinear"))),
    unwanted=scene(unlit(base_color=picture(filter="bilinear"))),
)
SURROUNDED = Case(
    wanted=scene(lambert(), lighting=Lighting(environment=ROOM)),
    unwanted=scene(
        lambert(),
        lighting=Lighting(environment=replace(ROOM, background=False, lighting=False)),
    ),
)
CASES: dict[str, Case] = {
    "placing": Case(wanted=scene(unlit()), always="a scene has at least one object"),
    "mapping": Case(
        wanted=scene(unlit(base_color=picture()), mapping=UnwrapOptions(method="spherical")),
        unwanted=scene(unlit(), mapping=UnwrapOptions(method="spherical")),
    ),
    "displacement": Case(
        wanted=scene(unlit(displacement=Displacement(texture=picture(1), height=0.1))),
        unwanted=scene(unlit()),
    ),
    "layers": GLASS,
    "transparency": GLASS,
    "occlusion picture": DARK_CORNERS,
    "ambient occlusion": replace(DARK_CORNERS, why="it has no ambient light to darken"),
    "lights": Case(
        wanted=scene(lambert(), lighting=lit(SUN)),
        unwanted=scene(unlit(), lighting=lit(SUN)),
        why="no object in the picture is lit",
    ),
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
    "prefiltered environment": Case(
        wanted=scene(Material(), lighting=Lighting(environment=ROOM)),
        unwanted=scene(lambert(), lighting=Lighting(environment=ROOM)),
    ),
    "rendered environment": Case(
        wanted=scene(unlit(), unlit(reflection=Reflection(environment="rendered", size=8))),
        unwanted=scene(unlit(), unlit(reflection=Reflection(environment="scene"))),
    ),
    "positions": Case(
        wanted=scene(lambert(), lighting=lit(LAMP)), unwanted=scene(lambert(), lighting=lit(SUN))
    ),
    "view directions": Case(
        wanted=scene(Material(shading="blinn-phong"), lighting=lit(SUN)),
        unwanted=scene(lambert(), lighting=lit(SUN)),
    ),
    "derivatives": FILTERED,
    "mip maps": FILTERED,
    "images": TEXTURED,
    "texture coordinates": TEXTURED,
    "further texture coordinates": Case(
        wanted=scene(unlit(base_color=picture(uv_set="second")), meshes=[TWO_SETS]),
        unwanted=scene(unlit(base_color=picture()), meshes=[TWO_SETS]),
    ),
    "procedures": Case(
        wanted=scene(unlit(base_color=ProcedureTexture(procedure="checker"))),
        unwanted=scene(unlit(base_color=(0.5, 0.5, 0.5))),
    ),
    "slots": Case(
        wanted=scene(unlit()),
        unwanted=scene(unlit()),
        unwanted_options=replace(SMALL, buffer="object-id"),
    ),
    "projected textures": Case(
        wanted=scene(
            unlit(projected=(ProjectedTexture(texture=picture(), matrix=np.eye(4)),)),
        ),
        unwanted=scene(unlit()),
    ),
    "parallax": Case(
        wanted=scene(
            unlit(base_color=picture(), parallax=Parallax(texture=picture(1), depth=0.02))
        ),
        unwanted=scene(unlit(base_color=picture())),
    ),
    "vertex normals": Case(
        wanted=scene(lambert(), lighting=lit(SUN)), unwanted=scene(unlit(), lighting=lit(SUN))
    ),
    "normals": Case(
        wanted=scene(lambert(), lighting=lit(SUN)),
        unwanted=scene(lambert(normal_map=normals()), lighting=lit(SUN)),
    ),
    "tangents": Case(
        wanted=scene(lambert(normal_map=normals()), lighting=lit(SUN)),
        unwanted=scene(lambert(normal_map=normals("object")), lighting=lit(SUN)),
    ),
    "normal map": Case(
        wanted=scene(lambert(normal_map=normals()), lighting=lit(SUN)),
        unwanted=scene(unlit(normal_map=normals()), lighting=lit(SUN)),
    ),
    "bump map": Case(
        wanted=scene(lambert(bump_map=BumpMap(texture=picture(1))), lighting=lit(SUN)),
        unwanted=scene(lambert(), lighting=lit(SUN)),
    ),
    "emboss": Case(
        wanted=scene(
            lambert(bump_map=BumpMap(texture=picture(1), form="emboss")), lighting=lit(SUN)
        ),
        unwanted=scene(lambert(bump_map=BumpMap(texture=picture(1))), lighting=lit(SUN)),
    ),
    "unlit": Case(wanted=scene(unlit()), unwanted=scene(lambert(), lighting=lit(SUN))),
    "lambert": Case(
        wanted=scene(lambert(), lighting=lit(SUN)),
        unwanted=scene(Material(shading="blinn-phong"), lighting=lit(SUN)),
    ),
    "blinn-phong": Case(
        wanted=scene(Material(shading="blinn-phong"), lighting=lit(SUN)),
        unwanted=scene(Material(), lighting=lit(SUN)),
    ),
    "metallic-roughness": Case(
        wanted=scene(Material(), lighting=lit(SUN)),
        unwanted=scene(lambert(), lighting=lit(SUN)),
    ),
    "ambient": Case(
        wanted=scene(lambert(), lighting=Lighting(ambient=Ambient(color=(1, 1, 1)))),
        unwanted=scene(lambert(), lighting=lit(SUN)),
    ),
    "vertex light": Case(
        wanted=scene(lambert(shading_rate="vertex"), lighting=lit(SUN)),
        unwanted=scene(lambert(), lighting=lit(SUN)),
    ),
    "light map": Case(wanted=scene(lambert(light_map=0.5)), unwanted=scene(unlit(light_map=0.5))),
    "emission": Case(wanted=scene(lambert(emission=(1, 1, 1))), unwanted=scene(lambert())),
    "refraction": Case(
        wanted=scene(unlit(refraction=Refraction())),
        unwanted=scene(unlit(reflection=Reflection())),
    ),
    "reflection": Case(
        wanted=scene(unlit(reflection=Reflection())),
        unwanted=scene(unlit(refraction=Refraction())),
    ),
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


def hook_of(effect, hook):
    """The function of a hook, or None."""
    value = getattr(effect, hook)
    return value.compute if isinstance(value, Result) else value


def counted(effects, monkeypatch):
    """The same effects, with a list of the (effect, hook) that were entered."""
    entered: list[tuple[str, str]] = []

    def watched(effect, hook):
        function = hook_of(effect, hook)

        def enter(*arguments):
            entered.append((effect.name, hook))
            return function(*arguments)

        return None if function is None else enter

    copies = []
    for effect in effects:
        hooks = {hook: watched(effect, hook) for hook in HOOKS}
        for hook in "load", "prepare":
            result, enter = getattr(effect, hook), hooks.pop(hook)
            if result is not None:  # stays the key that it is, so it is watched where it stands
                monkeypatch.setitem(vars(result), "compute", enter)
        copies.append(replace(effect, **hooks))
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


def functions_of(module: str) -> set[types.CodeType]:
    """Code of every function of a module, also of those within functions and classes."""
    found: set[types.CodeType] = set()

    def gather(code):
        for inner in code.co_consts:
            if isinstance(inner, types.CodeType):
                found.add(inner)
                gather(inner)

    source = inspect.getsource(sys.modules[module])
    gather(compile(source, sys.modules[module].__file__, "exec", dont_inherit=True))
    return found


def module_of(effect: Effect) -> str:
    """Name of the one module that an effect stands in."""
    (name,) = (
        name
        for name, module in sys.modules.items()
        if name.startswith("texbake.rendering.effects.")
        and any(thing is effect for thing in vars(module).values())
    )
    return name


def reached(functions: Collection[Callable]) -> set[types.CodeType]:
    """Code that functions may run within the modules of effects, by the names that they read."""
    found: set[types.CodeType] = set()
    waiting = [function for function in functions if isinstance(function, types.FunctionType)]

    def inner(code: types.CodeType) -> Iterator[types.CodeType]:
        yield code
        for constant in code.co_consts:
            if isinstance(constant, types.CodeType):
                yield from inner(constant)

    while waiting:
        function = waiting.pop()
        if function.__code__ in found or not function.__module__.startswith("texbake.rendering."):
            continue
        parts = list(inner(function.__code__))
        found.update(parts)
        named = [function.__globals__.get(name) for part in parts for name in part.co_names]
        named += [cell.cell_contents for cell in function.__closure__ or ()]
        for thing in named:
            thing = getattr(thing, "py_func", thing)  # of a kernel, whose calls are seen too
            if isinstance(thing, type) and thing.__module__.startswith("texbake.rendering."):
                members = [getattr(item, "fget", item) for item in vars(thing).values()]
                waiting += [item for item in members if isinstance(item, types.FunctionType)]
            elif isinstance(thing, types.FunctionType):
                waiting.append(thing)
    return found


def executed(work: Callable[[], object]) -> set[tuple[str, str, int]]:
    """(file, name, line) of every Python function that some thread runs during the work."""
    seen = set()

    def note(frame, event, argument):
        if event == "call":
            seen.add(place(frame.f_code))

    old = sys.getprofile()
    threading.setprofile(note)
    sys.setprofile(note)
    try:
        work()
    finally:
        sys.setprofile(old)
        threading.setprofile(None)
    return seen


def place(code: types.CodeType) -> tuple[str, str, int]:
    return code.co_filename, code.co_qualname, code.co_firstlineno


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda effect: effect.name)
def test_what_nothing_calls_for_runs_no_line_of_its_module(effect):
    case = CASES[effect.name]
    if case.unwanted is None:
        return  # the test above holds that it says why
    options = case.unwanted_options
    frame = drawn(case.unwanted, options)  # kernels are compiled now
    request = RenderRequest(case.unwanted, options, camera_for(options))
    asking = executed(lambda: [list(one.activated_by(request)) for one in EFFECTS])
    ran = executed(lambda: drawn(case.unwanted, options))
    own = {place(code) for code in functions_of(module_of(effect))}
    # Other effects of the picture may stand in the same module, or use its functions.
    others = [
        function
        for item in frame.plan.passes
        for hook in HOOKS
        if (function := hook_of(item.effect, hook)) is not None
    ]
    needs = [need for item in frame.plan.passes for need in item.effect.needs]
    others += [getattr(need, "func", need) for need in needs if callable(need)]
    assert len(ran & {place(code) for code in reached(others)}) > 0  # other threads are watched
    assert ran & own <= asking | {place(code) for code in reached(others)}


def watching(scene_effects=EFFECTS):
    """All effects, plus one at the end that records the shaded fragments."""
    kept = []
    probe = Effect(
        name="probe",
        does="looks",
        activations=lambda request: [Activation(i, "the test", "it looks") for i in request.shaded],
        left_out="nothing is shaded",
        shade=lambda fragments, picture: kept.append(fragments),
    )
    return (*scene_effects, probe), kept


@pytest.mark.parametrize("filter_name", ["nearest", "bilinear", "bicubic"])
def test_a_lookup_without_footprint_has_no_mip_levels_and_no_derivatives(filter_name, monkeypatch):
    def fail(*arguments, **named):
        raise AssertionError("a mip chain was made")

    monkeypatch.setattr(images, "mip_chain", fail)
    textured = scene(unlit(base_color=picture(filter=filter_name)))
    effects, kept = watching()
    frame = drawn(textured, SMALL, effects)
    assert not frame.plan.has("mip maps") and not frame.plan.has("derivatives")
    assert len(kept) > 0
    assert all(len(item.changes) == 0 and len(item.uv_changes) == 0 for item in kept)
    # The options' filter goes before the texture's own, both ways.
    trilinear = scene(unlit(base_color=picture(filter="trilinear")))
    assert not drawn(trilinear, replace(SMALL, filter=filter_name)).plan.has("mip maps")
    with pytest.raises(AssertionError, match="a mip chain was made"):
        drawn(textured, replace(SMALL, filter="ewa"))


@pytest.mark.parametrize(
    ("texture", "wanted"),
    [
        (ProcedureTexture(procedure="checker"), True),
        (ProcedureTexture(procedure="checker", filtered=False), False),
        (picture(filter="trilinear"), True),
        (picture(filter="nearest"), False),
        ((0.1, 0.2, 0.3), False),
    ],
)
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


@pytest.mark.parametrize(
    "changed",
    [
        lambda s: with_item(s, 0, receives_shadows=False),
        lambda s: with_item(with_item(s, 0, casts_shadows=False), 1, casts_shadows=False),
        lambda s: with_item(s, 0, material=unlit()),
        lambda s: with_item(s, 0, transform=far_away()),
        lambda s: with_item(s, 1, transform=far_away()),
        lambda s: with_item(s, 0, visible=False),
        lambda s: replace(s, lighting=lit(replace(SUN, intensity=0.0, shadow=Shadow()))),
        lambda s: replace(s, lighting=lit(SUN)),
    ],
    ids=[
        "nothing receives", "nothing casts", "receiver unlit", "receiver out of the picture",
        "caster beside", "receiver invisible", "dark light", "light casts none",
    ],
)  # fmt: skip
def test_no_shadow_map_is_made_whose_shadows_fall_on_nothing_seen(changed):
    # The plane in front casts on the one behind and, flat as it is, never on itself.
    shadowed = scene(lambert(), lambert(), lighting=lit(replace(SUN, shadow=Shadow(size=32))))
    shadowed = with_item(shadowed, 1, receives_shadows=False)
    frame, entered = entered_by(shadowed)
    assert ("shadow maps", "prepare") in entered and ("shadow maps", "dim") in entered
    frame, entered = entered_by(changed(shadowed))
    assert not entered & {("shadow maps", "prepare"), ("shadow maps", "dim")}
    assert not frame.plan.has("shadow maps") or frame.costs.by_name["shadow maps"].skipped
    assert frame.plan.has("shadow maps") or reasons(frame.plan, "shadow maps")


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


@pytest.mark.parametrize("mesh", [plane(), cube(), uv_sphere(8, 16)])
def test_one_fragment_is_shaded_a_pixel_where_there_is_no_edge(mesh):
    options = RenderOptions(width=48, height=40, supersampling=4, view=(30.0, 20.0))
    effects, kept = watching()
    the_scene = Scene(objects=(SceneObject(mesh=mesh, material=unlit()),))
    camera = Camera.framing(mesh, options=options)
    frame = draw(prepare(the_scene, options, effects=effects), camera)
    samples = frame._visibility.face_ids.reshape(40, 4, 48, 4).swapaxes(1, 2).reshape(-1, 16)
    triangles = [set(ids[ids >= 0]) for ids in samples]
    pixels = np.concatenate([item.pixels for item in kept])
    shaded = np.bincount(pixels, minlength=48 * 40)
    np.testing.assert_array_equal(shaded, [len(ids) for ids in triangles])
    assert (shaded == 1).sum() > 200
    # Each for the share of the pixel that it is seen in.
    assert sum(item.counts.sum() for item in kept) == (samples >= 0).sum()
    kept.clear()
    draw(prepare(the_scene, replace(options, edges="supersample"), effects=effects), camera)
    assert sum(len(item) for item in kept) == (samples >= 0).sum()


def test_what_is_unlit_or_out_of_the_picture_calls_for_hardly_anything():
    plan = plan_of(prepare(scene(unlit())), camera_for(SMALL))
    assert [item.name for item in plan.passes] == ["placing", "slots", "unlit"]
    away = with_item(scene(Material(), lighting=lit(SUN)), 0, transform=far_away())
    plan = plan_of(prepare(away), camera_for(SMALL))
    assert [item.name for item in plan.passes] == ["placing"]


def test_each_call_names_who_asks_and_each_need_for_what():
    the_scene = scene(lambert(normal_map=normals()), unlit(), lighting=lit(SUN))
    plan = plan_of(prepare(the_scene, SMALL), camera_for(SMALL))
    calls = {item.name: item.activations for item in plan.passes}
    assert calls["normal map"] == (
        Activation(0, 'object "item 0"', "its material has a normal map"),
        Activation(0, 'object "item 0"', "for lambert"),
    )
    assert calls["tangents"] == (Activation(0, 'object "item 0"', "for normal map"),)
    assert calls["unlit"] == (Activation(1, 'object "item 1"', "its shading is unlit"),)
    assert [effect.name for effect in plan.for_target(1)] == ["placing", "slots", "unlit"]
    assert plan.has("unlit", 1) and not plan.has("unlit", 0) and plan.has("unlit")


def fake(name, *, calls=(), needs=(), of="object"):
    return Effect(
        name=name,
        does=name,
        of=of,
        activations=lambda request: list(calls),
        left_out=f"no {name}",
        needs=needs,
    )


def test_needs_are_followed_through_and_lists_out_of_order_are_defects():
    request = RenderRequest(scene(unlit(), unlit()), SMALL, camera_for(SMALL))
    asks = [
        Activation(1, "b", "wants it"),
        Activation(0, "a", "wants it"),
        Rejection("is too late", "c"),
    ]
    effects = [
        fake("sky", of="picture"),
        fake("ground", needs=("sky",)),
        fake("idle", needs=("ground",)),
        fake("tree", calls=asks, needs=("ground",)),
    ]
    plan = compile_plan(request, effects)
    assert [(item.name, item.targets) for item in plan.passes] == [
        ("sky", (None,)), ("ground", (0, 1)), ("tree", (0, 1)),
    ]  # fmt: skip
    assert [(item.name, item.requested_by, item.why) for item in plan.left_out] == [
        ("idle", "", "no idle"), ("tree", "c", "is too late"),
    ]  # fmt: skip
    with pytest.raises(AssertionError, match="tree comes before ground"):
        compile_plan(request, effects[::-1])


def test_names_of_effects_are_their_own_and_their_sentences_short():
    assert len({effect.name for effect in EFFECTS}) == len(EFFECTS)
    assert set(CASES) >= {effect.name for effect in EFFECTS}
    for effect in EFFECTS:
        assert effect.of in ("object", "light", "picture")
        for sentence in effect.does, effect.left_out:
            assert 0 < len(sentence) < 80 and not sentence.endswith(".")


def test_a_list_without_an_effect_draws_the_same_where_nothing_calls_for_it():
    the_scene = scene(Material(), lambert(), lighting=lit(SUN, ambient=Ambient(color=(1, 1, 1))))
    full = drawn(the_scene)
    used = {item.name for item in full.plan.passes}
    fewer = tuple(effect for effect in EFFECTS if effect.name in used)
    assert len(fewer) < len(EFFECTS) / 2
    assert drawn(the_scene, SMALL, fewer).color.tobytes() == full.color.tobytes()
