"""Samples of some pixels of a picture: as fine as is wanted in what they see and what is shaded.

A pixel has `sides.seen` x `sides.seen` samples, of which each sees one triangle, and is divided
into `sides.shaded` x `sides.shaded` cells, in each of which every triangle is shaded once, in the
middle of the samples that see it, as `texbake.rendering.raster.fragments` does it for whole pixels.
So an edge costs many samples and few shadings, a sharp highlight few samples and many shadings.
How much of a texture a shading covers is that of a whole pixel at any fineness, so that all samples
of a pixel look at one and the same picture.

The picture is taken in windows, strips of it as wide as the pixels that are wanted, so that memory
is bounded however many samples they have.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from texbake.kernels import kernel
from texbake.mesh.mesh import IntArray
from texbake.parallel import run_bands
from texbake.rendering.draw import behind_surfaces
from texbake.rendering.effects.transparency import put_behind
from texbake.rendering.picture import Picture
from texbake.rendering.pixel_sums import Float32Array, PixelSums
from texbake.rendering.raster.fragments import FragmentRows, fragment_rows
from texbake.rendering.raster.visibility import Visibility
from texbake.rendering.seen import find_visibility
from texbake.rendering.shaded import shaded_objects
from texbake.rendering.windows import Window, WindowCamera, windows

BoolArray = npt.NDArray[np.bool_]

# Cells shaded together by one thread, as `texbake.rendering.draw` has it.
_CELLS = 1 << 15


@dataclass(frozen=True, order=True)
class Sides:
    """How finely a pixel is looked at, along one side; `shaded` divides `seen`."""

    seen: int
    shaded: int


class PixelSampler:
    """Takes samples of pixels.

    Parameters
    ----------
    picture
        By `texbake.rendering.draw.laid_out`, with all objects ready.

    Attributes
    ----------
    is_opaque : bool
        Whether something shows behind all surfaces; then the opacity of every sample is 1.
    n_shaded : int
        Cells shaded so far, of pixels that show a surface; one with an edge in it counts once.
    n_windows : int
        Windows that have been rasterized.
    seconds : float
        Wall-clock time that all of this took.
    """

    def __init__(self, picture: Picture) -> None:
        self._picture = picture
        self._behind = _behind_all(picture)
        self.is_opaque = self._behind is not None
        self._has_layers = picture.plan.has("layers")
        self.n_shaded = 0
        self.n_windows = 0
        self.seconds = 0.0

    def take(self, wanted: BoolArray, sides: Sides, sums: PixelSums) -> None:
        """Sample pixels anew; what they had is forgotten.

        Parameters
        ----------
        wanted : (H, W) bool
        sides
            How finely.
        sums
            Gets the sums of the pixels that are wanted, in place.
        """
        start = time.perf_counter()
        sums.counts[wanted] = sides.seen**2
        for window in windows(wanted, sides.seen):
            self.n_windows += 1
            self._take_window(window, wanted, sides, sums)
        n_shown = int(np.count_nonzero(wanted & (sums.covered > 0.0)))
        self.n_shaded += n_shown * sides.shaded**2
        self.seconds += time.perf_counter() - start

    def _take_window(
        self, window: Window, wanted: BoolArray, sides: Sides, sums: PixelSums
    ) -> None:
        mask = np.ascontiguousarray(wanted[window.top : window.bottom, window.left : window.right])
        layers = self._seen(window, mask, sides)
        rows, columns = window.shape
        found = PixelSums.empty(rows, columns)
        n_cells = int(np.count_nonzero(mask)) * sides.shaded**2
        behind = self._behind_window(window)

        def work(start: int, stop: int) -> None:
            if self._has_layers:
                self._compose(layers, window, (start, stop), sides, found, behind)
            else:
                self._add(layers[0], window, (start, stop), sides, found)

        band = max(1, min(rows, rows * _CELLS // max(n_cells, 1)))
        run_bands(work, rows, band=band, threads=self._picture.threads)
        found.write_to(
            sums,
            (window.top, window.left),
            mask,
            None if self._has_layers else behind,
            side=sides.seen,
            is_opaque=self.is_opaque,
        )

    def _seen(self, window: Window, mask: BoolArray, sides: Sides) -> list[Visibility]:
        """What the wanted samples of a window see: transparent layers, then what is opaque."""
        picture = self._picture
        rows, columns = window.shape
        camera = picture.camera
        question = replace(
            picture.question,
            camera=WindowCamera(
                eye=camera.eye, axes=camera.axes, fov=camera.fov, near=camera.near,
                window=window, width=picture.options.width, height=picture.options.height,
            ),
            options=replace(
                picture.options, width=columns, height=rows, supersampling=sides.seen
            ),
        )  # fmt: skip
        part = replace(picture, question=question, values=dict(picture.values))
        found = [find_visibility(part)]
        for item in part.plan.passes:
            if item.name == "layers" and item.effect.prepare is not None:
                with picture.costs.timed(item.name):
                    found = [*item.effect.prepare(part, None).layers, *found]
        for visibility in found:
            _leave_kernel(visibility.face_ids, mask, sides.seen)
        return found

    def _fragments(
        self, visibility: Visibility, window: Window, rows: tuple[int, int], sides: Sides
    ) -> tuple[FragmentRows, IntArray]:
        """Fragments of some rows of a window, placed in the picture; and their pixels in it."""
        picture, fine = self._picture, sides.shaded
        with picture.costs.timed("fragments"):
            found = fragment_rows(
                visibility.face_ids,
                picture.world,
                (rows[0] * fine, rows[1] * fine),
                side=sides.seen // fine,
                wants_samples=self._has_layers,
            )
            columns = window.shape[1]
            down, right = np.divmod(found.pixels, np.int32(columns * fine))
            down, right = down // np.int32(fine), right // np.int32(fine)
            corner = np.array([window.left, window.top], np.float32)
            places = found.places / np.float32(fine) + corner
            whole = picture.options.width
            pixels = (down + np.int32(window.top)) * np.int32(whole) + right + np.int32(window.left)
        return replace(found, places=places, pixels=pixels), down * np.int32(columns) + right

    def _add(
        self,
        visibility: Visibility,
        window: Window,
        rows: tuple[int, int],
        sides: Sides,
        found: PixelSums,
    ) -> None:
        """Add opaque fragments to their pixels."""
        fragments, places = self._fragments(visibility, window, rows, sides)
        first = 0
        for shaded in shaded_objects(self._picture, None, fragments):
            with self._picture.costs.timed("pixels"):
                found.add(places[first : first + len(shaded)], shaded.counts, shaded.light)
            first += len(shaded)

    def _compose(
        self,
        layers: list[Visibility],
        window: Window,
        rows: tuple[int, int],
        sides: Sides,
        found: PixelSums,
        behind: Float32Array,
    ) -> None:
        """Put the layers behind one another at each sample, and add the samples to their pixels."""
        side = sides.seen
        shape = (rows[1] - rows[0]) * side, window.shape[1] * side
        light, passed = np.zeros((*shape, 3), np.float32), np.ones(shape, np.float32)
        covered, normals = np.zeros(shape, np.bool_), np.empty((0, 0, 3), np.float32)
        for layer in layers:
            fragments, _ = self._fragments(layer, window, rows, sides)
            put_behind(
                self._picture, fragments.of_samples,
                shaded_objects(self._picture, None, fragments),
                light, passed, normals, covered, opaque=layer is layers[-1],
            )  # fmt: skip
        with self._picture.costs.timed("pixels"):
            found.add_samples(light, passed, covered, behind, rows[0], side)

    def _behind_window(self, window: Window) -> Float32Array:
        """(h, w, 3) or (1, 1, 3): light behind surfaces in a window; 0 where nothing shows."""
        behind = self._behind
        if behind is None:
            return np.zeros((1, 1, 3), np.float32)
        if behind.ndim == 1:
            return np.ascontiguousarray(behind.reshape(1, 1, 3))
        here = behind[window.top : window.bottom, window.left : window.right]
        return np.ascontiguousarray(here)


def _behind_all(picture: Picture) -> Float32Array | None:
    """What shows behind surfaces, at every pixel: any may have a sample that sees it."""
    for item in picture.plan.passes:
        if item.effect.behind is not None and item.effect.prepare is not None:
            shape = picture.options.height, picture.options.width
            nothing = Visibility(np.full(shape, -1, np.int32), np.zeros(shape, np.float32))
            options = replace(picture.options, supersampling=1)
            question = replace(picture.question, options=options)
            values = {**picture.values, ("visibility", None): nothing}
            empty = replace(picture, question=question, values=values)
            with picture.costs.timed(item.name):
                values[item.name, None] = item.effect.prepare(empty, None)
            return behind_surfaces(empty)
    return behind_surfaces(picture)


@kernel
def _leave_kernel(face_ids, mask, side):  # type: ignore[no-untyped-def]
    """Let samples of pixels that are not wanted see nothing."""
    for row in range(mask.shape[0]):
        for column in range(mask.shape[1]):
            if not mask[row, column]:
                for j in range(row * side, (row + 1) * side):
                    for i in range(column * side, (column + 1) * side):
                        face_ids[j, i] = -1
