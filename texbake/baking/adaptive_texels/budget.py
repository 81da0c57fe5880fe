"""A time becomes a bound on the error: the closest that is predicted to fit, from a short probe.

The probe bakes some rows of the map for one bound of a ladder after another, with the ray scene
that the bake itself goes on to use. Some stages of a bake take the same time for any number of
texels, and the probe has measured all of it. The others grow with the rows, except for a part that
they take even for none, which follows from a probe of half of the rows. Padding is timed on a small
map. Ray distances that the probe has measured are not measured again.
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from texbake.baking.adaptive_texels.samples import AdaptiveSamples
from texbake.baking.inputs import BakeInputs
from texbake.baking.maps.kind import MapKind
from texbake.baking.options import ADAPTIVE, BakeOptions
from texbake.baking.padding import ChartPadding
from texbake.baking.pineda import NO_FACE
from texbake.baking.rays import RayMaps
from texbake.baking.report import DistanceSummary
from texbake.baking.scenes import BakeScenes
from texbake.baking.secondary_rays import SecondaryRays
from texbake.baking.sums import TexelSums
from texbake.baking.trace import Trace
from texbake.durations import parse_seconds
from texbake.mesh.mesh import Mesh
from texbake.progress import Stages
from texbake.sampling.bounds import parse_bounds
from texbake.sampling.time_budget import Candidate, TimeBudget, choose_bound

# The closest bound of the ladder where none is given: below what 8-bit maps round off.
_CLOSEST = "0.125deg,0.0025%"
_HALVINGS = 6  # of the bound, from the widest to the closest
_STRIPS = 8
_STRIP_ROWS = 16
_PAD_SIZE = 256
# Stages that take the same time for any number of texels.
_FIXED = ("measure distances", "prepare low-poly mesh")


def plan_bake(
    inputs: BakeInputs,
    kinds: list[MapKind],
    cage: Mesh | None,
    ray_maps: RayMaps | None,
    scenes: BakeScenes,
    start: float,
) -> tuple[BakeInputs, TimeBudget]:
    """Turn `BakeOptions.time_budget` into options that are predicted to fit into it.

    Parameters
    ----------
    scenes
        Ray scenes of the bake, which it goes on to use.
    start
        `time.perf_counter` when the bake began.

    Returns
    -------
    inputs : BakeInputs
        Its options have no time budget, but a bound or one sample per texel, and the ray distances
        that were measured.
    budget : TimeBudget
        Without the actual time.

    Raises
    ------
    UvError, CageError, OptionError
        As the bake would.
    """
    options = inputs.options
    assert options.time_budget is not None
    seconds = parse_seconds(options.time_budget)
    closest = parse_bounds(options.max_error or _CLOSEST)
    ladder = [str(closest.scaled(2.0**k)) for k in range(_HALVINGS, -1, -1)]
    probe = _BakeProbe(inputs, kinds, (cage, ray_maps, scenes), widest=ladder[0])
    choice = choose_bound(
        ladder, probe.try_out, seconds, start=start, began=start, tries_first=True
    )
    planned, why = probe.options, choice.why
    if choice.bound is None or choice.predicted is None:
        predicted = choice.candidates[0].predicted_seconds  # at most
        planned = replace(planned, samples=1, max_error=None)
        settings, why = "1 sample per texel", f"{why}, and even one sample may take longer"
    else:
        predicted = choice.predicted
        planned = replace(planned, samples=ADAPTIVE, max_error=choice.bound)
        settings = f"`max_error={choice.bound}`"
    budget = TimeBudget(
        work="the bake",
        seconds=seconds,
        choice=settings,
        why=why,
        probe_seconds=choice.spent,
        predicted_seconds=choice.spent + predicted,
        candidates=choice.candidates,
    )
    return probe.inputs.with_options(planned), budget


class _BakeProbe:
    """Bakes some rows of a map and predicts how long all of them would take.

    Attributes
    ----------
    options : BakeOptions
        Without a time budget, with the ray distances that were measured.
    inputs : BakeInputs
        With everything that the maps need of the meshes computed.
    """

    def __init__(
        self,
        inputs: BakeInputs,
        kinds: list[MapKind],
        rays: tuple[Mesh | None, RayMaps | None, BakeScenes],
        *,
        widest: str,
    ) -> None:
        options = inputs.options
        self._kinds = kinds
        self._cage, self._ray_maps, self._scenes = rays
        self.inputs = inputs
        self._rows = _strips(options.height_px)
        self.options = replace(options, time_budget=None)
        self._pad_seconds = _time_padding(kinds, options)
        # Compiles, loads and computes what is needed once, so that no later stage includes it.
        trace, _ = self._bake(widest, self._rows)
        self.options = replace(self.options, front=trace.front, back=trace.back)
        # What a stage takes even without rows follows from half of them.
        half, whole = (
            _growing_seconds(self._bake(widest, rows)[1]) for rows in (self._rows[::2], self._rows)
        )
        self._overhead = min(max(2.0 * half - whole, 0.0), half)

    def try_out(self, max_error: str) -> Candidate:
        """Bake the rows for one bound, and predict the time of the whole bake."""
        trace, stages = self._bake(max_error, self._rows)
        share = sum(len(rows) for rows in self._rows) / self.options.height_px
        growing = _growing_seconds(stages)
        fixed = sum(record.seconds for record in stages.records) - growing
        grown = max(growing - self._overhead, 0.0) / share
        n_covered = int(np.count_nonzero(trace.texel_faces != NO_FACE))
        return Candidate(
            max_error,
            predicted_seconds=fixed + self._overhead + grown + self._pad_seconds,
            rays_per_texel=trace.counts.rays_cast / max(n_covered, 1),
        )

    def _bake(self, max_error: str, rows: list[range]) -> tuple[Trace, Stages]:
        options = replace(self.options, samples=ADAPTIVE, max_error=max_error)
        # Normals and tangents of the meshes are computed once and kept for the bake itself.
        inputs = self.inputs = self.inputs.with_options(options)
        stages = Stages()
        secondary = SecondaryRays.for_maps((kind.needs for kind in self._kinds), inputs)
        trace = Trace(
            inputs.high, inputs.low, options, self._cage, stages, secondary, self._ray_maps,
            self._scenes,
        )  # fmt: skip
        samples = AdaptiveSamples(self._kinds, trace, inputs, stages, DistanceSummary(), rows=rows)
        samples.cast(TexelSums(self._kinds, inputs))
        return trace, stages


def _growing_seconds(stages: Stages) -> float:
    """Seconds of the stages that take longer for more rows."""
    return sum(record.seconds for record in stages.records if record.name not in _FIXED)


def _strips(height: int) -> list[range]:
    """Rows of the probe, spread evenly; all rows of a map that has no more than they are."""
    if height <= _STRIPS * _STRIP_ROWS:
        return [range(height)]
    middles = ((np.arange(_STRIPS) + 0.5) * height / _STRIPS).astype(int).tolist()
    return [range(m - _STRIP_ROWS // 2, m + _STRIP_ROWS // 2) for m in middles]


def _time_padding(kinds: list[MapKind], options: BakeOptions) -> float:
    """Predict how long padding and filling all maps takes, from a small disk of texels."""
    small = replace(options, size=_PAD_SIZE)
    across = np.linspace(-1.0, 1.0, _PAD_SIZE)
    inside = np.hypot(across, across[:, np.newaxis]) < 0.75
    charts = np.where(inside, np.int32(0), np.int32(NO_FACE))
    seconds = 0.0
    for _ in range(2):  # the first time compiles and loads
        start = time.perf_counter()
        around = ChartPadding(charts, inside, small)
        for kind in kinds:
            values = np.zeros((_PAD_SIZE, _PAD_SIZE, kind.channels), dtype=np.float32)
            around.pad(values, kind.neutral(small), kind.combine)
        seconds = time.perf_counter() - start
    return seconds * options.width_px * options.height_px / _PAD_SIZE**2
