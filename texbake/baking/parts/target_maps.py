"""Bakes of several parts combined on one set of maps, then padded together."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from texbake.baking.inputs import BakeInputs
from texbake.baking.maps import MapKind
from texbake.baking.options import BakeOptions
from texbake.baking.padding import finished_maps
from texbake.baking.report import BakeReport
from texbake.baking.result import BakedMap, BakeResult
from texbake.baking.texels import NO_FACE
from texbake.baking.trace import TraceCounts
from texbake.errors import FileError
from texbake.mesh.mesh import IntArray
from texbake.progress import Stages


class TargetMaps:
    """Combines the bakes of parts on one set of maps.

    Where two parts cover a texel the first one counts, unless its rays missed and the other's hit.

    Attributes
    ----------
    n_overlapping : int
        Texels that more than one part covers, except by islands that are stacked.
    """

    def __init__(
        self, kinds: list[MapKind], options: BakeOptions, *, is_tile: bool = False
    ) -> None:
        self._is_tile = is_tile
        self._kinds, self._options = kinds, options
        shape = (options.height_px, options.width_px)
        self._values: dict[MapKind, npt.NDArray[np.float32]] = {}
        self._charts: IntArray = np.full(shape, NO_FACE, dtype=np.int32)
        self._faces: IntArray = np.full(shape, NO_FACE, dtype=np.int32)
        self._has_data = np.zeros(shape, dtype=np.bool_)
        self._n_charts = 0
        self._reports: list[BakeReport] = []
        self.n_overlapping = 0

    @property
    def is_empty(self) -> bool:
        """Whether no part was added."""
        return not self._reports

    def add(
        self,
        result: BakeResult,
        inputs: BakeInputs,
        face_ids: IntArray,
        n_faces: int,
        is_stacked: npt.NDArray[np.bool_] | None = None,
    ) -> None:
        """Add a part that was baked without padding.

        `face_ids` (F,) int32: faces of the part in the whole mesh; `n_faces`: how many of them are
        on these maps; `is_stacked` (F,) bool: faces that share their texels on purpose.
        """
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

    def finish(self, inputs: BakeInputs, stages: Stages, folder: Path | None) -> BakeResult:
        """Pad and fill; with a folder, the values are kept in files there instead of in memory."""
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


def _window(covered: npt.NDArray[np.bool_]) -> tuple[slice, slice]:
    """Rows and columns that hold all covered texels, of which there is at least one."""
    rows = np.flatnonzero(covered.any(axis=1))
    columns = np.flatnonzero(covered[rows[0] : rows[-1] + 1].any(axis=0))
    return slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)


def joined_reports(reports: list[BakeReport]) -> BakeReport:
    """Join reports: counts are added, ray distances the greatest, percentiles those of the last.

    All bakes share one `DistanceSummary`, so that the percentiles of the last are those of all.
    """
    last = reports[-1]
    fronts = [report.front for report in reports if report.front is not None]
    return replace(
        last,
        high=_names(report.high for report in reports),
        low=_names(report.low for report in reports),
        # Several parts may be baked from the same one.
        n_high_faces=sum({report.high: report.n_high_faces for report in reports}.values()),
        n_low_faces=sum(report.n_low_faces for report in reports),
        front=max(fronts) if fronts else None,
        back=max(report.back for report in reports),
        texels_covered=sum(report.texels_covered for report in reports),
        texels_missed=sum(report.texels_missed for report in reports),
        texels_overlapping=sum(report.texels_overlapping for report in reports),
        faces_without_texel=sum(report.faces_without_texel for report in reports),
        counts=_sum(report.counts for report in reports),
        sampling=last.sampling if len(reports) == 1 else None,
    )


def _names(names: Iterable[str]) -> str:
    return ", ".join(dict.fromkeys(names))


def _sum(counts: Iterable[TraceCounts]) -> TraceCounts:
    total = TraceCounts()
    for item in counts:
        for field in fields(TraceCounts):
            setattr(total, field.name, getattr(total, field.name) + getattr(item, field.name))
    return total


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
    values = np.asarray(np.load(path, mmap_mode="c"))
    return replace(baked, values=values)
