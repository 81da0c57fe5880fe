"""As many samples as each pixel of a picture needs: few, and more where they disagree.

First pixels are shaded in ever more cells, until finer cells change them by no more than the bound
allows; then they get ever more samples, until their edges are where they are told to be. Each step
is taken for all pixels before it is decided which get the next, so that the picture is the same
for any number of threads.

Based on: Whitted, "An improved illumination model for shaded display", CACM 23(6), 1980, for
samples where their neighbors disagree. Departs from it in that what is seen and what is shaded are
refined by themselves, because edges need the one and highlights the other.
"""

from __future__ import annotations

import time
from collections.abc import Collection
from dataclasses import replace

import numpy as np

from texbake.progress import ProgressSink, Stages
from texbake.rendering.camera import Camera
from texbake.rendering.draw import Prepared, laid_out, shaded_sums
from texbake.rendering.picture import Picture
from texbake.rendering.picture_budget import choose_bound
from texbake.rendering.picture_error import parse_max_error
from texbake.rendering.picture_report import PictureBudget
from texbake.rendering.pixel_errors import code_means, edge_errors, shading_errors
from texbake.rendering.pixel_samples import BoolArray, PixelSampler, Sides
from texbake.rendering.pixel_sums import Float32Array, PixelSums
from texbake.rendering.plan.question import Question
from texbake.rendering.resolve import Frame
from texbake.rendering.second_look import second_look
from texbake.texture.image import FloatImage

FIRST = Sides(seen=4, shaded=1)
FINEST = 16  # along one side, of both
# How often pixels shaded once are looked at again, because those beside them have changed.
_ROUNDS = 3


class AdaptivePicture:
    """The samples of a picture, step by step.

    Parameters
    ----------
    picture
        Laid out, with all objects ready.

    Attributes
    ----------
    sampler : PixelSampler
    sums : PixelSums
        Of all pixels.
    shaded : (H, W) int32
        Cells of each pixel along one side.
    seen : (H, W) int32
        Samples of each pixel along one side.
    codes : (H, W, 4) float32
        Their means, light sRGB-coded.
    threads : int, optional
    """

    def __init__(self, picture: Picture) -> None:
        shape = picture.options.height, picture.options.width
        self.sampler = PixelSampler(picture)
        self.sums = PixelSums.empty(*shape)
        self.seen = np.full(shape, FIRST.seen, np.int32)
        self.shaded = np.full(shape, FIRST.shaded, np.int32)
        self.codes = np.zeros((*shape, 4), np.float32)
        self._changes = np.zeros(shape, np.float32)
        self.threads = picture.threads

    def begin(self) -> None:
        """Take the first samples of all pixels."""
        self._take(np.ones(self.seen.shape, np.bool_), FIRST)
        self._code()

    def refine(self, bound: float, among: BoolArray | None = None) -> None:
        """Take samples until the estimated error of each pixel is at most the bound.

        Parameters
        ----------
        bound
            Of sRGB-coded channels, from black to white 1.
        among : (H, W) bool, optional
            The only pixels that may get more; None for all.
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
        """Shade pixels of some fineness twice as finely where they are off; tell if any was."""
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
        """Give pixels of some number of samples four times as many where their edges are off."""
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
    """Draw a picture until its error is as small, or its time as spent, as its options ask for.

    Parameters
    ----------
    prepared
        Its options have a `max_error` or a `time_budget`.
    camera
        Where it is taken from.
    keep
        What the frame is to hold beside its color. Where that is normals, they and the coverage are
        those of a picture of given samples, as triangles and depths always are: so they tell of
        the same pixels.
    progress
        Told of the stages.

    Returns
    -------
    Frame
        With what the samples reached, and what became of the budget.
    """
    start = time.perf_counter()
    options, stages = prepared.options, Stages(progress)
    question = Question(prepared.scene, options, camera, frozenset(keep))
    picture, visibility = laid_out(prepared, question, stages, all_objects=True)
    adaptive = AdaptivePicture(picture)
    with stages.stage("shade"):
        adaptive.begin()
        coverage: FloatImage | None = None
        normals: FloatImage | None = None
        if "normals" in keep:  # before the choice of a bound, so that its time is known there
            plain = shaded_sums(picture, visibility)
            _, coverage, normals = plain.finished(None, threads=picture.threads)
    budget: PictureBudget | None = None
    if options.time_budget is None:
        assert options.max_error is not None
        bound: float | None = parse_max_error(options.max_error)
    else:
        with stages.stage("probe"):
            bound, budget = choose_bound(adaptive, options, start)
    if bound is not None:
        with stages.stage("refine"):
            adaptive.refine(bound)
    with stages.stage("check errors"):
        sampling = second_look(adaptive, bound)
    if budget is not None:
        budget = replace(budget, actual_seconds=time.perf_counter() - start)
    return Frame(
        color=_color(adaptive.sums),
        coverage=adaptive.sums.coverage if coverage is None else coverage,
        plan=picture.plan,
        costs=picture.costs,
        _visibility=visibility,
        _near=camera.near,
        _normals=normals,
        sampling=sampling,
        budget=budget,
    )


def _color(sums: PixelSums) -> FloatImage:
    """(H, W, 4) float32: mean light, not multiplied by the opacity, and the opacity."""
    means = sums.means
    opacity = means[..., 3:]
    means[..., :3] /= np.where(opacity > 0.0, opacity, 1.0)
    return means.astype(np.float32)
