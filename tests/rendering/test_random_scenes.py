"""Laws of random scenes over all keys; `TEXBAKE_RANDOM_SCENES=10000` runs as many of them."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from random_scenes import has_rendered_environments, random_scene, write_images

import texbake.rendering.draw as drawing
import texbake.rendering.maps as maps
from texbake.rendering.draw import draw, prepare
from texbake.rendering.effect import Effect, RenderState
from texbake.rendering.effects import EFFECTS, slots
from texbake.rendering.fragments import Fragments
from texbake.rendering.plan import plan_rows
from texbake.rendering.results import Target
from texbake.rendering.scene.scene import camera_of

N_SCENES = int(os.environ.get("TEXBAKE_RANDOM_SCENES", "16"))


@dataclass
class Trace:
    """What ran for a picture."""

    effects: set[tuple[str, Any]] = field(default_factory=set)
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


def _note_fragments(trace: Trace, name: str, fragments: Fragments, state: RenderState) -> None:
    trace.effects.add((name, fragments.target))


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
