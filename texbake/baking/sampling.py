"""What a bake with adaptive samples tells of them: how many, how far off, how that was checked."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.baking.inputs import BakeInputs
from texbake.baking.maps.kind import MapKind
from texbake.baking.neighbors import Metric
from texbake.baking.targets import BOUNDED_CODINGS
from texbake.errors import OptionError

_PERCENTILES = (50, 99, 100)
_TOLD_PERCENT = 1.0  # of texels above the bound; less is seen in the report


@dataclass(frozen=True)
class BoundedMap:
    """One map whose values are to be within a bound of the mean over each texel.

    Attributes
    ----------
    kind : MapKind
    bound : float
        Length of the difference of two values that is allowed.
    """

    kind: MapKind
    bound: float

    @property
    def unit(self) -> str:
        """Unit that errors of the map are told in."""
        return "deg" if self.kind.coding == "normal" else "model units"

    def told(self, differences: npt.NDArray[Any]) -> npt.NDArray[np.float64]:
        """Differences of values as errors, in `unit`."""
        if self.kind.coding != "normal":
            return np.asarray(differences, dtype=np.float64)
        return np.asarray(np.degrees(2.0 * np.arcsin(np.minimum(differences / 2.0, 1.0))))

    def told_percentiles(self, differences: npt.NDArray[Any]) -> dict[int, float]:
        """Percent to the error, in `unit`, that so many differences of values do not exceed."""
        found = percentiles_of(differences)
        return {percent: float(self.told(np.array(value))) for percent, value in found.items()}


def bounded_maps(kinds: list[MapKind], inputs: BakeInputs) -> list[BoundedMap]:
    """Return those maps of a bake that `BakeOptions.max_error` bounds.

    What secondary rays find is not among them: its error is their number's, which more samples of
    a texel would only spread.

    Raises
    ------
    OptionError
        There is none.
    """
    bounds = inputs.options.error_bounds
    found = []
    for kind in kinds:
        bound = bounds.of_map(kind.coding, inputs.low.diagonal)
        if bound is not None and kind.needs == "hits":
            found.append(BoundedMap(kind, bound))
    if not found:
        names = ", ".join(kind.name for kind in kinds)
        if not any(kind.coding in BOUNDED_CODINGS and kind.needs == "hits" for kind in kinds):
            raise OptionError(
                "max-error, time-budget, adaptive samples: they are for normals and displacements, "
                f"and bound nothing of {names}; give a number of samples"
            )
        raise OptionError(
            f"max-error: {bounds} bounds nothing of {names}; "
            "give an angle for normals, a length for displacements"
        )
    return found


def metric_of(bounded: list[BoundedMap], kinds: list[MapKind]) -> Metric:
    """How differences of the values of all maps, beside each other, are measured by some bounds."""
    bounds = {item.kind: item.bound for item in bounded}
    firsts = np.cumsum([0, *(kind.channels for kind in kinds)]).astype(np.int32)
    scales = [1.0 / bounds[kind] if kind in bounds else 0.0 for kind in kinds]
    return Metric(firsts, np.array(scales))


@dataclass(frozen=True)
class MapErrors:
    """Errors of one map's texels, in `unit`; what other maps are off by is no part of them.

    Attributes
    ----------
    bound : float
    estimated : dict of int to float
        Percent of the texels that have data to an error that they do not exceed, as estimated.
    measured : dict of int to float
        The same of those that were cast again, against that second cast.
    measured_within_percent : float
        How many of these are within the bound.
    """

    name: str
    unit: str
    bound: float
    estimated: dict[int, float]
    measured: dict[int, float]
    measured_within_percent: float

    @classmethod
    def of(
        cls, item: BoundedMap, errors: npt.NDArray[Any], differences: npt.NDArray[Any]
    ) -> MapErrors:
        """Put together estimated errors, in bounds, and differences of values to a second cast."""
        measured, bound = item.told(differences), float(item.told(np.array(item.bound)))
        n_within = int(np.count_nonzero(measured <= bound))
        return cls(
            name=item.kind.name,
            unit=item.unit,
            bound=bound,
            estimated=item.told_percentiles(errors * item.bound),
            measured=percentiles_of(measured),
            measured_within_percent=100.0 * n_within / max(len(measured), 1),
        )


@dataclass(frozen=True)
class SamplingReport:
    """What adaptive samples reached.

    Attributes
    ----------
    max_error : str
        As asked for, or the default.
    texel_percents : dict of int to float
        Finest samples a texel, as if all of it had them, to percent of the texels that have data.
    rays_per_texel : float
        Cast for the maps, by these texels.
    within_percent : float
        Of these texels, those whose estimated error is within every bound.
    texels_checked, samples_of_check, rays_of_check : int
        Texels that were cast again with so many samples each, which are none of the first.
    maps : list of MapErrors
    unbounded : list of str
        Maps that the samples of the others were used for, and whose errors nothing bounds.
    """

    max_error: str
    texel_percents: dict[int, float]
    rays_per_texel: float
    within_percent: float
    texels_checked: int
    samples_of_check: int
    rays_of_check: int
    maps: list[MapErrors] = field(default_factory=list)
    unbounded: list[str] = field(default_factory=list)

    @property
    def warnings(self) -> list[str]:
        """Says so where 64 samples were too few for many texels, or a map has no bound."""
        found = []
        if self.unbounded:
            found.append(
                f"{self.max_error} bounds nothing of {', '.join(self.unbounded)}: it has the "
                "samples of the other maps, whatever its own errors"
            )
        if self.within_percent < 100.0 - _TOLD_PERCENT:
            found.append(
                f"{100.0 - self.within_percent:.2f} % of the texels are estimated to be off by "
                f"more than {self.max_error} with 64 samples; use a greater --size"
            )
        return found

    def table(self) -> list[tuple[str, str]]:
        """Rows of a label and a figure, for a person."""
        shares = ", ".join(f"{n}: {percent:.1f} %" for n, percent in self.texel_percents.items())
        rows = [("samples by texel", f"{shares}; {self.rays_per_texel:.2f} rays a texel")]
        rows += [
            (
                f"error of {item.name}",
                f"estimated {_ends(item.estimated)} {item.unit}, checked on "
                f"{self.texels_checked:,} texels {_ends(item.measured)}, "
                f"{item.measured_within_percent:.2f} % of them within {item.bound:.4g}",
            )
            for item in self.maps
        ]
        return rows


def _ends(percentiles: dict[int, float]) -> str:
    return " / ".join(f"{value:.3g}" for value in percentiles.values()) + " (median, p99, greatest)"


def percentiles_of(errors: npt.NDArray[Any]) -> dict[int, float]:
    """Percent to the error that so many do not exceed; empty without any."""
    if not len(errors):
        return {}
    values = np.percentile(errors, _PERCENTILES)
    return {percent: float(v) for percent, v in zip(_PERCENTILES, values, strict=True)}
