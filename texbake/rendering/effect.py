"""The interface of effects, and the state of a picture that they work on.

An effect is one feature of light or surfaces: a normal map, fog, the shadows of a light. Each is
declared as an `Effect` at the end of a module of `texbake.rendering.effects` and listed in
`EFFECTS` there. Its `called_for` inspects the scene; if nothing calls for the effect, no other part
of it runs. The calls become passes of the `Plan`, and `texbake.rendering.draw` runs their
functions:

`load`      once per scene, for results independent of the camera, such as tangents or mip levels
`prepare`   once per picture, for results that depend on the camera, such as an occlusion picture
`shade`     for the fragments of one object in some rows of the picture, in the order of the list
`dim`       for the light of one lamp that arrives at some fragments, before they reflect it
`tint`      for the same light, once all effects have dimmed it

`load` and `prepare` are each a `Result`: a function that also serves as a typed key for its values
in the `RenderState`. They run for each target of the effect: the index of an object, the index of a
light, or None for the whole picture.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.errors import FileFormatError, MeshError, OptionError
from texbake.rendering.camera import Camera
from texbake.rendering.costs import Costs
from texbake.rendering.fragments import DrawnObject, Fragments, Incident
from texbake.rendering.options import RenderOptions
from texbake.rendering.raster.world import VisibilityBuffer, World
from texbake.rendering.request import RenderRequest
from texbake.rendering.results import Deferred, Result, Results, Target, Value
from texbake.rendering.scene.lights import Light
from texbake.rendering.scene.scene import Scene
from texbake.texture.image import FloatImage


@dataclass(frozen=True)
class Call:
    """One reason why an effect is needed."""

    target: Target  # index of the object or light; None for the whole picture
    by: str  # the part that needs it: `object "vase"`, `light "key"`, `the scene`
    why: str  # short: `its material has a normal map`
    # Index of the object for which an effect of the picture is needed; None if it is needed
    # whatever is seen
    asker: int | None = None


@dataclass(frozen=True)
class Refusal:
    """A reason why a requested effect would have no result and is left out."""

    by: str
    why: str


@dataclass(frozen=True, kw_only=True)
class Effect:
    """One feature of light or surfaces."""

    name: str  # name in the plan, in `--explain` and in `needs`
    does: str  # description in one line
    of: str = "object"  # kind of its targets: `object`, `light` or `picture`
    # Function of the request that yields calls and refusals
    called_for: Callable[[RenderRequest], Iterable[Call | Refusal]]
    left_out: str  # reason shown when nothing calls for the effect: `no material has a normal map`
    # Function of (request, target) that returns the names of effects that must run before, for the
    # same target (or with the target None, for effects of the picture)
    needs: Callable[[RenderRequest, Target], Iterable[str]] | None = None
    # load, prepare: see the module docstring
    load: Result[Any] | None = None
    prepare: Result[Any] | None = None
    # shade, dim, tint: see the module docstring
    shade: Callable[[Fragments, RenderState], None] | None = None
    dim: Callable[[Fragments, RenderState, int, Incident], None] | None = None
    tint: Callable[[Fragments, RenderState, int, Incident], None] | None = None
    # Function of (state, target), called when visibility is known. Returns a reason why the effect
    # turns out not to be needed, or None.
    unneeded: Callable[[RenderState, Target], str | None] | None = None
    # Function of the state that returns the background as (3,) or (H, W, 3) linear light. The first
    # such effect in the list wins.
    behind: Callable[[RenderState], FloatImage] | None = None
    # Function of the state, called once `prepare` has run, that returns objects which are visible
    # beside those that rasterizing found. Such effects run before all others of their kind.
    finds_objects: Callable[[RenderState], Collection[int]] | None = None
    # Where `shade` runs for a material that is shaded per vertex: `vertex` for the corners of
    # triangles alone, `pixel` for pixels alone, None for both
    rate: str | None = None
    # Whether it must run before rasterization, because visibility depends on it
    moves_surface: bool = False
    # Whether the result of `load` for an object depends on the other objects, so that it cannot be
    # reused in a picture with fewer objects
    of_the_others: bool = False


def only_when_needed(request: RenderRequest) -> Iterator[Call]:
    """`called_for` of an effect that is in a plan only if another effect needs it."""
    return iter(())


@dataclass(frozen=True)
class Pass:
    """An effect with the calls for it; there is at least one call for each target."""

    effect: Effect
    calls: tuple[Call, ...]

    @property
    def name(self) -> str:
        """Name of the effect."""
        return self.effect.name

    @cached_property
    def targets(self) -> tuple[Target, ...]:
        """Distinct targets of the calls, in the order of the scene."""
        return tuple(sorted(self._targets, key=lambda t: -1 if t is None else t))

    @cached_property
    def _targets(self) -> frozenset[Target]:
        return frozenset(call.target for call in self.calls)

    def is_for(self, target: Target) -> bool:
        """Whether a target calls for the effect."""
        return target in self._targets


@dataclass(frozen=True)
class LeftOut:
    """An effect, or one target of it, that is not in the plan."""

    name: str
    by: str
    why: str


@dataclass(frozen=True)
class Plan:
    """The passes that a picture needs, in order, and the effects that are left out."""

    passes: tuple[Pass, ...]
    left_out: tuple[LeftOut, ...]

    def has(self, name: str, target: Target = None) -> bool:
        """Whether an effect is called for by a target, or by any target if it is None."""
        return any(
            item.name == name and (target is None or item.is_for(target)) for item in self.passes
        )

    def for_target(self, target: Target) -> tuple[Effect, ...]:
        """Effects called for by an object, in order."""
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
    # (O,): which faces of each object are drawn; see `texbake.rendering.raster.world`
    modes: npt.NDArray[np.uint8]
    objects: frozenset[int]  # objects that are visible in some sample, and transparent objects
    # (h, w, 2): barycentric weights at each sample, if the scanline rasterizer was used
    scanline_weights: npt.NDArray[np.float64] | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class RenderState:
    """Everything that a pass may read. A stage adds to it by returning a new one."""

    request: RenderRequest  # the scene, the options, the camera
    plan: Plan  # which effects are called for
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

    def of(self, result: Result[Value], target: Target = None) -> Value:
        """Return the value that an effect computed for a target."""
        value: Value | Deferred[Value] = self.results.all(result)[target]
        return value.get() if isinstance(value, Deferred) else value

    def get(self, result: Result[Value], target: Target = None) -> Value | None:
        """Return the value of an effect for a target; None if the plan has no such pass."""
        return self.results.get(result, target)

    def including(
        self, result: Result[Value], target: Target, value: Value | Deferred[Value]
    ) -> RenderState:
        """Return a copy of the state with one more result."""
        return replace(self, results=self.results.including(result, target, value))

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
