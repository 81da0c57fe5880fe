"""What a bake of many parts gives back: the maps of each set and tile, and how they are written."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from texbake.baking.baked_map import WrittenMap
from texbake.baking.codings import file_bits
from texbake.baking.parts.levels import with_common_levels
from texbake.baking.parts.light import Canvas
from texbake.baking.parts.report import PartsReport
from texbake.baking.result import BakeResult
from texbake.texture.image_formats import holds_floats


@dataclass(frozen=True, eq=False)
class PartsResult:
    """What `bake_parts` made.

    Attributes
    ----------
    canvases : dict of Canvas to BakeResult
        The maps of each texture set and tile.
    report : PartsReport
    """

    canvases: dict[Canvas, BakeResult]
    report: PartsReport

    def write(self, files: Mapping[Canvas, Mapping[str, Path]]) -> list[WrittenMap]:
        """Write maps; integer files of one name share their levels.

        Parameters
        ----------
        files
            For each set of maps the file of each map.

        Raises
        ------
        OptionError, FileError
        """
        written = []
        for name in next(iter(self.canvases.values())).maps:
            maps = [result.maps[name] for result in self.canvases.values()]
            paths = [files[canvas][name] for canvas in self.canvases]
            bits = file_bits(maps[0].kind, paths[0], maps[0].options.bits, len(maps[0].legend))
            if not holds_floats(paths[0], bits):
                maps = with_common_levels(maps, bits)
            written += [baked.write(path) for baked, path in zip(maps, paths, strict=True)]
        return written
