"""Exposing pictures in texbake's built-in light, so that white surfaces do not clip.

Lamps that show a gray mesh well are too bright for a white one. If more than a quarter of the
surface is brighter than white, the picture is darkened until only a quarter is. It is never
brightened, so that black stays black. Then highlights above 0.8 are compressed toward 1; darker
light is unchanged.

Both steps come after shading, in linear light; the background is unchanged. Adaptive samples
estimate the error of light up to white, and exposure does not increase it.

Based on: Khronos Group, "Khronos PBR Neutral Tone Mapper", 2024, without its offset.

Kernel: `core/exposure.c`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from texbake.core import core
from texbake.mesh.mesh import IntArray
from texbake.parallel import run_bands
from texbake.rendering.options import RenderOptions
from texbake.rendering.resolve import Frame
from texbake.texture.encoding import decode_srgb

# Share of the surface that may be brighter than white before the picture is darkened.
_BRIGHT = 0.25
# Rows of pixels per band.
_BAND = 16


def exposed(
    frames: Sequence[Frame],
    options: RenderOptions,
    *,
    exposure: float | None = None,
    threads: int | None = None,
) -> list[Frame]:
    """Return frames with exposed light, all with the same exposure."""
    if exposure is None:
        exposure = exposure_of(frames, threads=threads)
    return [_exposed(frame, exposure, options, threads) for frame in frames]


def exposure_of(frames: Sequence[Frame], *, threads: int | None = None) -> float:
    """Factor, at most 1, at which a quarter of the entirely covered pixels is above white."""
    n_covered, n_bright = np.sum([_counts(frame, threads) for frame in frames], axis=0).tolist()
    if n_bright <= _BRIGHT * n_covered:
        return 1.0
    peaks = np.concatenate(
        [frame.color[frame.coverage == 1.0][:, :3].max(axis=1) for frame in frames]
    )
    place = int((1.0 - _BRIGHT) * n_covered)
    return 1.0 / float(np.sort(peaks, kind="stable")[place])


def _counts(frame: Frame, threads: int | None) -> IntArray:
    """(2,) int64: pixels that surfaces cover entirely, and how many of them are above white."""
    counts = np.empty((frame.height, 2), np.int64)

    def work(start: int, stop: int) -> None:
        core.count_bright(frame.color, frame.coverage, counts, start, stop)

    run_bands(work, frame.height, band=_BAND, threads=threads)
    return np.asarray(counts.sum(axis=0))


def _exposed(frame: Frame, exposure: float, options: RenderOptions, threads: int | None) -> Frame:
    color = frame.color.copy()
    behind, covered = None, frame.coverage
    if any(item.effect.behind is not None for item in frame.plan.passes):
        # A visible environment behind the surfaces is exposed with them.
        covered = np.ones_like(covered)
    elif options.background is not None:
        behind = decode_srgb(options.background).astype(np.float32)

    def work(start: int, stop: int) -> None:
        core.expose_pixels(color, covered, behind, exposure, start, stop)

    run_bands(work, frame.height, band=_BAND, threads=threads)
    return replace(frame, color=color, exposure=exposure)
