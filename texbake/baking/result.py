"""What a bake gives back: maps that can be written in any coding, the hits, and the report."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt

from texbake.baking.baked_map import BakedMap
from texbake.baking.hits import Hits
from texbake.baking.inputs import BakeInputs
from texbake.baking.report import BakeReport
from texbake.errors import OptionError
from texbake.files import PathLike, make_folder
from texbake.texture.image import read_image

# Colors of the miss map: not covered, covered and hit, covered and missed.
_MISS_COLORS = np.array([[24, 24, 28], [70, 110, 70], [255, 40, 60]], dtype=np.uint8)


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
    inputs : BakeInputs or None
        What the maps were made from beside the hits, where those are kept.
    """

    maps: dict[str, BakedMap]
    report: BakeReport
    hits: Hits | None
    texel_faces: npt.NDArray[np.int32]
    has_data: npt.NDArray[np.bool_]
    inputs: BakeInputs | None = None

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
            make_folder(target)
            paths = [target / f"{name}{suffix}" for name in self.maps]
        for map_path, baked in zip(paths, self.maps.values(), strict=True):
            baked.write(map_path)
        return paths


def read_misses(path: PathLike) -> npt.NDArray[np.bool_]:
    """(H, W): the texels of a miss map's file that missed.

    Raises
    ------
    FileError
        It cannot be read.
    """
    # Of the three colors only that of misses has much red.
    return np.asarray(read_image(path, color=False).pixels[..., 0] > 0.5, dtype=np.bool_)
