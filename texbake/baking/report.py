"""The report of a bake: settings, coverage, misses, distances, time and memory."""

from __future__ import annotations

import sys
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from texbake.baking.hits import Hits
from texbake.baking.options import BakeOptions
from texbake.baking.trace import TraceCounts
from texbake.core import core
from texbake.errors import counted
from texbake.mesh.mesh import FloatArray
from texbake.parallel import run_bands
from texbake.progress import StageRecord
from texbake.raycast.orientation import OrientationReport
from texbake.records import dataclass
from texbake.sampling.report import SamplingReport
from texbake.sampling.rounds import TimeBudget

_BAND = 1 << 15
_PERCENTILES = (1, 5, 50, 95, 99)
_EVERY = 8  # all percentiles but the least and the greatest use one hit in this many


class DistanceSummary:
    """Distances between two surfaces, collected in parts, however the trace is divided."""

    def __init__(self) -> None:
        self._some: list[FloatArray] = []
        self._least, self._greatest = np.inf, 0.0
        self._n_hits = 0

    def add(self, hits: Hits, *, threads: int | None = None) -> None:
        """Add the hits of a part of the trace."""
        squares = np.empty(len(hits))
        counts, leasts, greatests = {}, [np.inf], [0.0]

        def measure(start: int, stop: int) -> None:
            counts[start] = core.measure_lengths(
                hits.offsets, hits.high_faces, start, stop, squares
            )
            measured = squares[start : start + counts[start]]
            leasts.append(measured.min(initial=np.inf))
            greatests.append(measured.max(initial=0.0))

        run_bands(measure, len(hits), band=_BAND, threads=threads)
        self._least = min(self._least, float(np.sqrt(min(leasts))))
        self._greatest = max(self._greatest, float(np.sqrt(max(greatests))))
        for start, count in sorted(counts.items()):
            some = squares[start + -self._n_hits % _EVERY : start + count : _EVERY]
            self._some.append(np.sqrt(some))
            self._n_hits += count

    def percentiles(self) -> dict[int, float]:
        """Percent to distance in model units: 0 least, 100 greatest. Empty without hits."""
        some = np.concatenate([np.empty(0), *self._some])
        if len(some) == 0:
            return {}
        values = np.percentile(some, _PERCENTILES)
        between = {
            percent: float(value) for percent, value in zip(_PERCENTILES, values, strict=True)
        }
        return {0: self._least, **between, 100: self._greatest}


@dataclass(frozen=True)
class BakeReport:
    """Figures of one bake; lengths are model units."""

    high: str  # names of the meshes
    low: str
    cage: str | None
    n_high_faces: int
    n_low_faces: int
    options: BakeOptions  # as given
    # ray distances; the front is None with a cage, which has a distance for each vertex
    front: float | None
    back: float
    measured: bool  # whether at least one of them was measured
    caster: str  # name of the ray caster
    # all texels of the map; those that the low-poly mesh covers; the covered ones without any hit
    texels: int
    texels_covered: int
    texels_missed: int
    texels_overlapping: float  # samples that several faces cover, in texels; the first face wins
    # Faces of the low-poly mesh that own no texel: they are too thin, covered by others, without
    # area, or outside the unit square. Those of stacked islands that share texels do not count.
    faces_without_texel: int
    padding_meets: int  # texels where the padding of two charts meets
    counts: TraceCounts
    # distances between the low-poly and the high-poly surface, by percent
    distance_percentiles: dict[int, float]
    stages: list[StageRecord]
    versions: dict[str, str]
    orientation: OrientationReport | None = None  # what was flipped of the high-poly mesh
    # errors of adaptive samples, as estimated and as checked
    sampling: SamplingReport | None = None
    budget: TimeBudget | None = None  # the settings that a time budget led to
    # front and back at the median vertex, where each vertex has its own; `front` and `back` are
    # then the greatest, up to which rays that miss are cast again
    median_reach: tuple[float, float] | None = None
    # number of objects that were baked from their matches; 0 if all were baked from all
    n_objects: int = 0
    # sentences on these objects: overlaps of two, and those without a texel
    of_objects: tuple[str, ...] = ()
    # sentences that say why rays missed, or could miss; empty if no cause was looked for
    why_missed: tuple[str, ...] = ()

    @property
    def miss_percent(self) -> float:
        """Missed texels, in percent of the covered ones."""
        return 100.0 * self.texels_missed / max(self.texels_covered, 1)

    @property
    def objects(self) -> str:
        """Say which objects were baked from which."""
        return f"{self.n_objects:,}, each baked from the one with the matching name"

    @property
    def seconds(self) -> float:
        """Time of all stages so far."""
        return sum(stage.seconds for stage in self.stages)

    @property
    def warnings(self) -> list[str]:
        """What the user should check, a sentence each."""
        counts = self.counts
        # `run` makes this report as well, and has no option for a miss map.
        hint = "texbake bake --miss-map shows where"
        if self.miss_percent > 50.0:
            hint = "is the mesh turned inside out, or are the ray distances too short?"
        own = "owns" if self.faces_without_texel == 1 else "own"
        n_flat = counts.faces_without_uv_area
        flat = f", {n_flat:,} of them without area in texture space" if n_flat else ""
        checks = (
            (
                self.texels_missed,
                f"the rays of {counted(self.texels_missed, 'texel')} ({self.miss_percent:.2f} %) "
                f"missed the high-poly mesh, and these texels are left neutral; {hint}",
            ),
            (
                counts.samples_overlapping,
                "texture coordinates overlap on "
                f"{counted(round(self.texels_overlapping), 'texel')}; the first face wins",
            ),
            (
                counts.faces_outside_tile,
                counted(counts.faces_outside_tile, "triangle extends", "triangles extend")
                + " beyond the unit square; what lies outside is not baked, "
                "unless {udim} is in `name_pattern`",
            ),
            (
                self.faces_without_texel,
                f"{self.faces_without_texel:,} of {self.n_low_faces:,} triangles {own} no texel"
                f"{flat}",
            ),
            (
                self.padding_meets,
                f"the padding of two charts meets on {counted(self.padding_meets, 'texel')}; "
                "use less `padding` or leave more space between charts",
            ),
        )
        found = [message for count, message in checks if count]
        found += (*self.why_missed, *self.of_objects)
        if counts.islands_sharing:
            found.append(
                f"stacked islands share texels, and {counts.islands_sharing:,} of them show what "
                "is baked for others; choose which to bake with `bake_island`"
            )
        for part in (self.sampling, self.budget):
            found += [] if part is None else part.warnings
        return [*(() if self.orientation is None else self.orientation.notes), *found]

    def table(self) -> list[tuple[str, str]]:
        """Rows of a label and a figure, to print."""
        counts = self.counts
        front = "from the cage" if self.front is None else f"{self.front:.6g}"
        measured = " (measured)" if self.measured else ""
        if counts.faces_limited:
            measured = f" (the most allowed, on {counted(counts.faces_limited, 'triangle')})"
        low, *_, high = self.distance_percentiles.values() or (0.0, 0.0)
        median = self.distance_percentiles.get(50, 0.0)
        rows = [("meshes", f"{counted(self.n_high_faces, 'triangle')} onto {self.n_low_faces:,}")]
        if self.n_objects:
            rows.append(("objects", self.objects))
        size = f"{self.options.width_px} x {self.options.height_px}"
        rows += [
            ("size", f"{size}, {self._samples()}"),
            ("distances", f"front {front}, back {self.back:.6g}{measured}"),
        ]
        if self.median_reach is not None:
            medians = "median front {:.4g}, back {:.4g}".format(*self.median_reach)
            rows.append(("at each vertex", medians))
        rows += [
            ("texels covered", f"{self.texels_covered:,} of {self.texels:,}"),
            ("texels missed", f"{self.texels_missed:,} ({self.miss_percent:.3f} %)"),
            (
                "rays",
                f"{counts.rays_cast:,} cast, {counts.rays_missed:,} missed, "
                f"{counts.rays_past_back_faces:,} past back faces",
            ),
        ]
        if counts.rays_lengthened:
            longer = f"{counts.rays_lengthened:,}, where those of the vertices missed"
            rows.append(("longer rays", longer))
        if self.options.on_miss == "closest":
            rows.append(("closest points", f"{counts.rays_to_closest:,} for rays that missed"))
        if counts.secondary_rays:
            rows.append(("secondary rays", f"{counts.secondary_rays:,}{self._denoised()}"))
        overlap = counted(round(self.texels_overlapping), "texel")
        rows += [
            ("overlap, outside", f"{overlap}, {counted(counts.faces_outside_tile, 'triangle')}"),
            ("surface distance", f"least {low:.4g}, median {median:.4g}, greatest {high:.4g}"),
        ]
        for part in (self.budget, self.sampling):
            rows += [] if part is None else part.table()
        return rows

    def _samples(self) -> str:
        """Describe the samples that were cast, which a time budget may have chosen."""
        if self.sampling is not None:
            return "adaptive samples"
        n_samples = 1 if self.budget is not None else self.options.samples
        return f"{n_samples} sample{'' if n_samples == 1 else 's'} per texel"

    def _denoised(self) -> str:
        """Text that names the denoised maps, to follow the number of rays."""
        names = [name for name in ("ao", "thickness") if name in self.options.maps]
        return f"; {' and '.join(names)} denoised" if names and self.options.denoise else ""

    def to_json(self) -> dict[str, Any]:
        """Return the report as plain values, for `json.dump`."""
        values = asdict(self)
        values["size"] = [self.options.width_px, self.options.height_px]
        values["miss_percent"] = self.miss_percent
        values["seconds"] = self.seconds
        values["warnings"] = self.warnings
        return values


@cache
def library_versions() -> dict[str, str]:
    """Versions of texbake and of the libraries that its results depend on."""
    return {name: _version_of(name) for name in ("texbake", "numpy", "openimageio")}


def _version_of(name: str) -> str:
    """Version of a package by the name of its folder, because `importlib.metadata` is slow."""
    for folder in sys.path:
        for metadata in Path(folder).glob(f"{name}-*.dist-info"):
            return metadata.stem.removeprefix(f"{name}-")
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version(name)
    except PackageNotFoundError:
        return "unknown"
