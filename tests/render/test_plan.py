"""What nothing calls for is never entered: every effect has a scene with it and one without."""

import inspect
import sys
import threading
import types
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import cube, plane, uv_sphere
from texbake.render.camera import Camera
from texbake.render.draw import draw, plan_of, prepare
from texbake.render.effects import EFFECTS
from texbake.render.options import RenderOptions
from texbake.render.plan.effect import Call, Effect, Refusal, only_when_needed
from texbake.render.plan.plan import compile_plan
from texbake.render.plan.question import Question
from texbake.render.scene.lights import (
    Ambient,
    AmbientOcclusion,
    Environment,
    Fog,
    Light,
    Lighting,
    Shadow,
)
from texbake.render.scene.material import (
    BumpMap,
    Displacement,
    Material,
    NormalMap,
    Parallax,
    ProjectedTexture,
    Reflection,
    Refraction,
)
from texbake.render.scene.scene import Scene, SceneObject
from texbake.render.scene.textures import ImageTexture, ProcedureTexture

SMALL = RenderOptions(width=24, height=16, supersampling=2, view=(20.0, 25.0))
SUN = Light(name="sun", direction=(-0.3, -0.6, -1.0))
LAMP = Light(name="lamp", kind="spot", position=(0.5, 0.5, 2.0), direction=(0, 0, -1), angle=90)
ROOM = Environment(color=(0.2, 0.3, 0.4), lighting=True)
HOOKS = ("needs", "load", "prepare", "shade", "dim", "unneeded")


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
    hooks_not_run: Collection[str] = field(default=())


def lit(*lights, **fields):
    return Lighting(lights=lights, **fields)


OCCLUDED = Lighting(ambient=Ambient(color=(1, 1, 1)), occlusion=AmbientOcclusion())
DARK_CORNERS = Case(
    wanted=scene(lambert(), lighting=OCCLUDED),
    unwanted=scene(lambert(), lighting=replace(OCCLUDED, ambient=Ambient())),
)
GLASS = Case(
    wanted=scene(unlit(), unlit(opacity=0.5)), unwanted=scene(unlit(), unlit(opacity=1.0))
)
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
    "displacement": Case(
        wanted=scene(unlit(displacement=Displacement(texture=picture(1), height=0.1))),
        unwanted=scene(unlit()),
    ),
    "layers": GLASS,
    "transparency": GLASS,
    "occlusion picture": DARK_CORNERS,
    "ambient occlusion": replace(
        DARK_CORNERS, why="it has no ambient light that could be held back"
    ),
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
    "background": replace(SURROUNDED, why="its environment is not to be seen"),
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
    "light map": Case(
        wanted=scene(lambert(light_map=0.5)), unwanted=scene(unlit(light_map=0.5))
    ),
    "emission": Case(wanted=scene(lambert(emission=(1, 1, 1))), unwanted=scene(lambert())),
    "refraction": Case(
        wanted=scene(unlit(refraction=Refraction())),
        unwanted=scene(unlit(reflection=Reflection())),
    ),
    "reflection": Case(
        wanted=scene(unlit(reflection=Reflection())),
        unwanted=scene(unlit(refraction=Refraction())),
    ),
    "fog": Case(
        wanted=scene(unlit(), lighting=Lighting(fog=Fog())), unwanted=scene(unlit())
    ),
    "buffer": Case(
        wanted=scene(unlit()), unwanted=scene(unlit()), options=replace(SMALL, buffer="depth")
    ),
}


def camera_for(options):
    return Camera.framing(plane(), options=options)


def counted(effects):
    """The same effects, with a list of the (effect, hook) that were entered."""
    entered: list[tuple[str, str]] = []

    def watched(effect, hook):
        function = getattr(effect, hook)

        def enter(*arguments):
            entered.append((effect.name, hook))
            return function(*arguments)

        return None if function is None else enter

    copies = tuple(
        replace(effect, **{hook: watched(effect, hook) for hook in HOOKS}) for effect in effects
    )
    return copies, entered


def drawn(the_scene, options=SMALL, effects=EFFECTS):
    return draw(prepare(the_scene, options, effects=effects, threads=2), camera_for(options))


def reasons(plan, name):
    return [item.why for item in plan.left_out if item.name == name]


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda effect: effect.name)
def test_what_is_called_for_is_entered_and_nothing_else(effect):
    case = CASES[effect.name]  # an effect without a scene is not tested
    copies, entered = counted(EFFECTS)
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
    copies, entered = counted(EFFECTS)
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
    """Module that defines an effect, by where it stands."""
    for name, module in sys.modules.items():
        if name.startswith("texbake.render.effects.") and effect in vars(module).values():
            hooks = [getattr(effect, hook) for hook in (*HOOKS, "called_for")]
            if any(hook is not None and hook.__module__ == name for hook in hooks):
                return name
    raise AssertionError(f"{effect.name} is in no module of effects")


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
        if function.__code__ in found or not function.__module__.startswith("texbake.render."):
            continue
        parts = list(inner(function.__code__))
        found.update(parts)
        named = [function.__globals__.get(name) for part in parts for name in part.co_names]
        named += [cell.cell_contents for cell in function.__closure__ or ()]
        for thing in named:
            if isinstance(thing, type) and thing.__module__.startswith("texbake.render."):
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
    question = Question(case.unwanted, options, camera_for(options))
    asking = executed(lambda: [list(one.called_for(question)) for one in EFFECTS])
    ran = executed(lambda: drawn(case.unwanted, options))
    own = {place(code) for code in functions_of(module_of(effect))}
    # Other effects of the picture may stand in the same module, or use its functions.
    others = [
        getattr(item.effect, hook)
        for item in frame.plan.passes
        for hook in HOOKS
        if getattr(item.effect, hook) is not None
    ]
    assert len(ran & {place(code) for code in reached(others)}) > 0  # other threads are watched
    assert ran & own <= asking | {place(code) for code in reached(others)}
