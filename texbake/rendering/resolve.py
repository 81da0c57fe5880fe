"""Resolving samples: averaging the samples of each pixel over the background, into a frame.

docs/explanation/rendering.md says how a picture in texbake's built-in light is exposed. That comes
after shading, in linear light, and leaves the background. Adaptive samples estimate the error of
light up to white, and exposure does not increase it.

Based on: Khronos Group, "Khronos PBR Neutral Tone Mapper", 2024, without its offset.

Kernel: `core/compositing.c`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, field, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from texbake.core import core
from texbake.errors import OptionError
from texbake.files import PathLike
from texbake.mesh.mesh import BoolArray, Float32Array, IntArray
from texbake.parallel import run_bands
from texbake.records import dataclass
from texbake.rendering.effect import Plan
from texbake.rendering.fragments import Fragments
from texbake.rendering.options import RenderOptions
from texbake.rendering.rasterize import VisibilityBuffer
from texbake.rendering.results import Costs
from texbake.sampling.report import SamplingReport
from texbake.sampling.rounds import TimeBudget
from texbake.texture.encoding import decode_srgb, encode_srgb
from texbake.texture.image import FloatImage, write_image

# Rows of pixels per band.
_BAND = 16


@dataclass(frozen=True)
class TexelReport:
    """What became of the texels of a picture in texture order."""

    texels: int  # texels whose center lies in a triangle
    hidden: int  # those that face away or lie behind another surface
    outside: int  # those beside the picture or behind the camera
    pixels: int  # pixels whose middle shows a textured surface
    gaps: int  # those of them that no texel reached
    double_writes: int  # pixels that more than one texel reached

    def table(self) -> list[tuple[str, str]]:
        """Return rows of a label and a value."""
        share = f" ({100.0 * self.gaps / self.pixels:.1f} %)" if self.pixels else ""
        return [
            ("texels", f"{self.texels:,}, {self.hidden:,} hidden, {self.outside:,} outside"),
            ("textured pixels", f"{self.pixels:,}"),
            ("gaps", f"{self.gaps:,}{share}"),
            ("written more than once", f"{self.double_writes:,}"),
        ]


@dataclass(frozen=True, kw_only=True, eq=False)
class Frame:
    """A rendered picture with its data; row 0 is at the top."""

    # (H, W, 4) float32: linear light and opacity. With a background the opacity is 1. Without one
    # it is the coverage, and the color is not premultiplied.
    color: FloatImage
    coverage: FloatImage  # (H, W) float32: share of the pixel's samples that see a surface
    plan: Plan  # passes that were run
    costs: Costs  # time and memory of the passes
    _visibility: VisibilityBuffer | None  # None without samples
    _near: float
    _normals: FloatImage | None = field(default=None)
    sampling: SamplingReport | None = None  # report on adaptive samples, if the options use them
    budget: TimeBudget | None = None  # report on the time budget, if there was one
    texels: TexelReport | None = None  # counts of the texels, for pictures in texture order
    # factor of the light, if the picture was exposed; see `texbake.rendering.resolve`
    exposure: float | None = None

    @property
    def height(self) -> int:
        """Number of rows."""
        return len(self.color)

    @property
    def width(self) -> int:
        """Number of columns."""
        return len(self.color[0])

    @property
    def normals(self) -> FloatImage:
        """(H, W, 3) normalized mean of the unit shading normals in world space; 0 without any."""
        if self._normals is None:
            raise OptionError('frame: it has no normals; draw it with keep=("normals",)')
        return self._normals

    @cached_property
    def _nearest(self) -> tuple[IntArray, FloatImage]:
        assert self._visibility is not None
        side = len(self._visibility.face_ids) // self.height
        face_ids = np.full((self.height, self.width), -1, np.int32)
        depths = np.full((self.height, self.width), np.inf, np.float32)
        core.find_nearest(
            self._visibility.face_ids, self._visibility.depths, side, self._near, face_ids, depths
        )
        return face_ids, depths

    @property
    def face_ids(self) -> IntArray:
        """(H, W) nearest opaque triangle, numbered over all objects in scene order; -1 for none."""
        return self._nearest[0]

    @property
    def depths(self) -> FloatImage:
        """(H, W) float32: depth of that triangle in model units; infinite for none."""
        return self._nearest[1]

    def without_samples(self) -> Frame:
        """Return the frame with its pixels alone, which take less memory."""
        return replace(self, _visibility=None)

    def sampling_report(self) -> dict[str, Any]:
        """Return `sampling`, `budget` and `texels`, if present, as JSON values."""
        parts = {"sampling": self.sampling, "budget": self.budget, "texels": self.texels}
        return {name: asdict(part) for name, part in parts.items() if part is not None}

    def write(self, path: PathLike, *, threads: int | None = None) -> None:
        """Write the color to an image file, with an alpha channel unless every pixel is opaque."""
        opaque = bool((self.color[..., 3] == 1.0).all())
        write_image(
            self.color[..., :3] if opaque else self.color, path, color=True, threads=threads
        )


@dataclass(frozen=True, eq=False)
class Sums:
    """Sums over the samples of each pixel so far."""

    color: FloatImage  # (H, W, 4): sum of the light of the samples, and of their opacity
    coverage: FloatImage  # (H, W): number of samples that see a surface
    normals: FloatImage  # (H, W, 3): sum of the samples' normals; empty if they are not kept
    # Samples per pixel. Sums are divided only at the end, so that a fully covered pixel has a
    # coverage of exactly 1.
    n_samples: int

    @classmethod
    def empty(cls, height: int, width: int, *, n_samples: int, keeps_normals: bool) -> Sums:
        """Return sums without any fragments."""
        return cls(
            np.zeros((height, width, 4), np.float32),
            np.zeros((height, width), np.float32),
            np.zeros((height if keeps_normals else 0, width, 3), np.float32),
            n_samples,
        )

    @property
    def n_bytes(self) -> int:
        """Memory of the sums in bytes."""
        return self.color.nbytes + self.coverage.nbytes + self.normals.nbytes

    def add(self, fragments: Fragments) -> None:
        """Add opaque fragments to their pixels."""
        keeps_normals = len(self.normals) > 0 and len(fragments.normals) > 0
        core.add_fragments(
            fragments.pixels, fragments.counts, fragments.light,
            fragments.normals if keeps_normals else None,
            self.color.reshape(-1, 4), self.coverage.reshape(-1),
            self.normals.reshape(-1, 3) if keeps_normals else None,
        )  # fmt: skip

    def finish(
        self, behind: Float32Array | None, *, threads: int | None = None
    ) -> tuple[FloatImage, FloatImage, FloatImage | None]:
        """Divide by samples, in place; return color over `behind`, coverage and normals."""
        layer = np.zeros((1, 1, 3), np.float32)
        if behind is not None:
            layer = np.ascontiguousarray(behind.reshape(1, 1, 3) if behind.ndim == 1 else behind)

        normals = self.normals if len(self.normals) else None
        kernel = partial(
            core.finish_pixels, self.color, self.coverage, normals, float(self.n_samples), layer,
            behind is not None,
        )  # fmt: skip
        run_bands(kernel, len(self.color), band=_BAND, threads=threads)
        return self.color, self.coverage, normals


def picture_error(picture: FloatImage, truth: FloatImage, where: BoolArray | None = None) -> float:
    """Root mean square difference of linear pictures in the 255 steps of an 8-bit screen."""
    difference = 255.0 * (
        encode_srgb(picture[..., :3]).astype(np.float64) - encode_srgb(truth[..., :3])
    )
    squares = np.square(difference).mean(axis=-1)
    return float(np.sqrt(squares.mean() if where is None else squares[where].mean()))


# Share of the surface that may be brighter than white before the picture is darkened.
_BRIGHT = 0.25


def expose(
    frames: Sequence[Frame],
    options: RenderOptions,
    *,
    exposure: float | None = None,
    threads: int | None = None,
) -> list[Frame]:
    """Return frames with exposed light, all with the same exposure."""
    if exposure is None:
        exposure = find_exposure(frames, threads=threads)
    found = []
    for frame in frames:
        color = frame.color.copy()
        behind, covered = None, frame.coverage
        if any(item.effect.behind is not None for item in frame.plan.passes):
            # A visible environment behind the surfaces is exposed with them.
            covered = np.ones_like(covered)
        elif options.background is not None:
            behind = decode_srgb(options.background).astype(np.float32)
        kernel = partial(core.expose_pixels, color, covered, behind, exposure)
        run_bands(kernel, frame.height, band=_BAND, threads=threads)
        found.append(replace(frame, color=color, exposure=exposure))
    return found


def find_exposure(frames: Sequence[Frame], *, threads: int | None = None) -> float:
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
    kernel = partial(core.count_bright, frame.color, frame.coverage, counts)
    run_bands(kernel, frame.height, band=_BAND, threads=threads)
    return np.asarray(counts.sum(axis=0))
