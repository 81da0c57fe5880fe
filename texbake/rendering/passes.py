"""The two passes of every picture: rasterizing what is visible, and shading its fragments.

Kernel: `core/compositing.c`.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from texbake.core import core
from texbake.mesh.mesh import ByteArray, FloatArray
from texbake.parallel import run_bands
from texbake.rendering.effect import Effect, RenderState, VisibleScene
from texbake.rendering.fragments import (
    BRIGHTEST,
    FragmentRows,
    Fragments,
    fragment_rows,
    weights_at,
)
from texbake.rendering.rasterize import (
    CULL_BACK,
    SHOW_BACK,
    SKIP,
    VisibilityBuffer,
    World,
    rasterize,
    rasterize_scanlines,
)

# Rows of samples per band.
_ROWS = 64


def find_visible(state: RenderState) -> VisibleScene:
    """Rasterize opaque objects and list the objects that are visible in some sample."""
    layers = state.plan.has("transparency")
    with state.costs.timed("rasterizing"):
        modes = object_modes(state)
        clear = [layers and state.plan.has("transparency", i) for i in range(len(modes))]
        opaque = np.where(clear, np.uint8(SKIP), modes)
        weights = None
        if state.options.interpolation == "scanline":
            visibility, weights = rasterize_scanlines(state.world, *screen_of(state), modes=opaque)
        else:
            visibility = rasterize_samples(state, opaque)
        seen = seen_objects(visibility, state.world, threads=state.threads)
    state.costs.add("rasterizing", 0.0, visibility.n_bytes)
    return VisibleScene(visibility=visibility, modes=modes, objects=seen, scanline_weights=weights)


def screen_of(state: RenderState) -> tuple[FloatArray, int, int]:
    """Return the camera's matrix, and the width and height of the picture in samples."""
    side = state.options.supersampling
    width, height = state.options.width * side, state.options.height * side
    return state.camera.clip_from_world(width / height), width, height


def rasterize_samples(
    state: RenderState,
    modes: ByteArray,
    *,
    behind: VisibilityBuffer | None = None,
    before: VisibilityBuffer | None = None,
) -> VisibilityBuffer:
    """Rasterize the samples of the picture, or of its window; see `rasterize`."""
    window = state.request.window
    return rasterize(
        state.world,
        *screen_of(state),
        modes=modes,
        window=None if window is None else window.of_samples(state.options.supersampling),
        behind=behind,
        before=before,
        threads=state.threads,
    )


def object_modes(state: RenderState) -> ByteArray:
    """(O,) uint8: which faces of each object are drawn, by the options and its material."""
    modes = np.full(len(state.scene.objects), SKIP, np.uint8)
    for index in state.request.in_view:
        double_sided = state.request.material(index).double_sided
        if double_sided is None:
            double_sided = state.options.back_faces == "show"
        modes[index] = SHOW_BACK if double_sided else CULL_BACK
    return modes


def seen_objects(
    visibility: VisibilityBuffer, world: World, *, threads: int | None = None
) -> frozenset[int]:
    """Return the objects that are visible in some sample."""
    seen = np.zeros(world.n_objects, np.bool_)
    kernel = partial(core.mark_seen_objects, visibility.face_ids, world.starts, seen)
    run_bands(kernel, len(visibility.face_ids), band=_ROWS, threads=threads)
    return frozenset(np.flatnonzero(seen).tolist())


def shade_fragments(
    state: RenderState,
    visibility: VisibilityBuffer,
    rows: tuple[int, int],
    *,
    wants_samples: bool = False,
) -> tuple[FragmentRows, list[Fragments]]:
    """Shade the fragments of some rows of pixels, object by object."""
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
    return found, shade_objects(state, visibility, found)


def shade_objects(
    state: RenderState, visibility: VisibilityBuffer | None, found: FragmentRows
) -> list[Fragments]:
    """Shade fragments object by object; `visibility` is the buffer they come from, if any."""
    shaded = []
    for target in range(state.world.n_objects):
        first, stop = found.starts[target : target + 2]
        if first == stop:
            continue
        with state.costs.timed("fragments"):
            fragments = _fragments_of(state, visibility, found, target, slice(first, stop))
        for effect in state.plan.for_target(target):
            if effect.shade is not None and _is_for_pixels(state, effect, target):
                with state.costs.timed(effect.name):
                    effect.shade(fragments, state)
        core.keep_finite(fragments.light, BRIGHTEST)
        shaded.append(fragments)
    return shaded


def _is_for_pixels(state: RenderState, effect: Effect, target: int) -> bool:
    """Whether an effect runs at pixels of an object, and not only at its vertices."""
    material = state.request.material(target)
    if material.shading_rate == "pixel" or material.shading == "unlit" or effect.rate != "vertex":
        return True
    # Mirrors, buffers, and callers that keep the normals, need them at pixels.
    request = state.request
    is_kept = request.shows_buffer or "normals" in request.keep
    needs_normals = material.reflection or material.refraction or is_kept
    return bool(needs_normals) and effect.gives_normals


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
    return Fragments.on(
        target,
        drawn,
        own,
        weights,
        changes,
        places=places,
        pixels=found.pixels[span],
        counts=found.counts[span],
        back_facing=back_facing,
    )
