"""The interface of effects, and the state of a picture that they work on.

An effect is one feature of light or surfaces: a normal map, fog, the shadows of a light. It is one
`Effect`, declared at the end of a module of `texbake.rendering.effects`, where it is found; nothing
else lists it. Its declaration says what it follows in the order of shading (`after`), what
activates it, what it needs, and which functions compute it. If nothing in a scene activates it, no
other part of it runs. The activations become passes of the `Plan`, and `texbake.rendering.draw`
runs their functions:

`load`      once per scene, for results independent of the camera, such as tangents or mip levels
`prepare`   once per picture, for results that depend on the camera, such as an occlusion picture
`shade`     for the fragments of one object in some rows of the picture, in the order of the list
`dim`       for the light of one lamp that arrives at some fragments, before they reflect it
`tint`      for the same light, once all effects have dimmed it

`load` and `prepare` run for each target of the effect: the index of an object, the index of a
light, or None for the whole picture. Other effects look up what they return in the `RenderState`,
by the function itself: `state.of(mesh_normals, target)`.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import field, replace
from functools import cached_property
from typing import Any

from texbake.errors import FileFormatError, MeshError, OptionError
from texbake.mesh.mesh import ByteArray, FloatArray
from texbake.records import dataclass
from texbake.rendering.camera import Camera
from texbake.rendering.fragments import DrawnObject, Fragments, IncidentLight
from texbake.rendering.options import RenderOptions
from texbake.rendering.rasterize import VisibilityBuffer, World
from texbake.rendering.request import RenderRequest
from texbake.rendering.results import Compute, Costs, Deferred, Results, Target, Value
from texbake.rendering.scene.lights import Light
from texbake.rendering.scene.material import DEFAULT_MATERIAL
from texbake.rendering.scene.scene import Scene
from texbake.rendering.scene_simplification import SkippedEffect
from texbake.texture.image import FloatImage


@dataclass(frozen=True)
class Activation:
    """One reason why an effect is needed."""

    target: Target  # index of the object or light; None for the whole picture
    requested_by: str  # the part that needs it: `object "vase"`, `light "key"`, `the scene`
    why: str  # short: `its material has a normal map`
    # Object for which an effect of the picture is needed; None if whatever is seen needs it
    source: int | None = None


@dataclass(frozen=True)
class Rejection:
    """A reason why a requested effect would have no result and is left out."""

    why: str
    requested_by: str = ""  # by default the target that it is found for


@dataclass(frozen=True, kw_only=True)
class Effect:
    """One feature of light or surfaces.

    It is activated for `why`, by objects whose material changes `material_field`, or `when` a
    condition holds; or else by its `reasons` or `activations`; without any, only if another needs
    it.
    """

    name: str  # name in the plan, in `--explain`, in `after` and in `needs`
    does: str  # description in one line
    after: str = ""  # effect that it follows in the order of shading; "" for the first
    of: str = "object"  # kind of its targets: `object`, `light` or `picture`
    # What may activate it: a property of the request that holds objects or lights
    among: str = "shaded"
    material_field: str = ""  # activates the effect where it is not the default
    # Key of that field, or "" for itself, whose value of 0 leaves no effect; None if there is none
    strength: str | None = None
    when: Callable[[RenderRequest, int], bool] | None = None  # condition in place of the field
    why: str = ""  # reason for the activation: `its material has a light map`
    # Function of (request, target) that says why the effect would change nothing; "" if it may
    pointless: Callable[[RenderRequest, int], str] | None = None
    # In place of `why`: functions that give reasons for each target, or all activations
    reasons: Callable[[RenderRequest, int], Iterable[str | Rejection]] | None = None
    activations: Callable[[RenderRequest], Iterable[Activation | Rejection]] | None = None
    requested_by: str = ""  # part that the reasons come from; by default the target itself
    left_out: str  # reason shown when nothing activates it: `no material has a normal map`
    # Effects that must run before, for the same target, or for the picture: names, or functions of
    # (request, target) that return a name or several.
    needs: Sequence[str | Callable[[RenderRequest, Any], str | Iterable[str]]] = ()
    # Returns the scene without the effect, to measure what it contributes; by default without the
    # `material_field`.
    without: Callable[[Scene], Scene] | None = None
    # load, prepare, shade, dim, tint: see the module docstring
    load: Compute[Any] | None = None
    prepare: Compute[Any] | None = None
    # Whether they run only when a fragment first asks for their result
    deferred: bool = False
    shade: Callable[[Fragments, RenderState], None] | None = None
    dim: Callable[[Fragments, RenderState, int, IncidentLight], None] | None = None
    tint: Callable[[Fragments, RenderState, int, IncidentLight], None] | None = None
    # Function of (state, target), called when visibility is known. Returns a reason why the effect
    # turns out not to be needed, or None.
    unneeded: Callable[[RenderState, Any], str | None] | None = None
    # Function of the state that returns the background as (3,) or (H, W, 3) linear light. The first
    # such effect in the list wins.
    behind: Callable[[RenderState], FloatImage] | None = None
    # Function of the state, called once `prepare` has run, that returns objects which are visible
    # beside those that rasterizing found. Such effects run before all others of their kind.
    finds_objects: Callable[[RenderState], Collection[int]] | None = None
    # Where `shade` runs for a material that is shaded per vertex: `vertex` for the corners of
    # triangles alone, `pixel` for pixels alone, None for both
    rate: str | None = None
    # Whether mirrors and kept normals need it at pixels, too, where `rate` is `vertex`
    gives_normals: bool = False
    # Whether it must run before rasterization, because visibility depends on it
    moves_surface: bool = False
    # Whether the result of `load` for an object depends on the other objects, so that it cannot be
    # reused in a picture with fewer objects
    of_the_others: bool = False

    def activated_by(self, request: RenderRequest) -> Iterable[Activation | Rejection]:
        """Return the reasons of a request for the effect, or against it."""
        if self.activations is not None:
            yield from self.activations(request)
        elif self.reasons is not None or self.why:
            name = request.light_name if self.among == "lights" else request.name
            for target in getattr(request, self.among):
                for reason in (self.reasons or self._own_reasons)(request, target):
                    by = self.requested_by or name(target)
                    if isinstance(reason, str):
                        yield Activation(target, by, reason)
                    else:
                        yield replace(reason, requested_by=by)

    def _own_reasons(self, request: RenderRequest, index: int) -> Iterator[str | Rejection]:
        field = self.material_field
        if self.when is not None:
            holds = self.when(request, index)
        elif field:
            holds = getattr(request.material(index), field) != getattr(DEFAULT_MATERIAL, field)
        else:
            holds = True
        if holds:
            against = self.pointless(request, index) if self.pointless is not None else ""
            yield Rejection(against) if against else self.why

    def needed(self, request: RenderRequest, target: Target) -> Iterator[str]:
        """Names of the effects that must run before for a target."""
        for need in self.needs:
            names = need if isinstance(need, str) else need(request, target)
            yield from (names,) if isinstance(names, str) else names

    def scene_without(self, scene: Scene) -> Scene | None:
        """Return a scene without the effect; None if it is not known how."""
        if self.without is not None:
            return self.without(scene)
        if not self.material_field:
            return None
        bare = {self.material_field: getattr(DEFAULT_MATERIAL, self.material_field)}
        return scene.with_materials(lambda material: replace(material, **bare))


@dataclass(frozen=True)
class Pass:
    """An effect with its activations; there is at least one for each target."""

    effect: Effect
    activations: tuple[Activation, ...]

    @property
    def name(self) -> str:
        """Name of the effect."""
        return self.effect.name

    @cached_property
    def targets(self) -> tuple[Target, ...]:
        """Distinct targets of the activations, in the order of the scene."""
        return tuple(sorted(self._targets, key=lambda t: -1 if t is None else t))

    @cached_property
    def _targets(self) -> frozenset[Target]:
        return frozenset(item.target for item in self.activations)

    def is_for(self, target: Target) -> bool:
        """Whether a target activates the effect."""
        return target in self._targets


@dataclass(frozen=True)
class Plan:
    """The passes that a picture needs, in order, and the effects that are left out."""

    passes: tuple[Pass, ...]
    left_out: tuple[SkippedEffect, ...]

    def has(self, name: str, target: Target = None) -> bool:
        """Whether a target activates an effect, or any target if it is None."""
        return any(
            item.name == name and (target is None or item.is_for(target)) for item in self.passes
        )

    def for_target(self, target: Target) -> tuple[Effect, ...]:
        """Effects that an object activates, in order."""
        return tuple(
            item.effect
            for item in self.passes
            if item.effect.of == "object" and item.is_for(target)
        )


@dataclass(frozen=True, eq=False)
class DrawnScene:
    """Objects in world space, displaced, and all their triangles together."""

    objects: tuple[DrawnObject, ...]
    world: World


@dataclass(frozen=True, kw_only=True, eq=False)
class VisibleScene:
    """The result of rasterization."""

    visibility: VisibilityBuffer  # opaque triangles at the samples
    # (O,): which faces of each object are drawn; see `texbake.rendering.rasterize`
    modes: ByteArray
    objects: frozenset[int]  # objects that are visible in some sample, and transparent objects
    # (h, w, 2): barycentric weights at each sample, if the scanline rasterizer was used
    scanline_weights: FloatArray | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class RenderState:
    """Everything that a pass may read. A stage adds to it by returning a new one."""

    request: RenderRequest  # the scene, the options, the camera
    plan: Plan  # which effects are active
    costs: Costs
    threads: int | None
    # Function of (scene, cameras, options) that draws other pictures of the same objects, such as a
    # rendered environment, and returns their colors (H, W, 4)
    draw_others: Callable[[Scene, Sequence[Camera], RenderOptions], list[FloatImage]]
    # Values returned by `load` and `prepare` of effects
    results: Results = field(default_factory=Results)
    drawn_scene: DrawnScene | None = None  # set once all surfaces are in place
    visible_scene: VisibleScene | None = None  # set once the picture is rasterized

    @property
    def scene(self) -> Scene:
        """The scene of the picture."""
        return self.request.scene

    @property
    def options(self) -> RenderOptions:
        """Render options of the picture."""
        return self.request.options

    @property
    def camera(self) -> Camera:
        """Camera of the picture."""
        return self.request.camera

    @property
    def lights(self) -> tuple[Light, ...]:
        """Lights of the scene."""
        return self.scene.lighting.lights

    def of(self, result: Compute[Value], target: Target = None) -> Value:
        """Return the value that an effect computed for a target."""
        value: Value | Deferred[Value] = self.results.all(result)[target]
        return value.get() if isinstance(value, Deferred) else value

    def get(self, result: Compute[Value], target: Target = None) -> Value | None:
        """Return the value of an effect for a target; None if the plan has no such pass."""
        return self.results.get(result, target)

    @contextmanager
    def reporting_for(self, index: int | None) -> Iterator[None]:
        """Report errors in data that a scene file refers to as errors of that file and object."""
        try:
            yield
        except (OptionError, MeshError) as error:
            if not self.scene.files:
                raise
            where = self.scene.name
            if index is not None:
                where = f"{where}: {self.request.name(index)}"
            raise FileFormatError(f"{where}: {error}") from error

    def drawn(self, index: int) -> DrawnObject:
        """Return an object as it is drawn."""
        assert self.drawn_scene is not None
        return self.drawn_scene.objects[index]

    @property
    def world(self) -> World:
        """All triangles of the scene."""
        assert self.drawn_scene is not None
        return self.drawn_scene.world

    @property
    def visible(self) -> VisibleScene:
        """The result of rasterization."""
        assert self.visible_scene is not None
        return self.visible_scene
