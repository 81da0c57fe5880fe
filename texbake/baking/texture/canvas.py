"""The texture of a mesh, filled band by band, padded and reported."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict
from functools import cached_property
from typing import Any

import numpy as np

from texbake.baking.result import classes_picture
from texbake.baking.texel_values import ChartPadding
from texbake.baking.texels import (
    NO_FACE,
    SampleGrid,
    TexelBand,
    owned_bands,
    snap_uvs,
    texel_charts_of,
)
from texbake.baking.texture.options import TextureBakeOptions
from texbake.core import portable_math as pm
from texbake.errors import UvError, counted
from texbake.files import PathLike
from texbake.mapping.seams import chart_ids
from texbake.mesh.mesh import BoolArray, ByteArray, Float32Array, FloatArray, IntArray, Mesh
from texbake.progress import Progress, StageRecord, Stages
from texbake.records import dataclass
from texbake.texture.image import write_image
from texbake.texture.lookup import texel_coordinates
from texbake.texture.padding import push_pull


@dataclass(frozen=True)
class PhotoShare:
    """How much of the texture one photograph contributes."""

    name: str
    texels_seen: int  # texels that the photograph shows, with any weight
    percent: float  # its share of the weight in all texels that are seen


@dataclass(frozen=True)
class TextureReport:
    """Figures of one texture bake."""

    mesh: str
    n_faces: int
    options: TextureBakeOptions
    source: str  # name of the procedure, or number of photographs
    # factor that positions were multiplied by for a procedure
    scale: tuple[float, float, float] | None
    # texels of the texture, those that the mesh covers, and those among them that no photograph
    # shows
    texels: int
    texels_covered: int
    texels_unseen: int
    texels_overlapping: float  # samples that several faces cover, in texels; the first face wins
    faces_outside_tile: int  # faces with a corner outside the unit square
    padding_meets: int  # texels where the padding of two charts meets
    photos: tuple[PhotoShare, ...]
    stages: tuple[StageRecord, ...]

    @property
    def unseen_percent(self) -> float:
        """Unseen texels in percent of the covered ones."""
        return 100.0 * self.texels_unseen / max(self.texels_covered, 1)

    @property
    def seconds(self) -> float:
        """Time of all stages."""
        return sum(stage.seconds for stage in self.stages)

    @property
    def warnings(self) -> list[str]:
        """Problems that a user should check, one sentence each."""
        filled = (
            "filled from the colors around them"
            if self.options.fill == "push-pull"
            else "left black"
        )
        checks = [
            (
                self.texels_unseen,
                f"no photograph shows {counted(self.texels_unseen, 'texel')} "
                f"({self.unseen_percent:.2f} %), {filled}; see them with `unseen_map`",
            ),
            (
                self.texels_overlapping,
                "texture coordinates overlap on "
                f"{counted(round(self.texels_overlapping), 'texel')}; the first face wins",
            ),
            (
                self.faces_outside_tile,
                counted(self.faces_outside_tile, "face extends", "faces extend")
                + " outside the unit square; the parts outside are not baked",
            ),
            (
                self.padding_meets,
                f"the padding of two charts meets on {counted(self.padding_meets, 'texel')}; "
                "use less `padding` or leave more room between charts",
            ),
        ]
        checks += [
            (photo.texels_seen == 0, f"{photo.name}: it shows no texel; check its camera")
            for photo in self.photos
        ]
        return [message for count, message in checks if count]

    def table(self) -> list[tuple[str, str]]:
        """Rows of a label and a figure, to print."""
        options = self.options
        size = f"{options.width_px} x {options.height_px}, {counted(options.samples, 'sample')}"
        rows = [("texture", f"{self.source} onto {counted(self.n_faces, 'face')}"), ("size", size)]
        if self.scale is not None:
            scale = self.scale if len(set(self.scale)) > 1 else self.scale[:1]
            rows.append(("scale", ",".join(f"{factor:.6g}" for factor in scale)))
        rows += [
            ("texels covered", f"{self.texels_covered:,} of {self.texels:,}"),
            ("texels unseen", f"{self.texels_unseen:,} ({self.unseen_percent:.2f} %)"),
        ]
        photos = [
            (
                f"  {photo.name}",
                f"{counted(photo.texels_seen, 'texel')}, {photo.percent:.1f} % of the color",
            )
            for photo in self.photos
        ]
        return [*rows, *photos]

    def to_json(self) -> dict[str, Any]:
        """All figures as plain values for `json.dump`."""
        return {
            **asdict(self),
            "unseen_percent": self.unseen_percent,
            "seconds": self.seconds,
            "warnings": self.warnings,
        }


@dataclass(frozen=True, eq=False)
class TextureBake:
    """A baked texture."""

    values: Float32Array  # (H, W, C) float32: linear values, padded and filled
    # (H, W) int32: face of the mesh that owns each texel, -1 for none
    texel_faces: IntArray
    # (H, W) bool: covered texels that have a value of their own, before padding and filling
    has_color: BoolArray
    report: TextureReport

    @cached_property
    def unseen(self) -> BoolArray:
        """(H, W) bool: texels that the mesh covers but no photograph shows."""
        return (self.texel_faces >= 0) & ~self.has_color

    def unseen_map(self) -> ByteArray:
        """(H, W, 3) uint8 picture: gray outside the charts, green where seen, red where unseen."""
        return classes_picture(self.texel_faces, self.unseen)

    def write(self, path: PathLike, *, color: bool = True, bits: int | None = None) -> None:
        """Write the texture to an image file; integers are stored as sRGB if it is a `color`."""
        write_image(self.values, path, color=color, bits=bits, threads=self.report.options.threads)


# About 200 bytes each while photographs are looked up.
_SAMPLES_AT_ONCE = 1 << 19


class TextureCanvas:
    """The texels that a mesh covers, and the values that they get, band by band."""

    def __init__(
        self, mesh: Mesh, options: TextureBakeOptions, n_channels: int, progress: Progress = None
    ) -> None:
        self.stages = Stages(progress)
        self._mesh, self._options = mesh, options
        self.grid = SampleGrid(options.width_px, options.height_px, math.isqrt(options.samples))
        self._faces = snap_uvs(mesh, self.grid)
        shape = self.grid.height, self.grid.width
        # Face that owns the first sample of each texel, `NO_FACE` for none; filled by `bands`.
        self.texel_faces: IntArray = np.full(shape, NO_FACE, dtype=np.int32)
        self._values: Float32Array = np.zeros((*shape, n_channels), np.float32)
        self._has_color = np.zeros(shape, np.bool_)
        self._n_overlapping = 0

    def bands(self) -> Iterator[TexelBand]:
        """Yield the texels with their samples from the top down, as the stage "bake"."""
        for band in owned_bands(
            self._faces,
            self.grid,
            self.stages,
            samples_at_once=_SAMPLES_AT_ONCE,
            threads=self._options.threads,
        ):
            band.note_faces(self.texel_faces)
            self._n_overlapping += band.n_overlaps
            yield band

    def put(self, band: TexelBand, values: FloatArray, chosen: BoolArray) -> None:
        """Give values (n, C) to the chosen (n,) of all texels of a band."""
        rows = slice(band.rows.start, band.rows.stop)
        self._values[rows].reshape(len(chosen), -1)[chosen] = values[chosen]
        self._has_color[rows] = chosen.reshape(-1, band.width)

    def finish(
        self,
        source: str,
        scale: tuple[float, float, float] | None = None,
        photos: tuple[PhotoShare, ...] = (),
    ) -> TextureBake:
        """Fill the unseen texels, pad the charts, and sum up the report."""
        mesh, options, faces = self._mesh, self._options, self.texel_faces
        covered, has_color = faces != NO_FACE, self._has_color
        if not covered.any():
            raise UvError(
                f"{mesh.name}: its texture coordinates cover no texel of a "
                f"{options.width_px} x {options.height_px} texture; use a larger `size`"
            )
        n_unseen = int(np.count_nonzero(covered & ~has_color))
        values, known = self._values, has_color
        with self.stages.stage("pad"):
            if n_unseen and options.fill == "push-pull":
                filled = push_pull(values, has_color, threads=options.threads)
                values = np.where(covered[..., None], filled, values)
                known = covered
            charts = texel_charts_of(chart_ids(mesh), faces, options.threads)
            padding = ChartPadding(charts, known, options)
            values = padding.pad(values, (0.0,) * values.shape[2])
        report = TextureReport(
            mesh=mesh.name,
            n_faces=mesh.n_faces,
            options=options,
            source=source,
            scale=scale,
            texels=faces.size,
            texels_covered=int(np.count_nonzero(covered)),
            texels_unseen=n_unseen,
            texels_overlapping=self._n_overlapping / options.samples,
            faces_outside_tile=self._faces.n_outside_tile,
            padding_meets=padding.n_meeting,
            photos=photos,
            stages=tuple(self.stages.records),
        )
        return TextureBake(values, faces, has_color, report)


def sample_steps(mesh: Mesh, corner_values: FloatArray, grid: SampleGrid) -> FloatArray:
    """(F, K, 2) change of corner values (F, 3, K) per sample right and down; 0 without area."""
    texels = texel_coordinates(mesh.corner_uvs(), grid.n_columns, grid.n_rows)
    along = corner_values[:, 1] - corner_values[:, 0]
    aside = corner_values[:, 2] - corner_values[:, 0]
    a, b = texels[:, 1] - texels[:, 0], texels[:, 2] - texels[:, 0]
    with np.errstate(over="ignore", invalid="ignore"):
        area = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
        flat = area == 0.0
        area[flat] = 1.0
        right = (along * b[:, 1:] - aside * a[:, 1:]) / area[:, None]
        down = (aside * a[:, :1] - along * b[:, :1]) / area[:, None]
    steps = np.stack([right, down], axis=2)
    steps[flat | ~np.isfinite(steps).all(axis=(1, 2))] = 0.0
    return steps


def greatest_lengths(steps: FloatArray) -> FloatArray:
    """(F,) greatest distance per sample over all directions, by `sample_steps` (F, 3, 2)."""
    a = pm.vecdot(steps[:, :, 0], steps[:, :, 0])
    b = pm.vecdot(steps[:, :, 0], steps[:, :, 1])
    c = pm.vecdot(steps[:, :, 1], steps[:, :, 1])
    return np.asarray(np.sqrt((a + c + pm.hypot(a - c, 2.0 * b)) / 2.0))
