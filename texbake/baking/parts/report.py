"""The report of a bake of many parts: which was baked from which, and figures per set of maps."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

from texbake.baking.parts.low_parts import BakeTarget
from texbake.baking.parts.matching import Matching
from texbake.baking.parts.options import PartsOptions
from texbake.baking.report import BakeReport
from texbake.progress import StageRecord
from texbake.raycast.orient import OrientationReport


@dataclass(frozen=True)
class PartFigures:
    """One part on one set of maps.

    Attributes
    ----------
    high : tuple of str
        High-poly parts that it was baked from.
    n_faces : int
        Faces of the part on this set of maps.
    front, back : float or None
        Ray distances, in model units.
    """

    target: BakeTarget
    low: str
    high: tuple[str, ...]
    n_faces: int
    texels_covered: int
    texels_missed: int
    front: float | None
    back: float


@dataclass(frozen=True)
class PartsReport:
    """Figures of a bake of many parts.

    Attributes
    ----------
    matching : Matching or None
        If parts were matched by name.
    n_crossing, n_outside : int
        Faces that cross the border of a UDIM tile, and faces that lie in none.
    n_overlapping : int
        Texels that more than one part covers, except by islands that are stacked.
    without_texel : tuple of str
        Parts that cover no texel of a set of maps that they have faces on.
    orientations : dict of str to OrientationReport
        What was flipped of the high-poly mesh of each low-poly part.
    """

    options: PartsOptions
    matching: Matching | None
    parts: list[PartFigures]
    targets: dict[BakeTarget, BakeReport]
    n_crossing: int = 0
    n_outside: int = 0
    n_overlapping: int = 0
    without_texel: tuple[str, ...] = ()
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
                f"{self.n_crossing:,} triangles cross borders of tiles; each tile gets its share",
            ),
            (self.n_outside, f"{self.n_outside:,} triangles lie in no tile and are not baked"),
            (
                self.n_overlapping,
                f"{self.n_overlapping:,} texels are covered by more than one part; the first part "
                "with a hit is used",
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
                    f"from {', '.join(part.high)}{where}: {part.n_faces:,} triangles, "
                    f"{part.texels_covered:,} texels, {percent:.3f} % missed",
                )
            )
        rows.append(("sets of maps", ", ".join(map(target_name, self.targets)) if several else "1"))
        rows += [(f"  {stage.name}", f"{stage.seconds:.2f} s") for stage in self.stages]
        rows.append(("total", f"{sum(stage.seconds for stage in self.stages):.2f} s"))
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
