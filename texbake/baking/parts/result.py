"""What a bake of many parts returns: the maps of each texture set and tile, and a report.

The bakes of several parts are combined on one set of maps, then padded together.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from texbake.baking.codings import file_bits, usual_curvature
from texbake.baking.inputs import BakeInputs
from texbake.baking.maps import MapKind
from texbake.baking.options import BakeOptions
from texbake.baking.parts.low_parts import BakeTarget
from texbake.baking.parts.matching import Matching, PartsOptions
from texbake.baking.report import BakeReport
from texbake.baking.result import BakedMap, BakeResult, WrittenMap
from texbake.baking.texel_values import finished_maps
from texbake.baking.texels import NO_FACE
from texbake.baking.trace import TraceCounts
from texbake.errors import FileError, counted
from texbake.mesh.mesh import BoolArray, Float32Array, IntArray
from texbake.progress import StageRecord, Stages
from texbake.raycast.orientation import OrientationReport
from texbake.records import dataclass
from texbake.texture.encoding import channel_ranges, height_range
from texbake.texture.image_formats import holds_floats


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
    """Return maps of one kind with levels that all tiles share, for files of 8 or 16 bits."""
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


@dataclass
class PartsReport:
    """Figures of a bake of many parts, counted while it runs."""

    options: PartsOptions
    matching: Matching | None  # if parts were matched by name
    parts: list[PartFigures] = field(default_factory=list)
    targets: dict[BakeTarget, BakeReport] = field(default_factory=dict)
    n_crossing: int = 0  # faces that cross the border of a UDIM tile, and faces that lie in none
    n_outside: int = 0
    # texels that more than one part covers, except by islands that are stacked
    n_overlapping: int = 0
    # parts that cover no texel of a set of maps that they have faces on
    without_texel: list[str] = field(default_factory=list)
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
            "without_texel": self.without_texel,
            "orientations": {name: asdict(part) for name, part in self.orientations.items()},
            "stages": [asdict(stage) for stage in self.stages],
            "warnings": self.warnings,
        }


def target_name(target: BakeTarget) -> str:
    """Name of a set of maps in messages."""
    return f"{target.texture_set} {target.udim}".strip()


class TargetMaps:
    """Combines bakes of parts on one set of maps; the first part to hit a texel counts."""

    def __init__(
        self, kinds: list[MapKind], options: BakeOptions, *, is_tile: bool = False
    ) -> None:
        self._is_tile = is_tile
        self._kinds, self._options = kinds, options
        shape = (options.height_px, options.width_px)
        self._values: dict[MapKind, Float32Array] = {}
        self._charts: IntArray = np.full(shape, NO_FACE, dtype=np.int32)
        self._faces: IntArray = np.full(shape, NO_FACE, dtype=np.int32)
        self._has_data = np.zeros(shape, dtype=np.bool_)
        self._n_charts = 0
        self._reports: list[BakeReport] = []
        # Texels that more than one part covers, except by islands that are stacked.
        self.n_overlapping = 0

    def add(
        self,
        result: BakeResult,
        inputs: BakeInputs,
        face_ids: IntArray,
        n_faces: int,
        is_stacked: BoolArray | None = None,
    ) -> None:
        """Add a part that was baked without padding, with its faces (F,) in the whole mesh."""
        covered = result.texel_faces != NO_FACE
        first = not self._values
        if first:
            self._values = {kind: result.maps[kind.name].values for kind in self._kinds}
        # With many parts, each covers a small window of the maps.
        at = _window(covered)
        covered, faces, has_data = covered[at], result.texel_faces[at], result.has_data[at]
        is_covered = self._faces[at] != NO_FACE
        unintended = covered & is_covered
        if is_stacked is not None:
            unintended &= ~is_stacked[faces]
        self.n_overlapping += int(np.count_nonzero(unintended))
        # A hit of another part replaces a miss.
        is_used = np.where(is_covered, has_data & ~self._has_data[at], covered)
        for kind in [] if first else self._kinds:
            values = result.maps[kind.name].values[at]
            np.copyto(self._values[kind][at], values, where=is_used[:, :, np.newaxis])
        charts = np.append(inputs.low_surface.charts, NO_FACE).astype(np.int32)
        np.copyto(self._charts[at], charts[faces] + np.int32(self._n_charts), where=is_used)
        np.copyto(self._faces[at], face_ids[faces], where=is_used)
        np.copyto(self._has_data[at], has_data, where=is_used)
        self._n_charts += int(charts.max()) + 1
        report = result.report
        n_absent = inputs.low.n_faces - n_faces
        counts = replace(
            report.counts,
            faces_without_uv_area=max(report.counts.faces_without_uv_area - n_absent, 0),
            # What lies outside one tile is baked in the next.
            faces_outside_tile=0 if self._is_tile else report.counts.faces_outside_tile,
        )
        self._reports.append(
            replace(
                report,
                n_low_faces=n_faces,
                faces_without_texel=report.faces_without_texel - n_absent,
                counts=counts,
            )
        )

    def finish(self, inputs: BakeInputs, stages: Stages, folder: Path | None) -> BakeResult | None:
        """Pad and fill, in files of a folder if there is one; None if no part was added."""
        if not self._reports:
            return None
        maps, meets = finished_maps(
            self._kinds, self._values.pop, self._charts, self._has_data, inputs, stages
        )
        if folder is not None:
            maps = {name: _in_file(baked, folder / f"{name}.npy") for name, baked in maps.items()}
        n_covered = int(np.count_nonzero(self._faces != NO_FACE))
        report = replace(
            joined_reports(self._reports),
            options=self._options,
            texels_covered=n_covered,
            texels_missed=n_covered - int(np.count_nonzero(self._has_data)),
            padding_meets=meets,
            stages=stages.records,
        )
        return BakeResult(maps, report, None, self._faces, self._has_data)


def _window(covered: BoolArray) -> tuple[slice, slice]:
    """Rows and columns that hold all covered texels, of which there is at least one."""
    rows = np.flatnonzero(covered.any(axis=1))
    columns = np.flatnonzero(covered[rows[0] : rows[-1] + 1].any(axis=0))
    return slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)


def joined_reports(reports: list[BakeReport]) -> BakeReport:
    """Join reports of bakes that share one `DistanceSummary`: counts add up."""
    last, counts = reports[-1], TraceCounts()
    for report in reports:
        for name, count in vars(report.counts).items():
            setattr(counts, name, getattr(counts, name) + count)
    fronts = [report.front for report in reports if report.front is not None]
    return replace(
        last,
        high=", ".join(dict.fromkeys(report.high for report in reports)),
        low=", ".join(dict.fromkeys(report.low for report in reports)),
        # Several parts may be baked from the same one.
        n_high_faces=sum({report.high: report.n_high_faces for report in reports}.values()),
        n_low_faces=sum(report.n_low_faces for report in reports),
        front=max(fronts) if fronts else None,
        back=max(report.back for report in reports),
        texels_covered=sum(report.texels_covered for report in reports),
        texels_missed=sum(report.texels_missed for report in reports),
        texels_overlapping=sum(report.texels_overlapping for report in reports),
        faces_without_texel=sum(report.faces_without_texel for report in reports),
        counts=counts,
        sampling=last.sampling if len(reports) == 1 else None,
    )


def _in_file(baked: BakedMap, path: Path) -> BakedMap:
    """The same map with its values in a memory-mapped file."""
    try:
        np.save(path, baked.values)
    except OSError as error:
        raise FileError(
            f"{path}: a finished map cannot be stored there: "
            f"{error.strerror or error}; free some space"
        ) from error
    # Copy on write, because kernels are compiled for writable arrays; nothing is written back.
    return replace(baked, values=np.asarray(np.load(path, mmap_mode="c")))
