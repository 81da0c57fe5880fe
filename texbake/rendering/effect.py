"""What an effect is, and the state of a picture that the effects work on.

An effect is one thing that light or a surface can do: a normal map, fog, the shadows of a light. It
is declared as one `Effect`, at the end of a module of `texbake.rendering.effects`, and takes its
place in the list `EFFECTS` there. `called_for` reads the scene, and is all that ever runs of an
effect that nothing calls for. The calls become passes of the `Plan`; `texbake.rendering.draw` runs
their functions:

`load`      once for a scene: what does not depend on the camera, such as tangents or mip levels
`prepare`   once for a picture: what does, such as a shadow map
`shade`     for the fragments of one object in some rows of the picture, in the order of the list
`dim`       for the light of one lamp at some fragments, before they reflect it

`load` and `prepare` are each a `Result`: a function, and the key that finds its values again in the
`RenderState`, with their type. They run for every target of the effect: the index of an object, the
index of a light, or None for the picture as a whole.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Generic, TypeVar

import numpy as np
import numpy.typing as npt

from texbake.rendering.camera import Camera
from texbake.rendering.costs import Costs
from texbake.rendering.fragments import DrawnObject, Fragments, Incident
from texbake.rendering.options import RenderOptions
from texbake.rendering.raster.world import VisibilityBuffer, World
from texbake.rendering.request import RenderRequest
from texbake.rendering.scene.lights import Light
from texbake.rendering.scene.scene import Scene
from texbake.texture.image import FloatImage

Target = int | None
Value = TypeVar("Value")


@dataclass(frozen=True)
class Call:
    """One reason why an effect is needed.

    Attributes
    ----------
    target : int, optional
        Index of the object or light that it is for; None: the whole picture.
    by : str
        What needs it: `object "vase"`, `light "key"`, `the scene`.
    why : str
        In a few words: `its material has a normal map`.
    """

    target: Target
    by: str
    why: str


@dataclass(frozen=True)
class Refusal:
    """A reason for an effect that would have no result here, and why not."""

    by: str
    why: str


@dataclass(frozen=True, eq=False)
class Result(Generic[Value]):
    """What an effect computes before anything is shaded, and the key that finds it again.

    Attributes
    ----------
    compute : callable
        (state, target) to the value.
    """

    compute: Callable[[RenderState, Target], Value]


@dataclass(frozen=True, eq=False)
class Results:
    """Values that effects have computed, found by their `Result` and target; never changed."""

    _values: Mapping[Result[Any], Mapping[Target, Any]] = field(default_factory=dict)

    def has(self, result: Result[Any], target: Target) -> bool:
        """Whether a value has been computed, None included."""
        return target in self._values.get(result, ())

    def get(self, result: Result[Value], target: Target = None) -> Value | None:
        """Return a value, or None where it has not been computed."""
        value: Value | None = self._values.get(result, {}).get(target)
        return value

    def all(self, result: Result[Value]) -> Mapping[Target, Value]:
        """Return the values of all targets."""
        return self._values.get(result, {})

    def including(self, result: Result[Value], target: Target, value: Value) -> Results:
        """Return these results and one more."""
        values = {**self._values.get(result, {}), target: value}
        return Results({**self._values, result: values})

    def without(self, left_out: Iterable[Result[Any]]) -> Results:
        """Return these results but for some of all targets."""
        dropped = set(left_out)
        return Results({key: values for key, values in self._values.items() if key not in dropped})

    def or_those_of(self, others: Results) -> Results:
        """Return these results, and of others those that are not among them."""
        values = dict(self._values)
        for key, targets in others._values.items():
            values[key] = {**targets, **values.get(key, {})}
        return Results(values)


@dataclass(frozen=True, kw_only=True)
class Effect:
    """One thing that light or a surface can do.

    Attributes
    ----------
    name : str
        As the plan, `--explain` and `needs` call it.
    does : str
        What it does, in one line.
    of : str
        What its targets are: `object`, `light` or `picture`.
    called_for : callable
        Request to the calls for it, and refusals.
    left_out : str
        Why it is not in a plan that nothing called it for: `no material has a normal map`.
    needs : callable, optional
        (request, target) to the names of effects that must come before it, for the same target
        (for effects of the picture with the target None).
    load, prepare : Result, optional
        See the module.
    shade, dim : callable, optional
        See the module.
    behind : callable, optional
        State to (3,) or (H, W, 3) linear light that shows where there is no surface; of several
        the first of the list counts.
    of_the_others : bool
        Whether what `load` finds of an object depends on the other objects, so that it does not
        hold for a picture of fewer of them.
    moves_surface : bool
        Whether it is computed before it is known what is seen, because that depends on it.
    unneeded : callable, optional
        (state, target) to why it is not needed after all, now that it is known what is seen; None
        where it is.
    """

    name: str
    does: str
    of: str = "object"
    called_for: Callable[[RenderRequest], Iterable[Call | Refusal]]
    left_out: str
    needs: Callable[[RenderRequest, Target], Iterable[str]] | None = None
    load: Result[Any] | None = None
    prepare: Result[Any] | None = None
    shade: Callable[[Fragments, RenderState], None] | None = None
    dim: Callable[[Fragments, RenderState, int, Incident], None] | None = None
    unneeded: Callable[[RenderState, Target], str | None] | None = None
    behind: Callable[[RenderState], FloatImage] | None = None
    moves_surface: bool = False
    of_the_others: bool = False


def only_when_needed(request: RenderRequest) -> Iterator[Call]:
    """`called_for` of an effect that is in a plan only where another needs it."""
    return iter(())


@dataclass(frozen=True)
class Pass:
    """An effect with what called for it; `calls` has at least one for each of its targets."""

    effect: Effect
    calls: tuple[Call, ...]

    @property
    def name(self) -> str:
        """Name of the effect."""
        return self.effect.name

    @property
    def targets(self) -> tuple[Target, ...]:
        """What it is computed for, each once, in the order of the scene."""
        return tuple(
            sorted({call.target for call in self.calls}, key=lambda t: -1 if t is None else t)
        )


@dataclass(frozen=True)
class LeftOut:
    """An effect, or one target of it, that is not in the plan."""

    name: str
    by: str
    why: str


@dataclass(frozen=True)
class Plan:
    """What will be computed, in order, and what will not."""

    passes: tuple[Pass, ...]
    left_out: tuple[LeftOut, ...]

    def has(self, name: str, target: Target = None) -> bool:
        """Whether an effect is called for: by this target, or by any where that is None."""
        return any(
            item.name == name and (target is None or target in item.targets) for item in self.passes
        )

    def for_target(self, target: Target) -> tuple[Effect, ...]:
        """Effects called for by an object, in order."""
        return tuple(
            item.effect
            for item in self.passes
            if item.effect.of == "object" and target in item.targets
        )


@dataclass(frozen=True, eq=False)
class DrawnScene:
    """Objects in world space, displaced, and all their triangles together."""

    objects: tuple[DrawnObject, ...]
    world: World


@dataclass(frozen=True, kw_only=True, eq=False)
class VisibleScene:
    """What rasterizing found.

    Attributes
    ----------
    visibility : VisibilityBuffer
        What each sample sees of opaque objects.
    modes : (O,) uint8
        What is drawn of each object; see `texbake.rendering.raster.world`.
    objects : frozenset of int
        Objects that some sample sees, and those that light goes through.
    scanline_weights : (h, w, 2) float64, optional
        Weights of each sample's triangle, where they were found step by step.
    """

    visibility: VisibilityBuffer
    modes: npt.NDArray[np.uint8]
    objects: frozenset[int]
    scanline_weights: npt.NDArray[np.float64] | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class RenderState:
    """Everything that a pass may read. A stage adds to it by returning a new one.

    Attributes
    ----------
    request : RenderRequest
        The scene, the options, the camera.
    plan : Plan
        Which effects are called for.
    draw_others : callable
        (scene, cameras, options) to the colors, (H, W, 4), of pictures of a scene of the same
        objects: how an environment is rendered.
    results : Results
        What `load` and `prepare` of effects returned.
    drawn_scene : DrawnScene, optional
        Set once all surfaces are in place.
    visible_scene : VisibleScene, optional
        Set once the picture is rasterized.
    """

    request: RenderRequest
    plan: Plan
    costs: Costs
    threads: int | None
    draw_others: Callable[[Scene, Sequence[Camera], RenderOptions], list[FloatImage]]
    results: Results = field(default_factory=Results)
    drawn_scene: DrawnScene | None = None
    visible_scene: VisibleScene | None = None

    @property
    def scene(self) -> Scene:
        """What the picture is of."""
        return self.request.scene

    @property
    def options(self) -> RenderOptions:
        """The choices made for it."""
        return self.request.options

    @property
    def camera(self) -> Camera:
        """Where it is taken from."""
        return self.request.camera

    @property
    def lights(self) -> tuple[Light, ...]:
        """Lights of the scene."""
        return self.scene.lighting.lights

    def of(self, result: Result[Value], target: Target = None) -> Value:
        """Return what an effect computed for a target.

        Raises
        ------
        KeyError
            It was not computed: a defect of the effect's `needs`.
        """
        return self.results.all(result)[target]

    def get(self, result: Result[Value], target: Target = None) -> Value | None:
        """Return what an effect computed for a target; None where the plan has no such pass."""
        return self.results.get(result, target)

    def including(self, result: Result[Value], target: Target, value: Value) -> RenderState:
        """Return the state with one more result."""
        return replace(self, results=self.results.including(result, target, value))

    def drawn(self, index: int) -> DrawnObject:
        """Return an object as it is drawn."""
        assert self.drawn_scene is not None
        return self.drawn_scene.objects[index]

    @property
    def world(self) -> World:
        """All triangles."""
        assert self.drawn_scene is not None
        return self.drawn_scene.world

    @property
    def visible(self) -> VisibleScene:
        """What the samples see."""
        assert self.visible_scene is not None
        return self.visible_scene
