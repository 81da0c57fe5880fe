"""What a bake gives back: maps that can be written in any coding, the hits, and the report."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt

from texbake.bake.hits import Hits
from texbake.bake.maps.kind import MapKind
from texbake.bake.options import BakeOptions
from texbake.bake.report import BakeReport
from texbake.errors import OptionError
from texbake.files import PathLike
from texbake.metadata import CONVENTION, DISPLACEMENT_MID, DISPLACEMENT_SCALE, SPACE
from texbake.texture.encoding import count_clipped, encode_heights, encode_normals, height_range
from texbake.texture.image import check_image_format, write_image

# Colors of the miss map: not covered, covered and hit, covered and missed.
_MISS_COLORS = np.array([[24, 24, 28], [70, 110, 70], [255, 40, 60]], dtype=np.uint8)


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
    ) -> Mapping[str, float | int | str]:
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
            Coding of lengths as d = (h - mid) * scale in integer files; float files hold lengths as
            they are unless one of the two is given. None: the options', else measured.

        Returns
        -------
        mapping
            What the file's metadata says: space, convention, mid, scale.

        Raises
        ------
        OptionError, FileError
        """
        bits = check_image_format(path, bits or self.options.bits, channels=self.kind.channels)
        threads = self.options.threads
        if self.kind.coding == "normal":
            convention = convention or self.options.convention
            metadata: dict[str, float | int | str] = {
                SPACE: self.options.space,
                CONVENTION: convention,
            }
            float_file = bits == 32 or Path(path).suffix.lower() == ".exr"
            pixels = encode_normals(
                self.values, bits=32 if float_file else bits, convention=convention, threads=threads
            )
        else:
            pixels, metadata = self._coded_lengths(path, bits, mid, scale)
        write_image(pixels, path, bits=bits, metadata=metadata, threads=threads)
        return metadata

    def _coded_lengths(
        self, path: PathLike, bits: int, mid: float | None, scale: float | None
    ) -> tuple[npt.NDArray[np.generic], dict[str, float | int | str]]:
        mid = self.options.mid if mid is None else mid
        scale = self.options.scale if scale is None else scale
        is_float = bits == 32 or Path(path).suffix.lower() == ".exr"
        if is_float and mid is None and scale is None:
            mid, scale = 0.0, 1.0
        else:
            mid, scale = self.coding(bits=8 if bits == 8 else 16, mid=mid, scale=scale)
        metadata: dict[str, float | int | str] = {
            DISPLACEMENT_MID: mid,
            DISPLACEMENT_SCALE: scale,
        }
        if self.kind.coding == "vector":
            metadata[SPACE] = self.options.space
        threads = self.options.threads
        bits = 32 if is_float else bits
        pixels = encode_heights(self.values, bits=bits, mid=mid, scale=scale, threads=threads)
        return pixels, metadata

    def coding(
        self, *, bits: int = 16, mid: float | None = None, scale: float | None = None
    ) -> tuple[float, float]:
        """Mid and scale that an integer file gets: what is given, the rest measured."""
        covered = np.repeat(self.has_data[:, :, np.newaxis], self.kind.channels, axis=2)
        measured_mid, measured_scale = (
            height_range(self.values, covered, bits=bits, mid=mid)
            if scale is None
            else (height_range(self.values, ~covered & covered, bits=bits, mid=mid)[0], scale)
        )
        return measured_mid, measured_scale

    def n_clipped(self, mid: float, scale: float) -> int:
        """Values with data that lie outside of what integer codes hold with this mid and scale."""
        if self.kind.coding == "normal":
            return 0
        covered = np.repeat(self.has_data[:, :, np.newaxis], self.kind.channels, axis=2)
        return count_clipped(self.values, covered, mid=mid, scale=scale)


@dataclass(frozen=True, eq=False)
class BakeResult:
    """Everything that `bake` made.

    Attributes
    ----------
    maps : dict of str to BakedMap
        By the names that were asked for.
    report : BakeReport
    hits : Hits or None
        The trace, with `BakeOptions.keep_hits`; `remap` makes other maps of it.
    texel_faces : (H, W) int32
        Face of the light mesh that owns each texel, -1 for none.
    has_data : (H, W) bool
        Texels with a hit.
    """

    maps: dict[str, BakedMap]
    report: BakeReport
    hits: Hits | None
    texel_faces: npt.NDArray[np.int32]
    has_data: npt.NDArray[np.bool_]

    @cached_property
    def missed(self) -> npt.NDArray[np.bool_]:
        """(H, W) bool: texels that the light mesh covers and no ray hit."""
        return (self.texel_faces >= 0) & ~self.has_data

    def miss_map(self) -> npt.NDArray[np.uint8]:
        """(H, W, 3) uint8 picture: gray outside the charts, green for hits, red for misses."""
        classes = (self.texel_faces >= 0).astype(np.intp) + self.missed
        return _MISS_COLORS[classes]

    def write(self, path: PathLike, *, suffix: str = ".png") -> list[Path]:
        """Write the maps: one map to a file, or all into a folder as NAME + suffix.

        Parameters
        ----------
        path
            A file if it has a suffix, which then wants exactly one map; else a folder, made if
            it is missing.

        Returns
        -------
        list of Path
            The files written.
        """
        target = Path(path)
        if target.suffix and not target.is_dir():
            if len(self.maps) != 1:
                raise OptionError(
                    f"{path}: it is one file for {len(self.maps)} maps; give the name of a folder"
                )
            paths = [target]
        else:
            target.mkdir(parents=True, exist_ok=True)
            paths = [target / f"{name}{suffix}" for name in self.maps]
        for map_path, baked in zip(paths, self.maps.values(), strict=True):
            baked.write(map_path)
        return paths
