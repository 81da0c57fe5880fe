"""The maps of a bake whose errors are bounded, and what the report says of them."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from texbake.baking.inputs import BakeInputs
from texbake.baking.maps import MapKind
from texbake.core import portable_math as pm
from texbake.errors import OptionError
from texbake.mesh.mesh import IntArray
from texbake.sampling.bounds import BOUNDED_CODINGS, ErrorBounds
from texbake.sampling.report import (
    ErrorSummary,
    SamplingReport,
    format_percents,
    percent_within,
    percentiles_of,
)


@dataclass(frozen=True)
class BoundedMap:
    """A map whose values must be within a bound of the mean over each texel."""

    kind: MapKind
    bound: float  # greatest length of the difference between two values

    @property
    def unit(self) -> str:
        """Unit in which errors of the map are reported."""
        return "deg" if self.kind.coding == "normal" else "model units"

    def in_unit(self, differences: npt.NDArray[Any]) -> npt.NDArray[np.float64]:
        """Convert differences between values to errors in `unit`."""
        if self.kind.coding != "normal":
            return np.asarray(differences, dtype=np.float64)
        return np.asarray(np.degrees(2.0 * pm.arcsin(np.minimum(differences / 2.0, 1.0))))

    def summary(self, errors: npt.NDArray[Any], differences: npt.NDArray[Any]) -> ErrorSummary:
        """Summarize the errors of the map.

        `errors` (n_texels,): as estimated, in multiples of the bound; `differences` (n_checked,):
        lengths of the differences from the check.
        """
        measured, bound = self.in_unit(differences), float(self.in_unit(np.array(self.bound)))
        estimated = percentiles_of(errors * self.bound)
        return ErrorSummary(
            name=self.kind.name,
            unit=self.unit,
            bound=bound,
            estimated={n: float(self.in_unit(np.array(e))) for n, e in estimated.items()},
            measured=percentiles_of(measured),
            measured_within_percent=percent_within(measured, bound),
        )


def bounded_maps(kinds: list[MapKind], inputs: BakeInputs, bounds: ErrorBounds) -> list[BoundedMap]:
    """Return the maps of a bake whose errors are bounded.

    Maps of secondary rays are not among them: their error comes from the number of these rays, and
    more samples per texel would only spread it.
    """
    bounded = []
    for kind in kinds:
        bound = bounds.of_map(kind.coding, inputs.low.diagonal)
        # A share of a mesh without extent is no length.
        if bound is not None and bound >= sys.float_info.min and kind.needs == "hits":
            bounded.append(BoundedMap(kind, bound))
    if not bounded:
        names = ", ".join(kind.name for kind in kinds)
        if not any(kind.coding in BOUNDED_CODINGS and kind.needs == "hits" for kind in kinds):
            raise OptionError(
                "max_error, time_budget, samples: adaptive samples are for normals and "
                f"displacements, and bound nothing of {names}; give a number of `samples`"
            )
        raise OptionError(
            f"max_error: {bounds} bounds nothing of {names}; "
            "give an angle for normals, a length for displacements"
        )
    return bounded


@dataclass(frozen=True, eq=False)
class Metric:
    """Measures differences of values in multiples of the error that each map is allowed."""

    firsts: IntArray  # (maps + 1,) int32; first channel of each map, then the number of channels
    # (maps,) float64; 1 / bound of each map; 0 for maps without a bound.
    scales: npt.NDArray[np.float64]

    @property
    def arrays(self) -> tuple[IntArray, npt.NDArray[np.float64]]:
        """The fields in the order in which kernels take them."""
        return self.firsts, self.scales


def metric_of(bounded: list[BoundedMap], kinds: list[MapKind]) -> Metric:
    """Return the metric of some bounds for the values of all maps, side by side."""
    bounds = {item.kind: item.bound for item in bounded}
    firsts = np.cumsum([0, *(kind.channels for kind in kinds)]).astype(np.int32)
    # Heights of a mesh without any size are all alike, and a share of that size bounds nothing.
    scales = [1.0 / bounds[kind] if bounds.get(kind) else 0.0 for kind in kinds]
    return Metric(firsts, np.array(scales))


@dataclass(frozen=True, kw_only=True)
class BakeSampling(SamplingReport):
    """What the adaptive samples of a bake achieved.

    A divided texel counts by its finest samples, as if it had been sampled that finely throughout.
    """

    rays_per_texel: float  # rays cast for the maps, per texel with data
    rays_of_check: int  # rays cast for the check
    unbounded: tuple[str, ...] = ()  # maps without a bound, made from the samples of the others

    element: ClassVar[str] = "texel"
    most_samples: ClassVar[int] = 64

    @property
    def warnings(self) -> list[str]:
        """One if 64 samples were too few for many texels, and one if a map has no bound."""
        if not self.unbounded:
            return super().warnings
        names = ", ".join(self.unbounded)
        return [
            f"{self.max_error} bounds nothing of {names}: what the other maps need decides on its "
            "samples, whatever its own errors are",
            *super().warnings,
        ]

    def table(self) -> list[tuple[str, str]]:
        """Rows of a label and a figure, to print."""
        samples = (
            f"{format_percents(self.sample_percents)}; {self.rays_per_texel:.2f} rays per texel"
        )
        return [("samples per texel", samples), *super().table()]
