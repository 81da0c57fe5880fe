"""What a bake of many parts returns: the maps of each texture set and tile, ready to write."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from texbake.baking.codings import file_bits, usual_curvature
from texbake.baking.parts.low_parts import BakeTarget
from texbake.baking.parts.report import PartsReport
from texbake.baking.result import BakedMap, BakeResult, WrittenMap
from texbake.texture.image_formats import holds_floats
from texbake.texture.value_range import channel_ranges, height_range


@dataclass(frozen=True, eq=False)
class PartsResult:
    """Everything that `bake_parts` made.

    Attributes
    ----------
    targets : dict of BakeTarget to BakeResult
        The maps of each texture set and tile.
    report : PartsReport
    """

    targets: dict[BakeTarget, BakeResult]
    report: PartsReport

    def write(self, files: Mapping[BakeTarget, Mapping[str, Path]]) -> list[WrittenMap]:
        """Write the maps; integer files of one map share their levels.

        Parameters
        ----------
        files
            The file of each map, for each set of maps.

        Raises
        ------
        OptionError, FileError
        """
        written = []
        for name in next(iter(self.targets.values())).maps:
            maps = [result.maps[name] for result in self.targets.values()]
            paths = [files[target][name] for target in self.targets]
            bits = file_bits(maps[0].kind, paths[0], maps[0].options.bits, len(maps[0].legend))
            if not holds_floats(paths[0], bits):
                maps = with_common_levels(maps, bits)
            written += [baked.write(path) for baked, path in zip(maps, paths, strict=True)]
        return written


def with_common_levels(maps: Sequence[BakedMap], bits: int) -> list[BakedMap]:
    """Return maps of one kind with common levels, for integer files of 8 or 16 bits.

    Integer files hold heights, curvatures and thicknesses at a scale that is measured if it is not
    given. Measured map by map it would differ from tile to tile, while the program that reads them
    uses one for all. Other maps, and levels that were given, stay as they are.
    """
    if len(maps) < 2:
        return list(maps)
    options, coding = maps[0].options, maps[0].kind.coding
    if coding in ("height", "vector") and options.scale is None:
        ends = np.array([_ends(baked) for baked in maps])
        everywhere = np.ones(ends.shape, dtype=np.bool_)
        mid, scale = height_range(ends, everywhere, bits=bits, mid=options.mid)
        options = replace(options, mid=mid, scale=scale)
    elif coding == "curvature" and options.curvature_scale is None:
        options = replace(options, curvature_scale=max(map(usual_curvature, maps)))
    elif coding == "thickness" and options.thickness_distance is None:
        greatest = max(_ends(baked)[1] for baked in maps)
        options = replace(options, thickness_distance=greatest or 1.0)
    return [replace(baked, options=options) for baked in maps]


def _ends(baked: BakedMap) -> tuple[float, float]:
    """Least and greatest finite value with data; 0 if there is none."""
    ranges = channel_ranges(baked.values, baked.has_data, threads=baked.options.threads)
    low, high = float(ranges[:, 0].min()), float(ranges[:, 1].max())
    return (low, high) if low <= high else (0.0, 0.0)
