"""The best bake that is predicted to fit into a time, from a short probe on the very meshes.

Some rows of the map that is asked for are baked, first with the widest of a ladder of bounds, then
with closer ones, each half of the one before. The stages of a bake fall into those that the number
of texels does not change, which the probe has in full, and those that grow with the rows, which it
has in part, beside what they take for none, which half of the rows tell; padding is timed on a
small map. The closest bound whose prediction fits is taken, and
the distances of rays that the probe measured are not measured again.
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from texbake.baking.adaptive import AdaptiveSamples
from texbake.baking.budget_report import BudgetReport, Candidate
from texbake.baking.inputs import BakeInputs
from texbake.baking.maps.kind import MapKind
from texbake.baking.options import ADAPTIVE, BakeOptions
from texbake.baking.ray_maps import RayMaps
from texbake.baking.report import DistanceSummary
from texbake.baking.secondary.rays import SecondaryRays
from texbake.baking.sums import TexelSums
from texbake.baking.surround import Surroundings
from texbake.baking.targets import parse_bounds
from texbake.baking.texels import NO_FACE
from texbake.baking.trace import Trace
from texbake.durations import parse_seconds
from texbake.mesh.mesh import Mesh
from texbake.progress import Stages
from texbake.time_budgets import PROBE_SHARE, why_not

# The closest bound that a budget is spent on where none is asked for: below 8-bit rounding.
_CLOSEST = "0.125deg,0.0025%"
_HALVINGS = 6  # of the bound, from the widest to the closest
_STRIPS = 8
_STRIP_ROWS = 16
_PAD_SIZE = 256
# Stages that take their time whatever the number of texels.
_FIXED = ("build ray tree", "measure distances", "prepare light mesh")


def plan_bake(
    inputs: BakeInputs,
    kinds: list[MapKind],
    cage: Mesh | None,
    ray_maps: RayMaps | None = None,
) -> tuple[BakeInputs, BudgetReport]:
    """Options that are predicted to fit into `BakeOptions.time_budget`, and what was predicted.

    Returns
    -------
    inputs : BakeInputs
        Its options are without a time budget, with a bound or one sample a texel, and with the
        distances that were measured.
    report : BudgetReport
        Without the actual time.

    Raises
    ------
    UvError, CageError, OptionError
        As the bake would.
    """
    start = time.perf_counter()
    options = inputs.options
    assert options.time_budget is not None
    seconds = parse_seconds(options.time_budget)
    closest = parse_bounds(options.max_error or _CLOSEST)
    widest = str(closest.scaled(2.0**_HALVINGS))
    probe = _Probe(inputs, kinds, (cage, ray_maps), widest)
    candidates: list[Candidate] = []
    chosen: Candidate | None = None
    why = "the closest bound of the ladder"
    for k in range(_HALVINGS, -1, -1):
        candidate = probe.candidate(str(closest.scaled(2.0**k)))
        candidates.append(candidate)
        spent = time.perf_counter() - start
        reason = why_not(
            candidate.max_error,
            spent=spent,
            predicted=candidate.predicted_seconds,
            seconds=seconds,
        )
        if reason is not None:
            why = reason
            break
        chosen = candidate
        if k > 0 and spent > PROBE_SHARE * seconds:
            why = "because closer bounds would spend more of the budget on looking for them"
            break
    spent = time.perf_counter() - start
    planned = probe.options
    if chosen is None:
        predicted = candidates[0].predicted_seconds  # at most
        planned = replace(planned, samples=1, max_error=None)
        choice, why = "1 sample a texel", f"{why}, and even one sample may take longer"
    else:
        predicted = chosen.predicted_seconds
        planned = replace(planned, samples=ADAPTIVE, max_error=chosen.max_error)
        choice = f"max-error {chosen.max_error}"
    report = BudgetReport(
        seconds=seconds,
        choice=choice,
        why=why,
        probe_seconds=spent,
        predicted_seconds=spent + predicted,
        candidates=candidates,
    )
    return probe.inputs.with_options(planned), report


class _Probe:
    """Bakes some rows of a map and tells how long all of them would take.

    Attributes
    ----------
    options : BakeOptions
        Without a budget, with the distances that were measured.
    inputs : BakeInputs
        With all that the maps ask for.
    """

    def __init__(
        self,
        inputs: BakeInputs,
        kinds: list[MapKind],
        shaping: tuple[Mesh | None, RayMaps | None],
        widest: str,
    ) -> None:
        options = inputs.options
        self._kinds = kinds
        self._cage, self._ray_maps = shaping
        self.inputs = inputs
        self._rows = _strips(options.height_px)
        self.options = replace(options, time_budget=None)
        self._pad_seconds = _time_padding(kinds, options)
        # Compiles, loads and computes what is needed once, so that no later stage has it.
        trace, _ = self._bake(widest, self._rows)
        self.options = replace(self.options, front=trace.front, back=trace.back)
        # What a stage takes beside its rows: from half of them.
        half, whole = (
            _growing_seconds(self._bake(widest, rows)[1]) for rows in (self._rows[::2], self._rows)
        )
        self._overhead = min(max(2.0 * half - whole, 0.0), half)

    def candidate(self, max_error: str) -> Candidate:
        """Look at one bound."""
        trace, stages = self._bake(max_error, self._rows)
        share = sum(len(rows) for rows in self._rows) / self.options.height_px
        growing = _growing_seconds(stages)
        fixed = sum(record.seconds for record in stages.records) - growing
        grown = max(growing - self._overhead, 0.0) / share
        seconds = fixed + self._overhead + grown + self._pad_seconds
        n_covered = int(np.count_nonzero(trace.texel_faces != NO_FACE))
        return Candidate(max_error, trace.counts.rays_cast / max(n_covered, 1), seconds)

    def _bake(self, max_error: str, rows: list[range]) -> tuple[Trace, Stages]:
        options = replace(self.options, samples=ADAPTIVE, max_error=max_error)
        # Normals and tangents of the meshes are computed once and kept for the bake itself.
        inputs = self.inputs = self.inputs.with_options(options)
        stages = Stages()
        secondary = SecondaryRays.for_maps((kind.needs for kind in self._kinds), inputs)
        trace = Trace(
            inputs.high, inputs.low, options, self._cage, stages, secondary, self._ray_maps
        )
        samples = AdaptiveSamples(self._kinds, trace, inputs, stages, DistanceSummary(), rows=rows)
        samples.cast(TexelSums(self._kinds, inputs))
        return trace, stages


def _growing_seconds(stages: Stages) -> float:
    """Seconds of the stages that take longer for more rows."""
    return sum(record.seconds for record in stages.records if record.name not in _FIXED)


def _strips(height: int) -> list[range]:
    """Rows of the probe, spread evenly; all of a map that is not higher than they are."""
    if height <= _STRIPS * _STRIP_ROWS:
        return [range(height)]
    middles = ((np.arange(_STRIPS) + 0.5) * height / _STRIPS).astype(int).tolist()
    return [range(m - _STRIP_ROWS // 2, m + _STRIP_ROWS // 2) for m in middles]


def _time_padding(kinds: list[MapKind], options: BakeOptions) -> float:
    """Seconds that padding and filling all maps will take, from a small disk of texels."""
    small = replace(options, size=_PAD_SIZE)
    across = np.linspace(-1.0, 1.0, _PAD_SIZE)
    inside = np.hypot(across, across[:, np.newaxis]) < 0.75
    charts = np.where(inside, np.int32(0), np.int32(NO_FACE))
    seconds = 0.0
    for _ in range(2):  # the first time compiles and loads
        start = time.perf_counter()
        around = Surroundings(charts, inside, small)
        for kind in kinds:
            values = np.zeros((_PAD_SIZE, _PAD_SIZE, kind.channels), dtype=np.float32)
            around.filled(values, kind.neutral(small), kind.combine)
        seconds = time.perf_counter() - start
    return seconds * options.width_px * options.height_px / _PAD_SIZE**2
