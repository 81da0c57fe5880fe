"""Maps from the means of texels: with padding, ready to be written."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from texbake.baking.inputs import BakeInputs
from texbake.baking.maps.kind import MapKind
from texbake.baking.options import BakeOptions
from texbake.baking.padding import ChartPadding
from texbake.baking.result import BakedMap
from texbake.baking.texels import NO_FACE
from texbake.core import core
from texbake.mesh.mesh import IntArray
from texbake.parallel import run_bands
from texbake.progress import Stages

_ROWS = 128
# In standard errors: two values with independent errors differ by more than this 1 time in 700.
_STANDARD_ERRORS = 4.5


def texel_charts_of(inputs: BakeInputs, texel_faces: IntArray) -> IntArray:
    """(H, W) int32: chart of the low-poly mesh that covers each texel, `NO_FACE` for none."""
    # NO_FACE is -1, the last entry, which has no chart.
    charts = np.append(inputs.low_surface.charts, NO_FACE).astype(np.int32)
    texel_charts = np.empty_like(texel_faces)

    def look_up(start: int, stop: int) -> None:
        np.take(charts, texel_faces[start:stop], mode="wrap", out=texel_charts[start:stop])

    run_bands(look_up, len(texel_faces), band=_ROWS, threads=inputs.options.threads)
    return texel_charts


def denoised(
    values: npt.NDArray[np.float32],
    kind: MapKind,
    texel_charts: IntArray,
    has_data: npt.NDArray[np.bool_],
    options: BakeOptions,
) -> npt.NDArray[np.float32]:
    """Average each texel with neighbors that differ by less than a few standard errors of its rays.

    `values` (H, W, 1) float32; `texel_charts` (H, W) int32. Returns (H, W, 1) float32.
    """
    root = np.sqrt(float(options.secondary_rays))
    left = _STANDARD_ERRORS / (root * np.sqrt(root))
    of_shares, relative = (left * noise for noise in kind.noise)
    flat, filtered = values[..., 0].copy(), np.empty_like(values[..., 0])

    def work(start: int, stop: int) -> None:
        core.filter_by_noise(
            flat, texel_charts, has_data, of_shares, relative, start, stop, filtered
        )

    run_bands(work, len(values), band=_ROWS, threads=options.threads)
    return filtered[..., np.newaxis]


def finished_maps(
    kinds: list[MapKind],
    means: Callable[[MapKind], npt.NDArray[np.float32]],
    texel_charts: IntArray,
    has_data: npt.NDArray[np.bool_],
    inputs: BakeInputs,
    stages: Stages,
) -> tuple[dict[str, BakedMap], int]:
    """Pad the maps; also return the number of texels where the padding of two charts meets.

    `texel_charts` (H, W) int32.
    """
    options = inputs.options
    with stages.stage("pad"):
        padding = ChartPadding(texel_charts, has_data, options)
        complete = padding
        if any(kind.of_misses for kind in kinds) and padding.n_missed:
            complete = ChartPadding(texel_charts, texel_charts != NO_FACE, options)
    maps = {}
    for kind in kinds:
        with stages.part("make maps"):
            values = means(kind)
            if options.denoise and any(kind.noise):
                values = denoised(values, kind, texel_charts, has_data, options)
        with stages.part("pad"):
            around = complete if kind.of_misses else padding
            values = around.pad(
                values, kind.neutral(options), kind.combine, hides_misses=kind.hides_misses
            )
        bounds = None if kind.bounds is None else kind.bounds(inputs)
        legend = () if kind.legend is None else kind.legend(inputs)
        maps[kind.name] = BakedMap(kind, values, has_data, options, bounds, legend)
    return maps, padding.n_meeting
