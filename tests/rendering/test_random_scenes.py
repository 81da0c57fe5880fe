"""Where a part of a random scene changes no pixel, nothing is read or computed for it.

Each part is taken away in turn. Where the picture stays the same to the last bit, everything that
ran for the scene must also run without the part: passes for objects and lights, and files.
`TEXBAKE_RANDOM_SCENES=10000` runs as many scenes.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from random_scenes import (
    has_rendered_environments,
    random_scene,
    well_lit,
    with_light,
    with_object,
    without_each_part,
    write_images,
)

import texbake.rendering.draw as drawing
import texbake.rendering.maps as maps
from texbake.rendering.camera import Camera
from texbake.rendering.draw import draw, prepare
from texbake.rendering.effect import Effect, RenderState
from texbake.rendering.effects import EFFECTS, slots
from texbake.rendering.fragments import Fragments
from texbake.rendering.options import RenderOptions
from texbake.rendering.plan import plan_rows
from texbake.rendering.results import Target
from texbake.rendering.scene.material import Material
from texbake.rendering.scene.scene import Scene, camera_of, turntable_cameras

N_SCENES = int(os.environ.get("TEXBAKE_RANDOM_SCENES", "16"))


@dataclass
class Trace:
    """What ran for a picture."""

    effects: set[tuple[str, Any]] = field(default_factory=set)
    loads: set[tuple[str, Any]] = field(default_factory=set)
    files: set[str] = field(default_factory=set)


@contextmanager
def recording() -> Iterator[Trace]:
    """Record what runs in the block."""
    trace = Trace()
    undo: list[tuple[Any, str, Any]] = []

    def watch(owner: Any, name: str, note: Callable[..., Any]) -> None:
        work = getattr(owner, name)

        def call(*args: Any, **named: Any) -> Any:
            note(*args)
            return work(*args, **named)

        undo.append((owner, name, work))
        object.__setattr__(owner, name, call)

    watch(drawing, "_computed", partial(_note_target, trace))
    for effect in EFFECTS:
        if effect.shade is not None:
            watch(effect, "shade", partial(_note_fragments, trace, effect.name))
    watch(maps, "read_image", lambda path, *rest: trace.files.add(str(path)))
    # A volume is read once for all pictures; looking it up is what counts.
    watch(slots, "_volume_values", lambda texture, *rest: trace.files.add(str(texture.volume)))
    try:
        yield trace
    finally:
        for owner, name, work in reversed(undo):
            object.__setattr__(owner, name, work)


def _note_target(
    trace: Trace, state: RenderState, _: Any, effect: Effect, result: Any, target: Target
) -> None:
    trace.effects.add((effect.name, target))
    if result is effect.load:
        trace.loads.add((effect.name, target))


def _note_fragments(trace: Trace, name: str, fragments: Fragments, state: RenderState) -> None:
    trace.effects.add((name, fragments.target))


def drawn(scene: Scene, options: RenderOptions, camera: Camera) -> tuple[bytes, Trace]:
    """Return the pixels of a picture and what ran for it."""
    with recording() as trace:
        frame = draw(prepare(scene, options, threads=1), camera)
    return frame.color.tobytes() + frame.coverage.tobytes(), trace


def counterexamples(seed: int, folder: Path) -> list[str]:
    """List what ran for the scene of a seed without need."""
    scene, options = random_scene(seed, folder)
    camera = camera_of(scene, options)
    pixels, ran = drawn(scene, options, camera)
    found = [
        *_for_parts(scene, options, camera, pixels, ran),
        *_for_hidden_objects(scene, options, camera, pixels, ran),
        *_for_lamps(scene, options, camera, pixels, ran),
    ]
    return [f"{seed} {line}" for line in found]


def _for_parts(
    scene: Scene, options: RenderOptions, camera: Camera, pixels: bytes, ran: Trace
) -> Iterator[str]:
    """What ran for parts whose own values say that they change nothing."""
    hidden = {
        f"objects[{i}]" for i in range(len(scene.objects))
        if drawn(in_white(scene, i), options, camera)[0] == pixels
    }  # fmt: skip
    displacements = {f"displacement {i}" for i in range(len(scene.objects))}.union(
        *(_files_of(scene, i, "displacement") for i in range(len(scene.objects)))
    )
    for part, other in without_each_part(scene):
        if part.startswith("environment") and has_rendered_environments(scene):
            continue  # only their pixels tell what they show of it
        less_pixels, less = drawn(other, options, camera)
        if less_pixels != pixels:
            continue
        more = _more(ran, less, _own_work(part))
        place, name = re.fullmatch(r"(objects\[\d+\])?\.?(.*)", part).groups()
        only = None if place is None else int(place[8:-1])
        # Displacement runs before it is known what is seen, and where shadows fall.
        if place in hidden or name in ("casts_shadows", "receives_shadows", "projected"):
            more -= {"layers None", *displacements}
        places = range(len(scene.objects)) if only is None else (only,)
        if more and any(_is_masked(scene, i, options) for i in places):
            continue
        views = (None, *places) if only is None else (only,)
        if more and not any(_shows_elsewhere(scene, other, options, only=i) for i in views):
            yield f"{part}: {sorted(more)}"
        # Where a picture falls is known before it is read.
        is_thrown = name == "projected" and not has_rendered_environments(scene)
        names = _files_of(scene, only, name) if only is not None and is_thrown else set()
        needless = names & {Path(path).name for path in ran.files - less.files}
        if needless and not _shows_elsewhere(scene, other, options, only=only, aims=False):
            yield f"{part}: {sorted(needless)} although it falls on no pixel"


def in_white(scene: Scene, place: int) -> Scene:
    """Return a scene with one object white and opaque, so that it cannot be missed."""
    item = scene.objects[place]
    white = Material(
        shading="unlit", base_color=(1.0, 1.0, 1.0), displacement=item.material.displacement,
        double_sided=item.material.double_sided,
    )  # fmt: skip
    return with_object(scene, place, replace(item, material=white))


def _files_of(scene: Scene, place: int, name: str) -> set[str]:
    """Names of the image files of an object's displacement or projected pictures."""
    value = getattr(scene.objects[place].material, name)
    holders = value if isinstance(value, tuple) else (value,)
    return {Path(holder.texture.image).name for holder in holders if holder is not None}


def _more(ran: Trace, less: Trace, own: set[str]) -> set[str]:
    effects = {f"{name} {at}" for name, at in ran.effects - less.effects if name not in own}
    return effects | {Path(path).name for path in ran.files - less.files}


def _own_work(part: str) -> set[str]:
    """Effects that run to find out whether a part changes a pixel: only their values can tell."""
    if part == "occlusion":
        return {"ambient occlusion", "occlusion picture"}
    if part.endswith("vertex_colors"):
        return {"layers"}  # only its values tell whether they are transparent
    if part.startswith("lights"):
        return {
            "lights",
            "shadow maps",
            "light profiles",
            "positions",
        }  # these have a test of their own
    if part.endswith("projected"):
        return {"projected textures", "positions"}
    return {"shadow maps", "shadows", "positions"} if "shadow" in part else set()


def _shows_elsewhere(
    scene: Scene, other: Scene, options: RenderOptions, *, only: int | None, aims: bool = True
) -> bool:
    """Whether a part changes a picture where light and cameras reach all surfaces.

    Its own values do not say then that it changes nothing; only the pixels of one picture do.
    """
    lit, other_lit = (well_lit(item, aims=aims, only=only) for item in (scene, other))
    options = replace(
        options, width=96, height=64, view=(20.0, 30.0, None), background=(1.0, 1.0, 1.0)
    )
    cameras = turntable_cameras(lit, options, 4)
    return any(
        drawn(lit, options, camera)[0] != drawn(other_lit, options, camera)[0] for camera in cameras
    )


def _is_masked(scene: Scene, place: int, options: RenderOptions) -> bool:
    """Whether the values of its opacity leave nothing of an object, so that it may glow unseen."""
    item = scene.objects[place]
    glowing = replace(item, material=replace(item.material, emission=(5.0, 5.0, 5.0)))
    other = with_object(scene, place, glowing)
    return not _shows_elsewhere(scene, other, options, only=place)


def _for_hidden_objects(
    scene: Scene, options: RenderOptions, camera: Camera, pixels: bytes, ran: Trace
) -> Iterator[str]:
    """What ran for the materials of objects that no sample sees."""
    if has_rendered_environments(scene) or ("layers", None) in ran.effects:
        return  # mirrors may show them, and only its opacity tells whether a layer covers them
    numbers = range(len(scene.objects))
    all_files = set().union(*(_files_of(scene, i, "displacement") for i in numbers))
    for place in numbers:
        other_pixels, less = drawn(in_white(scene, place), options, camera)
        if other_pixels == pixels:
            # Another object's displacement may be for shadows on this one.
            own = {"layers", "lights", "light profiles", "displacement"}
            more = sorted(_more(ran, less, own) - all_files)
            if more:
                yield f"objects[{place}] is hidden: {more}"


def _for_lamps(
    scene: Scene, options: RenderOptions, camera: Camera, pixels: bytes, ran: Trace
) -> Iterator[str]:
    """Light cookies and shadow maps of lamps that light no pixel, whatever lies between."""
    if has_rendered_environments(scene):
        return  # what they show of it may be too dark or small to count
    if ("layers", None) in ran.effects:
        return  # transparent surfaces may cover what is lit
    if any(item.material.shading_rate == "vertex" for item in scene.objects):
        return  # it may reach corners of triangles that are not seen
    for place, light in enumerate(scene.lighting.lights):
        dark, bare = replace(light, intensity=0.0), replace(light, shadow=None)
        (dark_pixels, _), (bare_pixels, _) = (
            drawn(with_light(scene, place, item), options, camera) for item in (dark, bare)
        )
        own = {("light profiles", place)} & ran.loads
        own |= {("shadow maps", place)} & ran.effects
        if own and pixels == dark_pixels == bare_pixels:
            yield f"lights[{place}] reaches nothing: {sorted(map(str, own))}"


def misstatements(seed: int, folder: Path) -> list[str]:
    """Where the table of passes says something else than what ran."""
    scene, options = random_scene(seed, folder)
    if has_rendered_environments(scene):
        return []  # their pictures have plans of their own
    with recording() as trace:
        frame = draw(prepare(scene, options, threads=1), camera_of(scene, options))
    told = {row.name for row in plan_rows(frame.plan, frame.costs) if not row.skipped}
    ran = {name for name, _ in trace.effects}
    # Where light arrives is found out in passes that dim it, whatever they then need.
    watched = {e.name for e in EFFECTS if not e.dim and (e.load or e.prepare or e.shade)}
    return [
        *(f"{seed} {name} ran and is not told" for name in sorted(ran - told)),
        *(f"{seed} {name} is told and did not run" for name in sorted((told & watched) - ran)),
    ]


@pytest.fixture(scope="module")
def images(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("images")
    write_images(folder)
    return folder


@pytest.mark.parametrize("start", range(0, N_SCENES, 8))
def test_nothing_runs_without_need(start: int, images: Path) -> None:
    found = [line for seed in range(start, start + 8) for line in counterexamples(seed, images)]
    assert not found, "\n".join(found)


def test_the_table_of_passes_tells_what_ran(images: Path) -> None:
    found = [line for seed in range(N_SCENES) for line in misstatements(seed, images)]
    assert not found, "\n".join(found)


def test_every_number_of_threads_draws_the_same_bytes(images: Path) -> None:
    for seed in range(12):
        scene, options = random_scene(seed, images)
        options = replace(options, width=96, height=800)  # more rows than threads get at a time
        camera = camera_of(scene, options)
        one, three = (draw(prepare(scene, options, threads=n), camera) for n in (1, 3))
        assert one.color.tobytes() == three.color.tobytes(), seed
        assert one.depths.tobytes() == three.depths.tobytes(), seed


def test_simpler_materials_look_the_same(images: Path) -> None:
    """An effect of the caller's own keeps materials as they are."""
    own = Effect(name="own", does="nothing", left_out="no need")
    for seed in range(N_SCENES):
        scene, options = random_scene(seed, images)
        camera = camera_of(scene, options)
        masks = any(item.material.alpha_mode == "mask" for item in scene.objects)
        if masks and scene.lighting.occlusion is not None:
            continue  # what is opaque by its mask hides ambient light, too
        found, whole = (
            draw(prepare(scene, options, effects=effects, threads=1), camera)
            for effects in (EFFECTS, (*EFFECTS, own))
        )
        np.testing.assert_allclose(found.color, whole.color, atol=1e-6, err_msg=str(seed))
        np.testing.assert_array_equal(found.coverage, whole.coverage, str(seed))
