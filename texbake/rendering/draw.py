"""Drawing a scene: runs the passes of its plan in order.

    Scene ─ compile ─► Plan ─ surfaces ─► DrawnScene ─ rasterize ─► VisibleScene ─ fragments ─►
    ─► shade ─► sums of pixels ─► Frame

`prepare` keeps results that do not depend on the camera, so that `draw` can be called for many
cameras.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import field, is_dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from texbake.parallel import run_bands
from texbake.progress import Progress, Stages
from texbake.records import dataclass
from texbake.rendering.camera import Camera
from texbake.rendering.effect import DrawnScene, Effect, Pass, Plan, RenderState
from texbake.rendering.effects import EFFECTS
from texbake.rendering.effects.environment import OF_ENVIRONMENT
from texbake.rendering.effects.images import IMAGES
from texbake.rendering.effects.surfaces import displace_object, place_object
from texbake.rendering.effects.transparency import peel_layers
from texbake.rendering.options import RenderOptions
from texbake.rendering.passes import find_visible, shade_fragments
from texbake.rendering.plan import compile_plan
from texbake.rendering.rasterize import World, join_objects
from texbake.rendering.request import RenderRequest
from texbake.rendering.resolve import Frame, Sums
from texbake.rendering.results import Compute, Costs, Deferred, Results, Target
from texbake.rendering.scene.lights import Lighting
from texbake.rendering.scene.scene import Scene
from texbake.rendering.scene_simplification import SkippedEffect, simplify_scene
from texbake.rendering.texture_order import base_colors_alone, in_texture_order
from texbake.texture.encoding import decode_srgb
from texbake.texture.image import FloatImage

# Pixels shaded together by one thread: few enough for their values to stay in cache, but enough to
# amortize the kernel calls.
_PIXELS = 1 << 15


@dataclass(eq=False)
class SceneCache:
    """Results for a scene that do not depend on the camera, added as pictures need them."""

    results: Results = field(default_factory=Results)
    world: World | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Prepared:
    """A scene without its `removed` parts, and the cache of what does not depend on the camera."""

    scene: Scene
    options: RenderOptions
    effects: Sequence[Effect] = EFFECTS
    threads: int | None = None
    loaded: SceneCache = field(default_factory=SceneCache)
    removed: tuple[SkippedEffect, ...] = ()
    keeps_materials: bool = False

    def request(self, camera: Camera, keep: Collection[str]) -> RenderRequest:
        """Return the request for a picture from a camera."""
        return RenderRequest(
            self.scene,
            self.options,
            camera,
            frozenset(keep),
            removed=self.removed,
            keeps_materials=self.keeps_materials,
        )


def prepare(
    scene: Scene,
    options: RenderOptions | None = None,
    *,
    effects: Sequence[Effect] = EFFECTS,
    threads: int | None = None,
) -> Prepared:
    """Prepare a scene to be drawn from any camera; results are computed when first needed."""
    options = options or scene.options()
    if options.mapping_order != "screen":
        scene, options = base_colors_alone(scene), replace(options, supersampling=1)
    keeps_materials = options.buffer is not None or effects is not EFFECTS
    active, options, removed = simplify_scene(
        scene, options, effects, keeps_materials=keeps_materials
    )
    return Prepared(
        scene=active, options=options, effects=effects, threads=threads, removed=removed,
        keeps_materials=keeps_materials,
    )  # fmt: skip


def share_environment(drawn: Prepared, other: Prepared) -> None:
    """Let a scene use what another with the same environment has computed of it."""
    other.loaded.results.add_missing(drawn.loaded.results.copy(only=OF_ENVIRONMENT))


def share_images(drawn: Prepared, other: Prepared) -> None:
    """Let a scene use the images of another whose objects have the same ones."""
    other.loaded.results.add_missing(drawn.loaded.results.copy(only=(IMAGES.load,)))


def relight(prepared: Prepared, scene: Scene) -> Prepared:
    """Prepare a scene of the same objects under other lights, with what is known of the objects."""
    other = prepare(scene, prepared.options, effects=prepared.effects, threads=prepared.threads)
    of_objects = [
        effect.load
        for effect in prepared.effects
        if effect.load and effect.of == "object" and not effect.of_the_others
    ]
    other.loaded.results = prepared.loaded.results.copy(only=of_objects)
    return other


def without_light(prepared: Prepared) -> Prepared:
    """Return a scene without light, for pictures of which only normals and depths count."""
    return replace(prepared, scene=replace(prepared.scene, lighting=Lighting()))


def plan_of(prepared: Prepared, camera: Camera) -> Plan:
    """Return the passes that a picture from this camera needs, without running them."""
    return compile_plan(prepared.request(camera, ()), prepared.effects)


def draw(
    prepared: Prepared, camera: Camera, *, keep: Collection[str] = (), progress: Progress = None
) -> Frame:
    """Draw a scene from one camera with a fixed number of samples per pixel."""
    frame, state = _draw(prepared, prepared.request(camera, keep), Stages(progress))
    return frame if state.options.mapping_order == "screen" else in_texture_order(frame, state)


def _draw(prepared: Prepared, request: RenderRequest, stages: Stages) -> tuple[Frame, RenderState]:
    state = lay_out(prepared, request, stages)
    with stages.stage("shade"):
        sums = shade_to_sums(state)
        color, coverage, normals = sums.finish(find_background(state), threads=state.threads)
    frame = Frame(
        color=color,
        coverage=coverage,
        plan=state.plan,
        costs=state.costs,
        _visibility=state.visible.visibility,
        _near=request.camera.near,
        _normals=normals,
    )
    return frame, state


def lay_out(
    prepared: Prepared, request: RenderRequest, stages: Stages, *, all_objects: bool = False
) -> RenderState:
    """Run all passes before shading: visibility and the prepared results of effects."""
    state = RenderState(
        request=request,
        plan=compile_plan(request, prepared.effects),
        results=prepared.loaded.results.copy(),
        costs=Costs(),
        threads=prepared.threads,
        draw_others=partial(_draw_others, prepared, request.depth + 1),
    )
    with stages.stage("place"):
        _run(state, prepared, [p for p in state.plan.passes if p.effect.moves_surface], None)
        state = replace(state, drawn_scene=_gather_objects(state, prepared))
    with stages.stage("rasterize"):
        visible = find_visible(state)
        if all_objects:
            visible = replace(visible, objects=frozenset(request.in_view))
        state = replace(state, visible_scene=visible)
    with stages.stage("prepare light and textures"):
        later = [p for p in state.plan.passes if not p.effect.moves_surface]
        finding = [p for p in later if p.effect.finds_objects is not None]
        _run(state, prepared, finding, None)
        for item in finding:
            assert item.effect.finds_objects is not None
            more = visible.objects.union(item.effect.finds_objects(state))
            state = replace(state, visible_scene=replace(visible, objects=more))
        others = [p for p in later if p.effect.finds_objects is None]
        _run(state, prepared, others, state.visible.objects)
    return state


def _run(
    state: RenderState, prepared: Prepared, passes: Sequence[Pass], seen: Collection[int] | None
) -> None:
    """Run `load` and `prepare` of passes, for objects only if they are in `seen`."""
    for item in passes:
        effect = item.effect
        shown: Collection[Target] = frozenset(item.targets)
        if seen is not None:
            of_seen = (a for a in item.activations if a.source is None or a.source in seen)
            shown = seen if effect.of == "object" else {each.target for each in of_seen}
        for target in item.targets:
            why = None
            if target not in shown:
                why = "not in the picture"
            elif effect.unneeded is not None:
                why = effect.unneeded(state, target)
            if why is not None:
                state.costs.skip(effect.name, why)
                continue
            for result in filter(None, (effect.load, effect.prepare)):
                compute = partial(_computed, state, prepared, effect, result, target)
                if effect.deferred:
                    state.costs.skip(effect.name, "it reaches no pixel")
                value = Deferred(compute) if effect.deferred else compute()
                state.results.put(result, target, value)


def _computed(
    state: RenderState, prepared: Prepared, effect: Effect, result: Compute[Any], target: Target
) -> Any:
    """Compute a result of an effect for a target, or find it among those of the scene."""
    known = prepared.loaded.results
    index = target if effect.of == "object" else None
    with state.costs.timed(effect.name), state.reporting_for(index):
        if result is effect.load and target in known.all(result):
            return known.get(result, target)
        value = result(state, target)
        if result is effect.load:
            known.put(result, target, value)
        if effect.load is None or value is not state.results.all(effect.load).get(target):
            state.costs.add(effect.name, 0.0, _n_bytes(value))
        return value


def _n_bytes(value: Any) -> int:
    """Memory in bytes of arrays and of what holds them, unless it has its own `n_bytes`."""
    if isinstance(value, np.ndarray):
        return value.nbytes
    if hasattr(value, "n_bytes"):
        return int(value.n_bytes)
    if is_dataclass(value):
        value = vars(value)
    parts = value.values() if isinstance(value, dict) else value
    return sum(map(_n_bytes, parts)) if isinstance(value, tuple | list | dict) else 0


def _gather_objects(state: RenderState, prepared: Prepared) -> DrawnScene:
    objects = tuple(
        state.get(displace_object, index) or state.of(place_object, index)
        for index in range(len(state.scene.objects))
    )
    displaced = state.plan.has("displacement")
    world = None if displaced else prepared.loaded.world
    if world is None:
        world = join_objects([(item.positions, item.faces) for item in objects])
    if not displaced:
        prepared.loaded.world = world
    return DrawnScene(objects, world)


def shade_to_sums(state: RenderState) -> Sums:
    """Shade all fragments in bands of rows and add them to their pixels."""
    height, width = state.options.height, state.options.width
    sums = Sums.empty(
        height,
        width,
        n_samples=state.options.supersampling**2,
        keeps_normals="normals" in state.request.keep,
    )
    state.costs.add("pixels", 0.0, sums.n_bytes)
    layers, visibility = state.get(peel_layers), state.visible.visibility

    def work(start: int, stop: int) -> None:
        if layers is None:
            for fragments in shade_fragments(state, visibility, (start, stop))[1]:
                with state.costs.timed("pixels"):
                    sums.add(fragments)
        else:
            layers.compose(state, sums, (start, stop), shade_fragments)

    run_bands(work, height, band=max(1, _PIXELS // width), threads=state.threads)
    return sums


def find_background(state: RenderState) -> FloatImage | None:
    """Return the background: the picture of an effect, a color, or None."""
    for item in state.plan.passes:
        if item.effect.behind is not None:
            return item.effect.behind(state)
    if state.options.background is None:
        return None
    return decode_srgb(state.options.background).astype(np.float32)


def _draw_others(
    prepared: Prepared, depth: int, scene: Scene, cameras: Sequence[Camera], options: RenderOptions
) -> list[FloatImage]:
    """Draw other pictures of the same objects, as for an environment."""
    other = replace(prepared, scene=scene, options=options, loaded=SceneCache())
    # These pictures reuse the results for objects and lights.
    _share(prepared, other)
    requests = [RenderRequest(scene, options, camera, depth=depth) for camera in cameras]
    colors = [_draw(other, request, Stages())[0].color for request in requests]
    _share(other, prepared)
    return colors


def _share(source: Prepared, destination: Prepared) -> None:
    """Share cached results, except what one object shows of the others."""
    own = [effect.load for effect in source.effects if effect.of_the_others and effect.load]
    destination.loaded.results.add_missing(source.loaded.results.copy(without=own))
    if destination.loaded.world is None:
        destination.loaded.world = source.loaded.world
