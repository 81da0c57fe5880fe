"""Texels refined in rounds, each to a closer bound, until the time of a bake is spent.

The tree and the first samples of all texels are those of the whole bake, and each round uses all
samples of those before. The steps after sampling, such as padding and writing the maps, are timed
on some rows of the maps that the first samples give.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from texbake.baking.adaptive_texels.coverage import N_CHECK_SAMPLES
from texbake.baking.adaptive_texels.texel_error import (
    FOUR_SAMPLES,
    ONE_SAMPLE,
    Refinement,
    bounded_maps,
    estimate_for,
    refine,
)
from texbake.baking.adaptive_texels.texel_sampler import (
    LAST_LEVEL,
    NO_CHART,
    Division,
    TexelSampler,
)
from texbake.baking.maps import MapKind
from texbake.baking.options import BakeOptions
from texbake.baking.texel_values import TexelSums, finished_maps
from texbake.mesh.mesh import Float32Array
from texbake.progress import Stages
from texbake.sampling.bounds import BOUNDED_CODINGS, ErrorBounds, parse_bounds
from texbake.sampling.report import n_to_check
from texbake.sampling.rounds import BudgetClock, OutOfTimeError, Rounds, TimeBudget, spread_rows

# The closest bounds where none is given: about what 16-bit maps round off.
_CLOSEST = ErrorBounds(angle=math.radians(0.004), share=1e-6)
# Factor by which errors fall with four times the samples, beyond four.
_FALL = np.float32(5.0)
# Measured: what rounds cost, as a multiple of what the errors predict: cells are judged
# more strictly than texels.
_GROWTHS = 1.2, 2.0
# Share of the rows on which what follows the samples is timed, and how many at least.
_TIMED_SHARE, _TIMED_ROWS, _TIMED_RUNS = 1 / 16, 128, 8
# Samples of the check lie far apart, and take this many times as long as others.
_CHECK_COST = 1.3
# The work of more texels than this is predicted from some of them, with an error below 1 %.
_MOST_PREDICTED = 1 << 18
# Seconds to estimate all errors of a round, in those to estimate errors from the first samples.
_ESTIMATES = 2.0
# Share of the first samples after which their time is predicted, and how far it may be off.
_EARLY, _EARLY_MARGIN = 1 / 4, 1.15


class TexelRounds:
    """Refines texels until the time of a bake is spent."""

    def __init__(self, sampler: TexelSampler, options: BakeOptions, clock: BudgetClock) -> None:
        assert options.time_budget is not None
        self._sampler, self._options, self._clock = sampler, options, clock
        self._closest = _closest_bounds(sampler.kinds, options.max_error)
        self._rounds = Rounds(options.time_budget, "the bake", clock, _GROWTHS)
        self._refined: Refinement | None = None
        self._bound = 0.0  # of what is refined
        self._divisions: list[Division] = []  # the last that is complete, and those given up since
        self._level_start = self._sampling = 0.0

    def run(self) -> tuple[Refinement, TimeBudget]:
        """Take all samples; return what they have given."""
        self._predict_least(self._take_first())
        self._sampler.watch = self._watch
        report = self._rounds.run(self)
        self._sampler.watch = None
        if len(self._divisions) > 1:
            self._sampler.cells.restore(self._divisions[0])
        assert self._refined is not None
        return self._refined, report

    def name_of(self, bound: float) -> str:
        """Return a bound as the value of `max_error`."""
        return str(self._closest.scaled(bound))

    def refine(self, bound: float) -> None:
        """Divide the texels again, and cast the samples that are missing."""
        sampler, max_error = self._sampler, self.name_of(bound)
        sampler.cells.restart(self._divisions)
        try:
            bounded = bounded_maps(sampler.kinds, sampler.inputs, parse_bounds(max_error))
            self._refined = refine(sampler, bounded, max_error)
        except OutOfTimeError:
            self._divisions = [*self._divisions, sampler.cells.division]
            raise
        self._bound, self._divisions = bound, [sampler.cells.division]

    def predicted_errors(self) -> tuple[Float32Array, Float32Array]:
        """Return estimated errors in closest bounds, and the samples that each costs."""
        if self._refined is None:
            return self._first_errors
        return _further(self._refined, self._bound)

    def work_done(self) -> tuple[float, float]:
        """Return the number of rays, and the seconds of levels that were cast whole."""
        return self._sampler.trace.counts.rays_cast, self._sampling

    def _watch(self, share: float, n_left: int) -> None:
        """Give up a round if its current level would take too long."""
        if share == 0.0:
            self._level_start = self._clock.spent
            self._rounds.check(self._rounds.unit * n_left)
        else:
            seconds = self._clock.spent - self._level_start
            self._sampling += seconds if share == 1.0 else 0.0
            self._rounds.check(seconds * (1.0 - share) / share)

    def _take_first(self) -> float:
        """Take the first sample of each texel; return the seconds that each took."""
        sampler, rounds = self._sampler, self._rounds
        rounds.before = start = self._clock.spent

        def watch(share: float, _: int) -> None:
            if share >= _EARLY:
                predicted = start + (self._clock.spent - start) / share
                rounds.expect_at_least(predicted, margin=_EARLY_MARGIN)

        sampler.watch = watch
        sampler.cast_texels()
        return (self._clock.spent - start) / max(sampler.trace.counts.rays_cast, 1)

    def _predict_least(self, unit: float) -> None:
        """Estimate the errors of the first samples, and predict the rest of the least bake."""
        sampler, start = self._sampler, self._clock.spent
        with sampler.stages.part("estimate errors"):
            bounded = bounded_maps(sampler.kinds, sampler.inputs, self._closest)
            _, steps = estimate_for(sampler, bounded).of_samples()
            self._first_errors = errors, costs = _of_first_samples(steps)
        estimate = self._clock.spent - start
        n_covered = int(np.count_nonzero(sampler.cells.charts[: len(steps)] != NO_CHART))
        check = unit * _CHECK_COST * n_to_check(n_covered) * N_CHECK_SAMPLES
        with sampler.stages.stage("time what follows"):
            after = self._time_finishing() + check + estimate * len(bounded)
        self._rounds.learn_first(
            unit=unit,
            total=max(sampler.trace.counts.rays_cast, 1),
            overhead=_ESTIMATES * estimate,
            after=after,
            certain=unit * float(costs[np.isinf(errors)].sum()),
        )

    def _time_finishing(self) -> float:
        """Predict how long padding, and what the clock includes beside the bake, will take."""
        height = self._sampler.shape[0]
        self._finish(16)  # loads what is needed
        n_rows = min(max(int(_TIMED_SHARE * height), _TIMED_ROWS), height)
        start = self._clock.spent
        n_rows = self._finish(n_rows)
        return (self._clock.spent - start) * height / n_rows

    def _finish(self, n_rows: int) -> int:
        """Make maps of some rows from the first samples; return how many rows they are."""
        sampler, options = self._sampler, self._options
        height, width = sampler.shape
        rows = np.concatenate(spread_rows(height, n_rows, _TIMED_RUNS))
        texels = (rows[:, np.newaxis] * width + np.arange(width)).reshape(-1)
        inputs = sampler.inputs.with_options(replace(options, size=(width, len(rows))))
        has_data = sampler.cells.charts[texels] != NO_CHART
        values = sampler.cells.values[texels]
        values[~has_data] = 0.0
        sums = TexelSums(sampler.kinds, inputs)
        means = {kind: values[:, channels].copy() for kind, channels in sampler.channels()}
        sums.place(means, has_data)
        charts = sampler.inputs.texel_charts(sampler.trace.texel_faces[rows])
        covered = has_data.reshape(len(rows), width)
        maps, _ = finished_maps(sampler.kinds, sums.means, charts, covered, inputs, Stages())
        if self._clock.finish is not None:
            self._clock.finish(maps)
        return len(rows)


def _closest_bounds(kinds: list[MapKind], max_error: str | None) -> ErrorBounds:
    """Return the closest bounds that are wanted; by default, of the maps that are made."""
    if max_error is not None:
        return parse_bounds(max_error)
    has_normals = [kind.coding == "normal" for kind in kinds if kind.coding in BOUNDED_CODINGS]
    if all(has_normals):
        return replace(_CLOSEST, share=None)
    return _CLOSEST if any(has_normals) else replace(_CLOSEST, angle=None)


def _of_first_samples(steps: Float32Array) -> tuple[Float32Array, Float32Array]:
    """Errors of first samples above the closest bound, and the samples that each of them costs."""
    every = _texels_per_predicted(len(steps))
    steps = steps[::every]
    steps = steps[ONE_SAMPLE * steps > 1.0]
    four = np.float32(FOUR_SAMPLES) * steps
    errors = np.concatenate([ONE_SAMPLE * steps, four, four / _FALL])
    costs = np.repeat(np.array([4.0, 12.0, 48.0], dtype=np.float32), len(steps))
    return errors, np.float32(every) * costs


def _texels_per_predicted(n_texels: int) -> int:
    # Odd, so that the texels lie in all columns.
    return n_texels // _MOST_PREDICTED * 2 + 1


def _further(refined: Refinement, bound: float) -> tuple[Float32Array, Float32Array]:
    """Errors after a round, in closest bounds, and the samples that each of them costs next."""
    every = _texels_per_predicted(len(refined.errors))
    errors = np.float32(bound) * refined.errors[::every]
    is_far = errors > 1.0
    errors, levels = errors[is_far], refined.finest[::every][is_far]
    firsts, costs = _of_first_samples(errors[levels == 0] / ONE_SAMPLE)
    four, sixteen = errors[levels == 1], errors[levels == LAST_LEVEL - 1]
    more = np.repeat(
        np.array([16.0, 48.0, 24.0], dtype=np.float32), [len(four), len(four), len(sixteen)]
    )
    costs = np.float32(every) * np.concatenate([costs, more])
    return np.concatenate([firsts, four, four / _FALL, sixteen]), costs
