"""What a bake of many parts returns: the maps of each texture set and tile, and a report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from texbake.baking.codings import file_bits, usual_curvature
from texbake.baking.parts.low_parts import BakeTarget
from texbake.baking.parts.matching import Matching
from texbake.baking.parts.options import PartsOptions
from texbake.baking.report import BakeReport
from texbake.baking.result import BakedMap, BakeResult, WrittenMap
from texbake.errors import counted
from texbake.progress import StageRecord
from texbake.raycast.orientation import OrientationReport
from texbake.texture.image_formats import holds_floats
from texbake.texture.value_range import channel_ranges, height_range


@dataclass(frozen=True, eq=False)
class PartsResult:
    """Everything that `bake_parts` made."""

    targets: dict[BakeTarget, BakeResult]  # the maps of each texture set and tile
    report: PartsReport

    def write(self, files: Mapping[BakeTarget, Mapping[str, Path]]) -> list[WrittenMap]:
        """Write the maps; integer files of one map share their levels."""
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


@dataclass(frozen=True)
class PartFigures:
    """One part on one set of maps."""

    target: BakeTarget
    low: str
    high: tuple[str, ...]  # high-poly parts that it was baked from
    n_faces: int  # faces of the part on this set of maps
    texels_covered: int
    texels_missed: int
    # front, back: ray distances, in model units.
    front: float | None
    back: float


@dataclass(frozen=True)
class PartsReport:
    """Figures of a bake of many parts."""

    options: PartsOptions
    matching: Matching | None  # if parts were matched by name
    parts: list[PartFigures]
    targets: dict[BakeTarget, BakeReport]
    n_crossing: int = 0  # faces that cross the border of a UDIM tile, and faces that lie in none
    n_outside: int = 0
    # texels that more than one part covers, except by islands that are stacked
    n_overlapping: int = 0
    # parts that cover no texel of a set of maps that they have faces on
    without_texel: tuple[str, ...] = ()
    # what was flipped of the high-poly mesh of each low-poly part
    orientations: dict[str, OrientationReport] = field(default_factory=dict)
    stages: list[StageRecord] = field(default_factory=list)

    @property
    def is_paired(self) -> bool:
        """Whether parts were matched because all their names pair up."""
        return self.matching is not None and not self.options.match_by_name

    @property
    def part_warnings(self) -> list[str]:
        """What the user should check about the parts, besides the bake of each."""
        found = [] if self.matching is None else list(self.matching.warnings)
        for turned in self.orientations.values():
            found += turned.notes
        checks = (
            (
                self.n_crossing,
                counted(self.n_crossing, "triangle crosses", "triangles cross")
                + " borders of tiles; each tile gets its share",
            ),
            (
                self.n_outside,
                counted(
                    self.n_outside,
                    "triangle lies in no tile and is not baked",
                    "triangles lie in no tile and are not baked",
                ),
            ),
            (
                self.n_overlapping,
                counted(self.n_overlapping, "texel is", "texels are")
                + " covered by more than one part; the first part with a hit is used",
            ),
        )
        found += [message for count, message in checks if count]
        what_to_do = "use a larger `size` or new coordinates"
        return found + [f"{what}; {what_to_do}" for what in self.without_texel]

    @property
    def warnings(self) -> list[str]:
        """What the user should check, a sentence each."""
        found = self.part_warnings
        several = len(self.targets) > 1
        for target, report in self.targets.items():
            start = f"{target_name(target)}: " if several else ""
            found += [start + warning for warning in report.warnings]
        return found

    def table(self) -> list[tuple[str, str]]:
        """Rows of a label and a figure, to print."""
        own = f"{len(self.parts):,} objects, each baked from the one with the matching name"
        rows = [("parts", own if self.is_paired else "")]
        several = len(self.targets) > 1
        for part in self.parts:
            where = f" on {target_name(part.target)}" if several else ""
            percent = 100.0 * part.texels_missed / max(part.texels_covered, 1)
            rows.append(
                (
                    f"  {part.low}",
                    f"from {', '.join(part.high)}{where}: {counted(part.n_faces, 'triangle')}, "
                    f"{counted(part.texels_covered, 'texel')}, {percent:.3f} % missed",
                )
            )
        rows.append(("sets of maps", ", ".join(map(target_name, self.targets)) if several else "1"))
        return rows

    def to_json(self) -> dict[str, Any]:
        """Return the report as plain values, for `json.dump`."""
        return {
            "options": asdict(self.options),
            "matching": None if self.matching is None else self.matching.to_json(),
            "parts": [{**asdict(part), "target": part.target._asdict()} for part in self.parts],
            "targets": [
                {**target._asdict(), **report.to_json()} for target, report in self.targets.items()
            ],
            "faces_crossing_tiles": self.n_crossing,
            "faces_in_no_tile": self.n_outside,
            "texels_of_several_parts": self.n_overlapping,
            "without_texel": list(self.without_texel),
            "orientations": {name: asdict(part) for name, part in self.orientations.items()},
            "stages": [asdict(stage) for stage in self.stages],
            "warnings": self.warnings,
        }


def target_name(target: BakeTarget) -> str:
    """Name of a set of maps in messages."""
    return f"{target.texture_set} {target.udim}".strip()
