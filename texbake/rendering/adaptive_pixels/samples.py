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

import time
from collections.abc import Collection
from dataclasses import replace

import numpy as np

from texbake.progress import ProgressSink, Stages
from texbake.rendering.adaptive_pixels.budget import choose_picture_bound
from texbake.rendering.adaptive_pixels.pixel_error import code_means, edge_errors, shading_errors
from texbake.rendering.adaptive_pixels.pixel_sums import Float32Array, PixelSums
from texbake.rendering.adaptive_pixels.recheck import recheck
from texbake.rendering.adaptive_pixels.sampler import BoolArray, PixelSampler, Sides
from texbake.rendering.camera import Camera
from texbake.rendering.draw import Prepared, laid_out, shaded_sums
from texbake.rendering.effect import RenderState
from texbake.rendering.request import RenderRequest
from texbake.rendering.resolve import Frame
from texbake.sampling.bounds import parse_picture_bound
from texbake.sampling.time_budget import TimeBudget
from texbake.texture.image import FloatImage

FIRST = Sides(seen=4, shaded=1)
FINEST = 16  # samples, and shaded cells, along one side
# How often pixels that were shaded once are estimated again after their neighbors have changed.
_ROUNDS = 3


class AdaptivePicture:
    """The samples of a picture while it is refined.

    Parameters
    ----------
    state
        State from `texbake.rendering.draw.laid_out`, with all objects prepared.

    Attributes
    ----------
    sampler : PixelSampler
    sums : PixelSums
        Sums of all pixels.
    shaded : (H, W) int32
        Shaded cells along one side of each pixel.
    seen : (H, W) int32
        Samples along one side of each pixel.
    codes : (H, W, 4) float32
        Means of the pixels, with sRGB-coded light.
    threads : int, optional
    """

    def __init__(self, state: RenderState) -> None:
        shape = state.options.height, state.options.width
        self.sampler = PixelSampler(state)
        self.sums = PixelSums.empty(*shape)
        self.seen = np.full(shape, FIRST.seen, np.int32)
        self.shaded = np.full(shape, FIRST.shaded, np.int32)
        self.codes = np.zeros((*shape, 4), np.float32)
        self._changes = np.zeros(shape, np.float32)
        self.threads = state.threads

    def begin(self) -> None:
        """Take the first samples of all pixels."""
        self._take(np.ones(self.seen.shape, np.bool_), FIRST)
        self._code()

    def refine(self, bound: float, among: BoolArray | None = None) -> None:
        """Take samples until the estimated error of each pixel is at most the bound.

        Parameters
        ----------
        bound
            Error bound for sRGB-coded channels, with black to white as 1.
        among : (H, W) bool, optional
            Restricts refinement to these pixels; None refines all.
        """
        shaded = FIRST.shaded
        while shaded < FINEST:
            for _ in range(_ROUNDS if shaded == FIRST.shaded else 1):
                if not self._shade_finer(shaded, bound, among):
                    break
            shaded *= 2
        seen = FIRST.seen
        while seen < FINEST:
            self._see_finer(seen, bound, among)
            seen *= 2

    def errors(self) -> Float32Array:
        """(H, W) float32: estimated errors."""
        return np.maximum(self._edge_errors(), self._shading_errors())

    def _shade_finer(self, shaded: int, bound: float, among: BoolArray | None) -> bool:
        """Shade pixels with too large errors twice as finely; return whether there were any."""
        wanted = (self.shaded == shaded) & (self._shading_errors() > bound)
        if among is not None:
            wanted &= among
        if not wanted.any():
            return False
        seen = np.maximum(self.seen, 2 * shaded)
        for side in np.unique(seen[wanted]).tolist():
            self._take(wanted & (seen == side), Sides(side, 2 * shaded))
        before = self.codes[wanted]
        self._code()
        self._changes[wanted] = np.abs(self.codes[wanted] - before).max(axis=-1)
        return True

    def _see_finer(self, seen: int, bound: float, among: BoolArray | None) -> None:
        """Take four times as many samples of pixels whose edges have too large errors."""
        wanted = (self.seen == seen) & (self._edge_errors() > bound)
        if among is not None:
            wanted &= among
        for side in np.unique(self.shaded[wanted]).tolist():
            self._take(wanted & (self.shaded == side), Sides(2 * seen, side))
        self._code()

    def _take(self, wanted: BoolArray, sides: Sides) -> None:
        self.sampler.take(wanted, sides, self.sums)
        self.seen[wanted], self.shaded[wanted] = sides.seen, sides.shaded

    def _code(self) -> None:
        code_means(self.sums, self.codes, threads=self.threads)

    def _shading_errors(self) -> Float32Array:
        return shading_errors(self.codes, self.shaded, self._changes, threads=self.threads)

    def _edge_errors(self) -> Float32Array:
        return edge_errors(self.sums, threads=self.threads)


def draw_adaptively(
    prepared: Prepared,
    camera: Camera,
    *,
    keep: Collection[str] = (),
    progress: ProgressSink | None = None,
) -> Frame:
    """Draw a picture to a given error bound or within a time budget.

    Parameters
    ----------
    prepared
        Scene from `prepare`; its options set `max_error` or `time_budget`.
    camera
        Camera of the picture.
    keep
        Data that the frame holds beside its color. Normals and the coverage that comes with them
        have a fixed number of samples, as triangles and depths always do, so that they match.
    progress
        Receives the stages.

    Returns
    -------
    Frame
        With reports on the samples and on the time budget.
    """
    start = time.perf_counter()
    options, stages = prepared.options, Stages(progress)
    request = RenderRequest(prepared.scene, options, camera, frozenset(keep))
    state = laid_out(prepared, request, stages, all_objects=True)
    adaptive = AdaptivePicture(state)
    with stages.stage("shade"):
        adaptive.begin()
        coverage: FloatImage | None = None
        normals: FloatImage | None = None
        if "normals" in keep:  # before the choice of a bound, so that its time is known there
            plain = shaded_sums(state)
            _, coverage, normals = plain.finished(None, threads=state.threads)
    budget: TimeBudget | None = None
    if options.time_budget is None:
        assert options.max_error is not None
        bound: float | None = parse_picture_bound(options.max_error)
    else:
        with stages.stage("probe"):
            bound, budget = choose_picture_bound(adaptive, options, start)
    if bound is not None:
        with stages.stage("refine"):
            adaptive.refine(bound)
    with stages.stage("check errors"):
        sampling = recheck(adaptive, bound)
    if budget is not None:
        budget = replace(budget, actual_seconds=time.perf_counter() - start)
    return Frame(
        color=_color(adaptive.sums),
        coverage=adaptive.sums.coverage if coverage is None else coverage,
        plan=state.plan,
        costs=state.costs,
        _visibility=state.visible.visibility,
        _near=camera.near,
        _normals=normals,
        sampling=sampling,
        budget=budget,
    )


def _color(sums: PixelSums) -> FloatImage:
    """(H, W, 4) float32: mean light, not premultiplied, and opacity."""
    means = sums.means
    opacity = means[..., 3:]
    means[..., :3] /= np.where(opacity > 0.0, opacity, 1.0)
    return means.astype(np.float32)
