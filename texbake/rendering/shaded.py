"""Fragments of a picture, shaded by the effects that its plan has for their objects."""

from __future__ import annotations

import numpy as np

from texbake.rendering.effect import RenderState
from texbake.rendering.fragments import Fragments, keep_finite
from texbake.rendering.raster.fragments import FragmentRows, fragment_rows, weights_at
from texbake.rendering.raster.world import VisibilityBuffer


def shaded_fragments(
    state: RenderState,
    visibility: VisibilityBuffer,
    rows: tuple[int, int],
    *,
    wants_samples: bool = False,
) -> tuple[FragmentRows, list[Fragments]]:
    """Fragments of some rows of pixels, shaded, object after object."""
    with state.costs.timed("fragments"):
        found = fragment_rows(
            visibility.face_ids,
            state.world,
            rows,
            side=state.options.supersampling,
            merges=state.options.edges == "multisample"
            and state.options.interpolation != "scanline",
            wants_samples=wants_samples,
        )
    return found, shaded_objects(state, visibility, found)


def shaded_objects(
    state: RenderState, visibility: VisibilityBuffer | None, found: FragmentRows
) -> list[Fragments]:
    """Shade fragments, object after object; `visibility` is where they come from, if anywhere."""
    shaded = []
    for target in range(state.world.n_objects):
        first, stop = found.starts[target : target + 2]
        if first == stop:
            continue
        with state.costs.timed("fragments"):
            fragments = _fragments_of(state, visibility, found, target, slice(first, stop))
        for effect in state.plan.for_target(target):
            if effect.shade is not None:
                with state.costs.timed(effect.name):
                    effect.shade(fragments, state)
        keep_finite(fragments.light)
        shaded.append(fragments)
    return shaded


def _fragments_of(
    state: RenderState,
    visibility: VisibilityBuffer | None,
    found: FragmentRows,
    target: int,
    span: slice,
) -> Fragments:
    drawn = state.drawn(target)
    world, options = state.world, state.options
    faces, places = found.faces[span], found.places[span]
    weights, back_facing, changes = weights_at(
        world,
        state.camera.clip_from_world(options.width / options.height),
        options.width,
        options.height,
        faces,
        places,
        affine=options.interpolation == "affine",
        wants_changes=state.plan.has("derivatives", target),
    )
    stepped = state.visible.scanline_weights
    if stepped is not None and visibility is state.visible.visibility:
        columns, rows = (places.T * np.float32(options.supersampling)).astype(np.int64)
        weights = stepped[rows, columns]
    own = faces - np.int32(world.starts[target])
    base = (
        (own, weights, changes)
        if drawn.base_faces is None
        else drawn.on_base(own, weights, changes)
    )
    return Fragments(
        target=target,
        drawn=drawn,
        drawn_faces=own,
        drawn_weights=weights,
        faces=base[0],
        weights=base[1],
        changes=base[2],
        places=places,
        pixels=found.pixels[span],
        counts=found.counts[span],
        back_facing=back_facing,
        light=np.zeros((len(faces), 3), np.float32),
    )
