"""Refining a picture adaptively until its estimated error is below a bound.

First pixels are shaded in more and more cells, until further refinement changes them by no more
than the bound allows. Then they get more and more samples, until their edges are accurate enough.
Each step is completed for all pixels before the next pixels are selected, so the picture does not
depend on the number of threads.

Based on: Whitted, "An Improved Illumination Model for Shaded Display", Communications of the ACM
23(6), 1980, for more samples where neighboring ones disagree. Here samples and shadings are refined
separately, because edges need the former and highlights the latter.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from texbake.mesh.mesh import IntArray
from texbake.progress import ProgressSink, Stages
from texbake.rendering.adaptive_pixels.picture_rounds import PictureRounds
from texbake.rendering.adaptive_pixels.pixel_statistics import (
    Float32Array,
    PixelSums,
    code_means,
    edge_errors,
    shading_errors,
)
from texbake.rendering.adaptive_pixels.recheck import recheck
from texbake.rendering.adaptive_pixels.sampler import BoolArray, PixelCache, PixelSampler, Sides
from texbake.rendering.camera import Camera
from texbake.rendering.draw import Prepared, lay_out, shade_to_sums
from texbake.rendering.effect import RenderState
from texbake.rendering.resolve import Frame
from texbake.sampling.bounds import parse_picture_bound
from texbake.sampling.time_budget import BudgetClock, TimeBudget, with_actual_time
from texbake.texture.image import FloatImage

FIRST = Sides(seen=4, shaded=1)
FINEST = 16  # samples, and shaded cells, along one side
# How often pixels that were shaded once are estimated again after their neighbors have changed.
_ROUNDS = 3


@dataclass(frozen=True, eq=False)
class PictureState:
    """How finely each pixel is sampled."""

    # seen, shaded (H, W): samples and shaded cells along one side of each pixel
    seen: IntArray
    shaded: IntArray
    changes: Float32Array  # (H, W): change of each pixel by the last refinement of its shading


class AdaptivePicture:
    """The samples of a picture while it is refined."""

    # Most samples, and most shaded cells, along one side of a pixel.
    finest: ClassVar[int] = FINEST

    def __init__(self, state: RenderState, *, keeps: bool = False) -> None:
        shape = state.options.height, state.options.width
        self.sampler = PixelSampler(state)
        self._taker = PixelCache(self.sampler, shape) if keeps else self.sampler
        self.sums = PixelSums.empty(*shape)
        # (H, W): samples and shaded cells along one side of each pixel.
        self.seen = np.full(shape, FIRST.seen, np.int32)
        self.shaded = np.full(shape, FIRST.shaded, np.int32)
        self.codes = np.zeros((*shape, 4), np.float32)  # means, with sRGB-coded light
        self._changes = np.zeros(shape, np.float32)
        self.threads = state.threads

    def begin(self) -> None:
        """Take the first samples of all pixels."""
        self._take(np.ones(self.seen.shape, np.bool_), FIRST)
        self._code()

    @property
    def state(self) -> PictureState:
        """How finely pixels are sampled, to return to with `restore`."""
        return PictureState(self.seen.copy(), self.shaded.copy(), self._changes.copy())

    def restart(self) -> None:
        """Return to the first samples of all pixels."""
        self.restore(
            PictureState(
                np.full_like(self.seen, FIRST.seen),
                np.full_like(self.shaded, FIRST.shaded),
                np.zeros_like(self._changes),
            )
        )

    def restore(self, state: PictureState) -> None:
        """Return to an earlier state, with the samples that are kept."""
        is_changed = (state.seen != self.seen) | (state.shaded != self.shaded)
        both = state.seen * (FINEST + 1) + state.shaded
        for number in np.unique(both[is_changed]).tolist():
            self._take(is_changed & (both == number), Sides(*divmod(number, FINEST + 1)))
        self._changes = state.changes.copy()
        self._code()

    def refine(self, bound: float) -> None:
        """Take samples until each pixel's estimated error, white being 1, is within a bound."""
        shaded = FIRST.shaded
        while shaded < FINEST:
            for _ in range(_ROUNDS if shaded == FIRST.shaded else 1):
                if not self._shade_finer(shaded, bound):
                    break
            shaded *= 2
        seen = FIRST.seen
        while seen < FINEST:
            self._see_finer(seen, bound)
            seen *= 2

    @property
    def color(self) -> FloatImage:
        """(H, W, 4) float32: mean light, not premultiplied, and opacity."""
        means = self.sums.means
        opacity = means[..., 3:]
        means[..., :3] /= np.where(opacity > 0.0, opacity, 1.0)
        return means.astype(np.float32)

    def errors(self) -> Float32Array:
        """(H, W) float32: estimated errors."""
        return np.maximum(self.edge_errors(), self.shading_errors())

    def _shade_finer(self, shaded: int, bound: float) -> bool:
        """Shade pixels with too large errors twice as finely; return whether there were any."""
        wanted = (self.shaded == shaded) & (self.shading_errors() > bound)
        if not wanted.any():
            return False
        seen = np.maximum(self.seen, 2 * shaded)
        for side in np.unique(seen[wanted]).tolist():
            self._take(wanted & (seen == side), Sides(side, 2 * shaded))
        before = self.codes[wanted]
        self._code()
        self._changes[wanted] = np.abs(self.codes[wanted] - before).max(axis=-1)
        return True

    def _see_finer(self, seen: int, bound: float) -> None:
        """Take four times as many samples of pixels whose edges have too large errors."""
        wanted = (self.seen == seen) & (self.edge_errors() > bound)
        for side in np.unique(self.shaded[wanted]).tolist():
            self._take(wanted & (self.shaded == side), Sides(2 * seen, side))
        self._code()

    def _take(self, wanted: BoolArray, sides: Sides) -> None:
        # Noted first, so that an interrupted picture can be restored.
        self.seen[wanted], self.shaded[wanted] = sides.seen, sides.shaded
        self._taker.take(wanted, sides, self.sums)

    def _code(self) -> None:
        code_means(self.sums, self.codes, threads=self.threads)

    def shading_errors(self) -> Float32Array:
        """(H, W) float32: estimated errors of the shading."""
        return shading_errors(self.codes, self.shaded, self._changes, threads=self.threads)

    def edge_errors(self) -> Float32Array:
        """(H, W) float32: estimated errors of edges."""
        return edge_errors(self.sums, threads=self.threads)


def draw_adaptively(
    prepared: Prepared,
    camera: Camera,
    *,
    keep: Collection[str] = (),
    progress: ProgressSink | None = None,
    clock: BudgetClock | None = None,
) -> Frame:
    """Draw a picture to a given error bound or within a time budget; see `draw` for `keep`."""
    clock = clock or BudgetClock()
    options, stages = prepared.options, Stages(progress)
    request = prepared.request(camera, keep)
    state = lay_out(prepared, request, stages, all_objects=True)
    adaptive = AdaptivePicture(state, keeps=options.time_budget is not None)
    coverage: FloatImage | None = None
    normals: FloatImage | None = None
    if "normals" in keep:  # before the first samples, so that its time is known
        with stages.stage("shade normals"):
            plain = shade_to_sums(state)
            _, coverage, normals = plain.finish(None, threads=state.threads)
    start = clock.spent
    with stages.stage("shade"):
        adaptive.begin()
    budget: TimeBudget | None = None
    with stages.stage("refine"):
        if options.time_budget is not None:
            seconds = clock.spent - start
            bound, budget = PictureRounds(adaptive, options, clock, seconds).run()
        else:
            assert options.max_error is not None
            bound = parse_picture_bound(options.max_error)
            adaptive.refine(bound)
    with stages.stage("check errors"):
        sampling = recheck(adaptive, bound)
    if budget is not None:
        budget = with_actual_time(budget, clock)
    return Frame(
        color=adaptive.color,
        coverage=adaptive.sums.coverage if coverage is None else coverage,
        plan=state.plan,
        costs=state.costs,
        _visibility=state.visible.visibility,
        _near=camera.near,
        _normals=normals,
        sampling=sampling,
        budget=budget,
    )
