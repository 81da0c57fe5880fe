"""What the samples of a picture see, and which objects that leaves in it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from texbake.kernels import kernel
from texbake.parallel import run_bands
from texbake.rendering.effect import RenderState, VisibleScene
from texbake.rendering.raster.rasterize import rasterize
from texbake.rendering.raster.scanline import rasterize_scanlines
from texbake.rendering.raster.world import (
    CULL_BACK,
    SHOW_BACK,
    SKIP,
    VisibilityBuffer,
    World,
    object_of,
)

# Rows of samples a band.
_ROWS = 64


def find_visible(state: RenderState) -> VisibleScene:
    """Rasterize opaque objects, and find which objects some sample sees."""
    side = state.options.supersampling
    width, height = state.options.width * side, state.options.height * side
    matrix = state.camera.clip_from_world(width / height)
    layers = state.plan.has("transparency")
    with state.costs.timed("rasterizing"):
        modes = object_modes(state)
        clear = [layers and state.plan.has("transparency", i) for i in range(len(modes))]
        opaque = np.where(clear, np.uint8(SKIP), modes)
        weights = None
        if state.options.interpolation == "scanline":
            visibility, weights = rasterize_scanlines(
                state.world, matrix, width, height, modes=opaque
            )
        else:
            visibility = rasterize(
                state.world, matrix, width, height, modes=opaque, threads=state.threads
            )
        seen = seen_objects(visibility, state.world, threads=state.threads)
    state.costs.add("rasterizing", 0.0, visibility.n_bytes)
    return VisibleScene(
        visibility=visibility,
        modes=modes,
        objects=seen | {i for i in state.request.in_view if clear[i]},
        scanline_weights=weights,
    )


def object_modes(state: RenderState) -> npt.NDArray[np.uint8]:
    """(O,) uint8: what is drawn of each object, by the options and its material."""
    modes = np.full(len(state.scene.objects), SKIP, np.uint8)
    for index in state.request.in_view:
        double_sided = state.request.material(index).double_sided
        if double_sided is None:
            double_sided = state.options.back_faces == "show"
        modes[index] = SHOW_BACK if double_sided else CULL_BACK
    return modes


@kernel
def _seen_kernel(face_ids, starts, seen, start, stop):  # type: ignore[no-untyped-def]
    owner = 0
    for row in range(start, stop):
        for column in range(face_ids.shape[1]):
            face = face_ids[row, column]
            if face < 0:
                continue
            if not starts[owner] <= face < starts[owner + 1]:
                owner = object_of(face, starts)
            seen[owner] = True


def seen_objects(
    visibility: VisibilityBuffer, world: World, *, threads: int | None = None
) -> frozenset[int]:
    """Objects that some sample sees."""
    seen = np.zeros(world.n_objects, np.bool_)

    def work(start: int, stop: int) -> None:
        _seen_kernel(visibility.face_ids, world.starts, seen, start, stop)

    run_bands(work, len(visibility.face_ids), band=_ROWS, threads=threads)
    return frozenset(np.flatnonzero(seen).tolist())
