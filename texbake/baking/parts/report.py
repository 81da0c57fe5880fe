"""What a bake of many parts tells: who was baked from whom, and the figures of each set of maps."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

from texbake.baking.parts.light import Canvas
from texbake.baking.parts.matching import Matching
from texbake.baking.parts.options import PartsOptions
from texbake.baking.report import BakeReport
from texbake.progress import StageRecord


@dataclass(frozen=True)
class PartFigures:
    """One part on one set of maps.

    Attributes
    ----------
    canvas : Canvas
    low : str
    high : tuple of str
        Dense parts that it was baked from.
    n_faces : int
        Of the part, on this set of maps.
    texels_covered, texels_missed : int
    front, back : float or None
        Distances of its rays, in model units.
    """

    canvas: Canvas
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
    options : PartsOptions
    matching : Matching or None
        Where names were matched.
    parts : list of PartFigures
    canvases : dict of Canvas to BakeReport
    n_crossing, n_outside : int
        Faces that cross the border of a UDIM tile, and that lie in none.
    n_overlapping : int
        Texels that more than one part covers.
    without_texel : tuple of str
        Parts that cover no texel of a set of maps they have faces in.
    stages : list of StageRecord
    """

    options: PartsOptions
    matching: Matching | None
    parts: list[PartFigures]
    canvases: dict[Canvas, BakeReport]
    n_crossing: int = 0
    n_outside: int = 0
    n_overlapping: int = 0
    without_texel: tuple[str, ...] = ()
    stages: list[StageRecord] = field(default_factory=list)

    @property
    def warnings(self) -> list[str]:
        """What the user should look at, a sentence each."""
        found = [] if self.matching is None else self.matching.warnings
        checks = (
            (
                self.n_crossing,
                f"{self.n_crossing:,} faces cross the border of a tile; each tile has its share",
            ),
            (self.n_outside, f"{self.n_outside:,} faces lie in no tile and are not baked"),
            (
                self.n_overlapping,
                f"{self.n_overlapping:,} texels are covered by more than one part; the first "
                "that hit has them",
            ),
        )
        found += [message for count, message in checks if count]
        found += [f"{what}; use a greater --size" for what in self.without_texel]
        several = len(self.canvases) > 1
        for canvas, report in self.canvases.items():
            start = f"{called(canvas)}: " if several else ""
            found += [start + warning for warning in report.warnings]
        return found

    def table(self) -> list[tuple[str, str]]:
        """Rows of a label and a figure, for a person."""
        rows = [("parts", "")]
        several = len(self.canvases) > 1
        for part in self.parts:
            where = f" on {called(part.canvas)}" if several else ""
            percent = 100.0 * part.texels_missed / max(part.texels_covered, 1)
            rows.append(
                (
                    f"  {part.low}",
                    f"from {', '.join(part.high)}{where}: {part.n_faces:,} faces, "
                    f"{part.texels_covered:,} texels, {percent:.3f} % missed",
                )
            )
        rows.append(("sets of maps", ", ".join(map(called, self.canvases)) if several else "1"))
        rows += [(f"  {stage.name}", f"{stage.seconds:.2f} s") for stage in self.stages]
        rows.append(("total", f"{sum(stage.seconds for stage in self.stages):.2f} s"))
        return rows

    def to_json(self) -> dict[str, Any]:
        """Return everything as plain values, for `json.dump`."""
        return {
            "options": asdict(self.options),
            "matching": None if self.matching is None else self.matching.to_json(),
            "parts": [{**asdict(part), "canvas": part.canvas._asdict()} for part in self.parts],
            "canvases": [
                {**canvas._asdict(), **report.to_json()} for canvas, report in self.canvases.items()
            ],
            "faces_crossing_tiles": self.n_crossing,
            "faces_in_no_tile": self.n_outside,
            "texels_of_several_parts": self.n_overlapping,
            "without_texel": list(self.without_texel),
            "stages": [asdict(stage) for stage in self.stages],
            "warnings": self.warnings,
        }


def called(canvas: Canvas) -> str:
    """What messages call a set of maps."""
    return f"{canvas.texture_set} {canvas.udim}".strip()
