"""A map as values, and how it becomes the numbers of a file, in any coding, as often as needed."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.bake.maps.kind import MapKind
from texbake.bake.options import BakeOptions
from texbake.files import PathLike
from texbake.metadata import CONVENTION, DISPLACEMENT_MID, DISPLACEMENT_SCALE, SPACE, Value
from texbake.texture.encoding import count_clipped, encode_heights, encode_normals, height_range
from texbake.texture.image import write_image
from texbake.texture.image_formats import check_image_format, holds_floats


@dataclass(frozen=True)
class WrittenMap:
    """What `BakedMap.write` wrote.

    Attributes
    ----------
    path : Path
    bits : int
        A channel.
    metadata : dict
        What the file says of itself: space, convention, mid level and scale.
    n_clipped : int
        Values that the mid level and scale asked for cannot hold; 0 where they were measured.
    """

    path: Path
    bits: int
    metadata: dict[str, Value] = field(default_factory=dict)
    n_clipped: int = 0


@dataclass(frozen=True, eq=False)
class BakedMap:
    """One map of a bake, as values and not yet as the numbers of a file.

    Attributes
    ----------
    kind : MapKind
    values : (H, W, C) float32
        Unit vectors or lengths in model units; the neutral value where nothing was baked.
    has_data : (H, W) bool
        Texels with a hit; their values span the range of heights.
    options : BakeOptions
        Space, convention, bits, mid and scale are taken from here where `write` is not told.
    """

    kind: MapKind
    values: npt.NDArray[np.float32]
    has_data: npt.NDArray[np.bool_]
    options: BakeOptions

    def write(
        self,
        path: PathLike,
        *,
        bits: int | None = None,
        convention: str | None = None,
        mid: float | None = None,
        scale: float | None = None,
    ) -> WrittenMap:
        """Write the map; the format is that of the suffix.

        Parameters
        ----------
        path
            png, exr, tif or tga.
        bits
            8, 16 or 32 a channel; None: the options', else the most the format holds.
        convention
            `opengl` or `directx`; None: the options'.
        mid, scale
            Coding of lengths as d = (h - mid) * scale. None: the options', else, in integer files,
            measured so that every height fits; float files then hold lengths as they are.

        Raises
        ------
        OptionError, FileError
        """
        bits = check_image_format(
            path, bits or self.options.bits, channels=self.kind.channels, lossless=True
        )
        code_bits = 32 if holds_floats(path, bits) else bits
        n_clipped = 0
        if self.kind.coding == "normal":
            pixels, metadata = self._coded_normals(code_bits, convention)
        else:
            mid, scale = self._coding(code_bits, mid, scale)
            pixels, metadata = self._coded_lengths(code_bits, mid, scale)
            n_clipped = 0 if code_bits == 32 else self._count_clipped(mid, scale)
        write_image(pixels, path, bits=bits, metadata=metadata, threads=self.options.threads)
        return WrittenMap(Path(path), bits, metadata, n_clipped)

    def _coded_normals(
        self, bits: int, convention: str | None
    ) -> tuple[npt.NDArray[Any], dict[str, Value]]:
        convention = convention or self.options.convention
        pixels = encode_normals(
            self.values, bits=bits, convention=convention, threads=self.options.threads
        )
        return pixels, {SPACE: self.options.space, CONVENTION: convention}

    def _coded_lengths(
        self, bits: int, mid: float, scale: float
    ) -> tuple[npt.NDArray[Any], dict[str, Value]]:
        pixels = encode_heights(
            self.values, bits=bits, mid=mid, scale=scale, threads=self.options.threads
        )
        metadata: dict[str, Value] = {DISPLACEMENT_MID: mid, DISPLACEMENT_SCALE: scale}
        if self.kind.coding == "vector":
            metadata[SPACE] = self.options.space
        return pixels, metadata

    def _coding(self, bits: int, mid: float | None, scale: float | None) -> tuple[float, float]:
        """Mid level and scale of a file: what was asked for, the rest measured."""
        mid = self.options.mid if mid is None else mid
        scale = self.options.scale if scale is None else scale
        if bits == 32:
            return mid or 0.0, 1.0 if scale is None else scale
        if mid is None or scale is None:
            measured = height_range(self.values, self._covered(), bits=bits, mid=mid)
            return measured[0], measured[1] if scale is None else scale
        return mid, scale

    def _count_clipped(self, mid: float, scale: float) -> int:
        return count_clipped(self.values, self._covered(), mid=mid, scale=scale)

    def _covered(self) -> npt.NDArray[np.bool_]:
        """(H, W, C) bool: values with data."""
        return np.broadcast_to(self.has_data[:, :, np.newaxis], self.values.shape)
