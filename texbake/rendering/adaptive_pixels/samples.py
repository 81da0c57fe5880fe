"""A bound on the error becomes samples: few per pixel, and more where they disagree.

First pixels are shaded in ever more cells, until finer cells change them by no more than the bound
allows. Then they get ever more samples, until their edges are where they should be. Each step is
taken for all pixels before it is decided which of them get the next, so the picture is the same for
any number of threads.

Based on: Whitted, "An Improved Illumination Model for Shaded Display", Communications of the ACM
23(6), 1980, for more samples where neighboring ones disagree. Departs from it in that samples and
shadings are refined separately, because edges need the former and highlights the latter.
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
# How often pixels shaded once are judged again, because those beside them have changed.
_ROUNDS = 3


class AdaptivePicture:
    """The samples of a picture, step by step.

    Parameters
    ----------
    state
        Laid out, with all objects prepared.

    Attributes
    ----------
    sampler : PixelSampler
    sums : PixelSums
        Of all pixels.
    shaded : (H, W) int32
        Shaded cells of each pixel along one side.
    seen : (H, W) int32
        Samples of each pixel along one side.
    codes : (H, W, 4) float32
        Means of the pixels, light sRGB-coded.
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
            For sRGB-coded channels, where black to white is 1.
        among : (H, W) bool, optional
            The only pixels that may get more samples; None for all.
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
        """(H, W) float32 estimated errors."""
        return np.maximum(self._edge_errors(), self._shading_errors())

    def _shade_finer(self, shaded: int, bound: float, among: BoolArray | None) -> bool:
        """Shade pixels with too great errors twice as finely; return whether there were any."""
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
        """Give pixels whose edges have too great errors four times as many samples."""
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
    """Draw a picture until its error is small enough, or its time is spent.

    Parameters
    ----------
    prepared
        With options that have a `max_error` or a `time_budget`.
    camera
        Where the picture is taken from.
    keep
        What the frame holds beside its color. With normals, they and the coverage are those of a
        picture with a fixed number of samples, as triangles and depths always are, so that all of
        them belong to the same pixels.
    progress
        Gets the stages.

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
    """(H, W, 4) float32 mean light, not multiplied by the opacity, and the opacity."""
    means = sums.means
    opacity = means[..., 3:]
    means[..., :3] /= np.where(opacity > 0.0, opacity, 1.0)
    return means.astype(np.float32)
