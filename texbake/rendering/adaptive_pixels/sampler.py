"""Sampling selected pixels of a picture with a given number of samples and shadings.

A pixel has `sides.seen` x `sides.seen` visibility samples and is divided into `sides.shaded` x
`sides.shaded` cells. In each cell every visible triangle is shaded once, at the mean position of
the samples that see it, as `texbake.rendering.fragments` does for whole pixels. An edge thus
takes many samples and few shadings, a sharp highlight few samples and many shadings. Texture
filters use the footprint of a whole pixel for every cell, so that refinement does not change the
picture.

The picture is rendered in strips just wide enough for the selected pixels, so that memory is
bounded. Kernel: `core/sample_statistics.c`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from texbake.core import core
from texbake.mesh.mesh import BoolArray, Float32Array, FloatArray, Int64Array, IntArray
from texbake.parallel import run_bands
from texbake.rendering.adaptive_pixels.pixel_statistics import PixelSums, Sides
from texbake.rendering.draw import find_background
from texbake.rendering.effect import RenderState
from texbake.rendering.effects.transparency import LayeredSamples, peel_layers
from texbake.rendering.fragments import FragmentRows, fragment_rows
from texbake.rendering.passes import find_visible, shade_objects
from texbake.rendering.rasterize import VisibilityBuffer, Window

# Cells shaded together by one thread, as in `texbake.rendering.draw`.
_CELLS = 1 << 15
# Samples per window. They take eight bytes each, and again as much for each transparent layer.
_WINDOW = 1 << 23
# The same where the work may be ended between windows.
_WATCHED_WINDOW = 1 << 21
# Gap in rows above which a new window is started. Each window projects all vertices again.
_GAP = 16


def windows(wanted: BoolArray, side: int, n_samples: int) -> Iterator[Window]:
    """Yield narrow strips with all wanted pixels, of up to `n_samples` samples each."""
    rows = np.flatnonzero(wanted.any(axis=1))
    most = max(1, n_samples // (wanted.shape[1] * side**2))
    # A strip ends before a gap that is large enough for a new one.
    for run in np.split(rows, np.flatnonzero(np.diff(rows) > _GAP) + 1):
        while len(run):
            top = int(run[0])
            inside = run[run < top + most]
            bottom = int(inside[-1]) + 1
            columns = np.flatnonzero(wanted[top:bottom].any(axis=0))
            yield Window(top, bottom, int(columns[0]), int(columns[-1]) + 1)
            run = run[len(inside) :]


class PixelSampler:
    """Takes samples of pixels."""

    def __init__(self, state: RenderState) -> None:
        self._state = state
        self._behind = _behind_all(state)
        self.is_opaque = self._behind is not None  # so every sample has an opacity of 1
        self._has_layers = state.plan.has("layers")
        # Shaded cells and visibility samples so far in pixels that show a surface; a cell with an
        # edge counts once.
        self.n_shaded = self.n_seen = 0
        self.n_windows = 0
        self.seconds = 0.0
        self.now: Callable[[], float] = time.perf_counter
        # Called before each window with its pixels and how they are sampled; may raise an error to
        # end the work.
        self.watch: Callable[[int, Sides], None] | None = None

    def take(self, wanted: BoolArray, sides: Sides, sums: PixelSums) -> None:
        """Sample pixels (H, W) again and replace their previous sums."""
        start = self.now()
        sums.counts[wanted] = sides.seen**2
        n_samples = _WINDOW if self.watch is None else _WATCHED_WINDOW
        for window in windows(wanted, sides.seen, n_samples):
            if self.watch is not None:
                part = wanted[window.top : window.bottom, window.left : window.right]
                self.watch(int(np.count_nonzero(part)), sides)
            self.n_windows += 1
            self._take_window(window, wanted, sides, sums)
        n_shown = int(np.count_nonzero(wanted & (sums.covered > 0.0)))
        self.n_shaded += n_shown * sides.shaded**2
        self.n_seen += n_shown * sides.seen**2
        self.seconds += self.now() - start

    def work(self, seen_cost: float) -> float:
        """Work so far, in shaded cells; a visibility sample costs a share of one."""
        return self.n_shaded + seen_cost * self.n_seen

    def _take_window(
        self, window: Window, wanted: BoolArray, sides: Sides, sums: PixelSums
    ) -> None:
        mask = np.ascontiguousarray(wanted[window.top : window.bottom, window.left : window.right])
        layers = self._rasterize_window(window, mask, sides)
        rows, columns = window.shape
        sums_here = PixelSums.empty(rows, columns)
        n_cells = int(np.count_nonzero(mask)) * sides.shaded**2
        behind = np.zeros((1, 1, 3), np.float32)
        if self._behind is not None and self._behind.ndim == 1:
            behind = np.ascontiguousarray(self._behind.reshape(1, 1, 3))
        elif self._behind is not None:
            here = self._behind[window.top : window.bottom, window.left : window.right]
            behind = np.ascontiguousarray(here)

        def work(start: int, stop: int) -> None:
            if self._has_layers:
                self._compose(layers, window, (start, stop), sides, sums_here, behind)
            else:
                self._add(layers[0], window, (start, stop), sides, sums_here)

        band = max(1, min(rows, rows * _CELLS // max(n_cells, 1)))
        run_bands(work, rows, band=band, threads=self._state.threads)
        sums_here.write_to(
            sums,
            (window.top, window.left),
            mask,
            None if self._has_layers else behind,
            side=sides.seen,
            is_opaque=self.is_opaque,
        )

    def _rasterize_window(
        self, window: Window, mask: BoolArray, sides: Sides
    ) -> list[VisibilityBuffer]:
        """Rasterize the wanted samples of a window: transparent layers, then opaque surfaces."""
        state = self._state
        options = replace(state.options, supersampling=sides.seen)
        part = replace(state, request=replace(state.request, options=options, window=window))
        visible = find_visible(part)
        layers = [visible.visibility]
        if self._has_layers:
            with state.costs.timed("layers"):
                part = replace(part, visible_scene=visible)
                layers = [*peel_layers(part, None).layers, *layers]
        for visibility in layers:
            core.drop_unwanted(visibility.face_ids, mask, sides.seen)
        return layers

    def _fragments(
        self, visibility: VisibilityBuffer, window: Window, rows: tuple[int, int], sides: Sides
    ) -> tuple[FragmentRows, IntArray]:
        """Return the fragments of some rows of a window, and their pixels in the picture."""
        state, fine = self._state, sides.shaded
        with state.costs.timed("fragments"):
            fragments = fragment_rows(
                visibility.face_ids,
                state.world,
                (rows[0] * fine, rows[1] * fine),
                side=sides.seen // fine,
                wants_samples=self._has_layers,
                corner=(window.left * fine, window.top * fine),
                fine=fine,
            )
            columns = window.shape[1]
            down, right = np.divmod(fragments.pixels, np.int32(columns * fine))
            down, right = down // np.int32(fine), right // np.int32(fine)
            whole = state.options.width
            pixels = (down + np.int32(window.top)) * np.int32(whole) + right + np.int32(window.left)
        return replace(fragments, pixels=pixels), down * np.int32(columns) + right

    def _add(
        self,
        visibility: VisibilityBuffer,
        window: Window,
        rows: tuple[int, int],
        sides: Sides,
        sums: PixelSums,
    ) -> None:
        """Add opaque fragments to their pixels."""
        fragments, places = self._fragments(visibility, window, rows, sides)
        first = 0
        for shaded in shade_objects(self._state, None, fragments):
            with self._state.costs.timed("pixels"):
                sums.add(places[first : first + len(shaded)], shaded.counts, shaded.light)
            first += len(shaded)

    def _compose(
        self,
        layers: list[VisibilityBuffer],
        window: Window,
        rows: tuple[int, int],
        sides: Sides,
        sums: PixelSums,
        behind: Float32Array,
    ) -> None:
        """Composite the layers at each sample and add the samples to their pixels."""
        side = sides.seen
        samples = LayeredSamples.empty(((rows[1] - rows[0]) * side, window.shape[1] * side))
        for layer in layers:
            fragments, _ = self._fragments(layer, window, rows, sides)
            shaded = shade_objects(self._state, None, fragments)
            samples.composite_under(
                self._state, fragments.of_samples, shaded, opaque=layer is layers[-1]
            )
        with self._state.costs.timed("pixels"):
            sums.add_samples(samples, behind, rows[0], side)


def _behind_all(state: RenderState) -> Float32Array | None:
    """Compute the background at every pixel, since any pixel may show it in a sample."""
    for item in state.plan.passes:
        if item.effect.behind is not None and item.effect.prepare is not None:
            shape = state.options.height, state.options.width
            nothing = VisibilityBuffer(np.full(shape, -1, np.int32), np.zeros(shape, np.float32))
            request = replace(state.request, options=replace(state.options, supersampling=1))
            visible = replace(state.visible, visibility=nothing)
            results = state.results.copy()
            empty = replace(state, request=request, visible_scene=visible, results=results)
            with state.costs.timed(item.name):
                behind = item.effect.prepare(empty, None)
            results.put(item.effect.prepare, None, behind)
            return find_background(empty)
    return find_background(state)


class PixelCache:
    """Samples pixels, or returns what they gave before."""

    def __init__(self, sampler: PixelSampler, shape: tuple[int, int]) -> None:
        self._sampler, self._n_pixels = sampler, shape[0] * shape[1]
        self._rows: dict[Sides, IntArray] = {}  # of each pixel among the kept ones, or -1
        self._kept: dict[Sides, tuple[FloatArray, FloatArray, Float32Array]] = {}

    def take(self, wanted: BoolArray, sides: Sides, sums: PixelSums) -> None:
        """Do as `PixelSampler.take` does."""
        if sides not in self._rows:
            self._rows[sides] = np.full(self._n_pixels, -1, dtype=np.int32)
            self._kept[sides] = np.empty((0, 4)), np.empty((0, 4)), np.empty(0, np.float32)
        pixels = np.flatnonzero(wanted)
        is_new = self._rows[sides][pixels] < 0
        self._put(pixels[~is_new], sides, sums)
        if is_new.any():
            new = np.zeros(self._n_pixels, np.bool_)
            new[pixels[is_new]] = True
            self._sampler.take(new.reshape(wanted.shape), sides, sums)
            self._keep(pixels[is_new], sides, sums)

    def _put(self, pixels: Int64Array, sides: Sides, sums: PixelSums) -> None:
        """Write the sums of some pixels that are kept."""
        rows = self._rows[sides][pixels]
        light, squares, covered = self._kept[sides]
        sums.light.reshape(-1, 4)[pixels] = light[rows]
        sums.squares.reshape(-1, 4)[pixels] = squares[rows]
        sums.covered.reshape(-1)[pixels] = covered[rows]
        sums.counts.reshape(-1)[pixels] = sides.seen**2

    def _keep(self, pixels: Int64Array, sides: Sides, sums: PixelSums) -> None:
        light, squares, covered = self._kept[sides]
        self._rows[sides][pixels] = np.arange(len(light), len(light) + len(pixels), dtype=np.int32)
        self._kept[sides] = (
            np.concatenate([light, sums.light.reshape(-1, 4)[pixels]]),
            np.concatenate([squares, sums.squares.reshape(-1, 4)[pixels]]),
            np.concatenate([covered, sums.covered.reshape(-1)[pixels]]),
        )
