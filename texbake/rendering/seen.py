"""What the samples of a picture see, and which objects that leaves in it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from texbake.kernels import kernel
from texbake.parallel import run_bands
from texbake.rendering.picture import Picture
from texbake.rendering.raster.rasterize import rasterize
from texbake.rendering.raster.scanline import rasterize_scanlines
from texbake.rendering.raster.visibility import Visibility
from texbake.rendering.raster.world import (
    CULL_BACK,
    SHOW_BACK,
    SKIP,
    World,
    object_of,
)

# Rows of samples a band.
_ROWS = 64


def find_visibility(picture: Picture) -> Visibility:
    """What each sample sees of opaque objects; notes which objects are seen."""
    side = picture.options.supersampling
    width, height = picture.options.width * side, picture.options.height * side
    matrix = picture.camera.clip_from_world(width / height)
    layers = picture.plan.has("transparency")
    with picture.costs.timed("rasterizing"):
        modes = object_modes(picture)
        clear = [layers and picture.plan.has("transparency", i) for i in range(len(modes))]
        opaque = np.where(clear, np.uint8(SKIP), modes)
        if picture.options.interpolation == "scanline":
            visibility, weights = rasterize_scanlines(
                picture.world, matrix, width, height, modes=opaque
            )
            picture.values["scanline weights", None] = weights
        else:
            visibility = rasterize(
                picture.world, matrix, width, height, modes=opaque, threads=picture.threads
            )
        seen = seen_objects(visibility, picture.world, threads=picture.threads)
    picture.costs.add("rasterizing", 0.0, visibility.n_bytes)
    picture.values["visibility", None] = visibility
    picture.values["object modes", None] = modes
    picture.values["seen objects", None] = seen | {i for i in picture.question.seen if clear[i]}
    return visibility


def object_modes(picture: Picture) -> npt.NDArray[np.uint8]:
    """(O,) uint8: what is drawn of each object, by the options and its material."""
    modes = np.full(len(picture.scene.objects), SKIP, np.uint8)
    for index in picture.question.seen:
        double_sided = picture.question.material(index).double_sided
        if double_sided is None:
            double_sided = picture.options.back_faces == "show"
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
    visibility: Visibility, world: World, *, threads: int | None = None
) -> frozenset[int]:
    """Objects that some sample sees."""
    seen = np.zeros(world.n_objects, np.bool_)

    def work(start: int, stop: int) -> None:
        _seen_kernel(visibility.face_ids, world.starts, seen, start, stop)

    run_bands(work, len(visibility.face_ids), band=_ROWS, threads=threads)
    return frozenset(np.flatnonzero(seen).tolist())
