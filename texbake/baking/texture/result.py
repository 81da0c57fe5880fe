"""The result of a texture bake: the texture with its padding, a report, and warnings."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.baking.result import classes_picture
from texbake.baking.texture.options import TextureBakeOptions
from texbake.errors import counted
from texbake.files import PathLike
from texbake.progress import StageRecord
from texbake.texture.image import write_image

Float32Array = npt.NDArray[np.float32]


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
    texel_faces: npt.NDArray[np.int32]
    # (H, W) bool: covered texels that have a value of their own, before padding and filling
    has_color: npt.NDArray[np.bool_]
    report: TextureReport

    @cached_property
    def unseen(self) -> npt.NDArray[np.bool_]:
        """(H, W) bool: texels that the mesh covers but no photograph shows."""
        return (self.texel_faces >= 0) & ~self.has_color

    def unseen_map(self) -> npt.NDArray[np.uint8]:
        """(H, W, 3) uint8 picture: gray outside the charts, green where seen, red where unseen."""
        return classes_picture(self.texel_faces, self.unseen)

    def write(self, path: PathLike, *, color: bool = True, bits: int | None = None) -> None:
        """Write the texture to an image file.

        `color`: true for colors, which integer files store with the sRGB curve.
        """
        threads = self.report.options.threads
        write_image(self.values, path, color=color, bits=bits, threads=threads)
