"""A scene to a picture: the passes of its plan, in their order.

    Scene ─ compile ─► Plan ─ surfaces ─► World ─ rasterize ─► Visibility ─ fragments ─► shade ─►
    ─► sums of pixels ─► Frame

`prepare` keeps what does not depend on the camera, so that `draw` can be called for many of them.
What is computed at all is said by the plan (`texbake.rendering.plan`); how, by the effects
(`texbake.rendering.effects`). Here is only the order.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from texbake.errors import FileFormatError, MeshError, OptionError
from texbake.parallel import run_bands
from texbake.progress import ProgressSink, Stages
from texbake.rendering.camera import Camera
from texbake.rendering.effects import EFFECTS
from texbake.rendering.options import RenderOptions
from texbake.rendering.picture import Costs, Picture
from texbake.rendering.plan.effect import Effect, Target
from texbake.rendering.plan.plan import Pass, Plan, compile_plan
from texbake.rendering.plan.question import Question
from texbake.rendering.raster.visibility import Visibility
from texbake.rendering.raster.world import World, joined
from texbake.rendering.resolve import Frame, Sums
from texbake.rendering.scene.scene import Scene
from texbake.rendering.seen import find_visibility
from texbake.rendering.shaded import shaded_fragments
from texbake.texture.encoding import decode_srgb
from texbake.texture.image import FloatImage

# Pixels shaded together by one thread: few enough for their values to stay in cache, enough that
# calling the kernels costs little.
_PIXELS = 1 << 15


@dataclass(frozen=True, kw_only=True, eq=False)
class Prepared:
    """A scene, and what has been computed of it that does not depend on the camera."""

    scene: Scene
    options: RenderOptions
    effects: Sequence[Effect] = EFFECTS
    threads: int | None = None
    loaded: dict[tuple[str, Target], Any] = field(default_factory=dict)


def prepare(
    scene: Scene,
    options: RenderOptions | None = None,
    *,
    effects: Sequence[Effect] = EFFECTS,
    threads: int | None = None,
) -> Prepared:
    """Make a scene ready to be drawn from any side; what it needs is computed when it first does.

    Parameters
    ----------
    scene
        What to draw.
    options
        None for the defaults.
    effects
        All that there are, in order.
    threads
        None for every processor; the bytes of a picture do not depend on it.
    """
    return Prepared(
        scene=scene, options=options or RenderOptions(), effects=effects, threads=threads
    )


def plan_of(prepared: Prepared, camera: Camera, *, keep: Collection[str] = ()) -> Plan:
    """Return the passes that a picture from this camera needs; nothing of them is computed."""
    question = Question(prepared.scene, prepared.options, camera, frozenset(keep))
    return compile_plan(question, prepared.effects)


def draw(
    prepared: Prepared,
    camera: Camera,
    *,
    keep: Collection[str] = (),
    progress: ProgressSink | None = None,
) -> Frame:
    """Draw a scene from one camera.

    Every pixel has as many samples as `RenderOptions.supersampling` says;
    `texbake.rendering.render` draws with as many as each needs, where that is asked for.

    Parameters
    ----------
    prepared
        By `prepare`.
    camera
        Where it is taken from.
    keep
        What the frame is to hold beside its color: `normals`.
    progress
        Told of the stages.

    Raises
    ------
    TexbakeError
        A texture cannot be read, or a mesh lacks what an effect needs of it.
    """
    question = Question(prepared.scene, prepared.options, camera, frozenset(keep))
    return _draw(prepared, question, Stages(progress))


def _draw(prepared: Prepared, question: Question, stages: Stages) -> Frame:
    picture, visibility = laid_out(prepared, question, stages)
    with stages.stage("shade"):
        sums = shaded_sums(picture, visibility)
        behind = behind_surfaces(picture)
        color, coverage, normals = sums.finished(behind, threads=picture.threads)
    return Frame(
        color=color,
        coverage=coverage,
        plan=picture.plan,
        costs=picture.costs,
        _visibility=visibility,
        _near=question.camera.near,
        _normals=normals,
    )


def laid_out(
    prepared: Prepared, question: Question, stages: Stages, *, all_objects: bool = False
) -> tuple[Picture, Visibility]:
    """Compute all that comes before shading: what its samples see, and what effects need.

    Parameters
    ----------
    all_objects
        Whether effects are made ready for every object that may be in the picture, and not for
        those alone that its samples see.
    """
    plan = compile_plan(question, prepared.effects)
    picture = Picture(
        question=question,
        plan=plan,
        values=dict(prepared.loaded),
        costs=Costs(),
        threads=prepared.threads,
        draw_others=_draw_others(prepared, question),
    )
    with stages.stage("place"):
        _run(picture, prepared, [p for p in plan.passes if p.effect.moves_surface], None)
        picture.values["world", None] = _world(picture, prepared)
    with stages.stage("rasterize"):
        visibility = find_visibility(picture)
        if all_objects:
            picture.values["seen objects", None] = frozenset(question.seen)
    with stages.stage("prepare light and textures"):
        later = [p for p in plan.passes if not p.effect.moves_surface]
        _run(picture, prepared, later, picture.seen)
    return picture, visibility


def _run(
    picture: Picture, prepared: Prepared, passes: Sequence[Pass], seen: Collection[int] | None
) -> None:
    """Compute what passes need once a scene and once a picture; for objects only where seen."""
    for item in passes:
        effect = item.effect
        for target in item.targets:
            if effect.of == "object" and seen is not None and target not in seen:
                picture.costs.skip(effect.name, "not in the picture")
                continue
            why = effect.unneeded(picture, target) if effect.unneeded is not None else None
            if why is not None:
                picture.costs.skip(effect.name, why)
                continue
            with picture.costs.timed(effect.name), _told_of(picture, effect, target):
                _compute(effect, target, picture, prepared)


@contextmanager
def _told_of(picture: Picture, effect: Effect, target: Target) -> Iterator[None]:
    """Tell errors of what a scene's file names as errors of that file, with the object."""
    try:
        yield
    except (OptionError, MeshError) as error:
        if not picture.scene.files:
            raise
        where = picture.scene.name
        if effect.of == "object" and target is not None:
            where = f"{where}: {picture.question.name(target)}"
        raise FileFormatError(f"{where}: {error}") from error


def _compute(effect: Effect, target: Target, picture: Picture, prepared: Prepared) -> None:
    place = effect.name, target
    if effect.load is not None and place not in prepared.loaded:
        prepared.loaded[place] = effect.load(picture, target)
        picture.costs.add(effect.name, 0.0, _n_bytes(prepared.loaded[place]))
    if place in prepared.loaded:
        picture.values[place] = prepared.loaded[place]
    if effect.prepare is not None:
        known, made = picture.values.get(place), effect.prepare(picture, target)
        picture.values[place] = made
        if made is not known:
            picture.costs.add(effect.name, 0.0, _n_bytes(made))


def _n_bytes(value: Any) -> int:
    """Memory of a result: of an array, of what tells its `n_bytes`, or of the parts of a tuple."""
    if isinstance(value, np.ndarray):
        return value.nbytes
    if isinstance(value, tuple | list):
        return sum(map(_n_bytes, value))
    if isinstance(value, dict):
        return sum(map(_n_bytes, value.values()))
    return int(getattr(value, "n_bytes", 0))


def _world(picture: Picture, prepared: Prepared) -> World:
    displaced = picture.plan.has("displacement")
    known: World | None = prepared.loaded.get(("world", None))
    if known is not None and not displaced:
        return known
    drawn = [picture.drawn(index) for index in range(len(picture.scene.objects))]
    world = joined([(item.positions, item.faces) for item in drawn])
    if not displaced:
        prepared.loaded["world", None] = world
    return world


def shaded_sums(picture: Picture, visibility: Visibility) -> Sums:
    """Shade all fragments, some rows at a time, and add them to their pixels."""
    height, width = picture.options.height, picture.options.width
    sums = Sums.empty(
        height,
        width,
        n_samples=picture.options.supersampling**2,
        keeps_normals="normals" in picture.question.keep,
    )
    picture.costs.add("pixels", 0.0, sums.n_bytes)
    layers = picture.value("layers")

    def work(start: int, stop: int) -> None:
        if layers is None:
            for fragments in shaded_fragments(picture, visibility, (start, stop))[1]:
                with picture.costs.timed("pixels"):
                    sums.add(fragments)
        else:
            layers.compose(picture, sums, (start, stop), shaded_fragments)

    run_bands(work, height, band=max(1, _PIXELS // width), threads=picture.threads)
    return sums


def behind_surfaces(picture: Picture) -> FloatImage | None:
    """What shows where there is no surface: what an effect puts there, a color, or nothing."""
    for item in picture.plan.passes:
        if item.effect.behind is not None:
            return item.effect.behind(picture)
    if picture.options.background is None:
        return None
    return decode_srgb(picture.options.background).astype(np.float32)


def _draw_others(
    prepared: Prepared, question: Question
) -> Callable[[Scene, Sequence[Camera], RenderOptions], list[FloatImage]]:
    """How a picture has others drawn, of the same objects: an environment for one of them."""

    def draw_others(
        scene: Scene, cameras: Sequence[Camera], options: RenderOptions
    ) -> list[FloatImage]:
        other = replace(prepared, scene=scene, options=options, loaded={})
        # What is known of objects and light is known in these pictures too.
        _share(prepared, other)
        colors = [
            _draw(other, Question(scene, options, camera, depth=question.depth + 1), Stages()).color
            for camera in cameras
        ]
        _share(other, prepared)
        return colors

    return draw_others


def _share(source: Prepared, destination: Prepared) -> None:
    """Hand on what has been computed, but for what one object shows of the others."""
    own = {effect.name for effect in source.effects if effect.of_the_others}
    for (name, target), value in source.loaded.items():
        if name not in own:
            destination.loaded.setdefault((name, target), value)
