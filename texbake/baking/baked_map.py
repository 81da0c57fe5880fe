"""A map as values, and how it becomes the numbers of a file, in any coding, as often as needed."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from texbake.baking.codings import (
    FLOAT,
    Request,
    code,
    file_bits,
)
from texbake.baking.maps.kind import MapKind
from texbake.baking.options import BakeOptions
from texbake.files import PathLike
from texbake.mesh.mesh import FloatArray
from texbake.metadata import Value
from texbake.texture.image import write_image
from texbake.texture.image_formats import holds_floats


@dataclass(frozen=True)
class WrittenMap:
    """What `BakedMap.write` wrote.

    Attributes
    ----------
    path : Path
    bits : int
        A channel.
    metadata : dict
        What the file says of itself: space, convention, mid level and scale, names of numbers.
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
        Unit vectors, lengths in model units, or what else the kind says; the neutral value where
        nothing was baked.
    has_data : (H, W) bool
        Texels with a hit; their values span the range of heights.
    options : BakeOptions
        Space, convention, bits, mid and scale are taken from here where `write` is not told.
    bounds : (2, 3) float64, optional
        Of positions: the least and greatest that integer files hold.
    legend : tuple of str
        What numbers from 1 on stand for, in maps of such.
    """

    kind: MapKind
    values: npt.NDArray[np.float32]
    has_data: npt.NDArray[np.bool_]
    options: BakeOptions
    bounds: FloatArray | None = None
    legend: tuple[str, ...] = ()

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
            8, 16 or 32 a channel; None: the options', else what `file_bits` says.
        convention
            `opengl` or `directx`; None: the options'.
        mid, scale
            Coding of lengths as d = (h - mid) * scale. None: the options', else, in integer files,
            measured so that every height fits; float files then hold lengths as they are.

        Raises
        ------
        OptionError, FileError
        """
        bits = file_bits(self.kind, path, bits or self.options.bits, len(self.legend))
        code_bits = FLOAT if holds_floats(path, bits) else bits
        coded = code(self, Request(code_bits, convention, mid, scale))
        write_image(
            coded.pixels,
            path,
            color=self.kind.coding == "color",
            bits=bits,
            metadata=coded.metadata,
            threads=self.options.threads,
        )
        return WrittenMap(Path(path), bits, coded.metadata, coded.n_clipped)

    @property
    def covered(self) -> npt.NDArray[np.bool_]:
        """(H, W, C) bool: values with data."""
        return np.broadcast_to(self.has_data[:, :, np.newaxis], self.values.shape)
