"""The secondary rays of a bake: which are needed, how far they go, and what they met."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
import numpy.typing as npt

from texbake.baking.hits import Hits
from texbake.baking.inputs import BakeInputs
from texbake.baking.secondary.fans import fans_of, start_offset
from texbake.errors import OptionError
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import Mesh
from texbake.raycast.fans import DEPTH, N_COLUMNS, OPEN, Fans, OcclusionRange, direction_sets
from texbake.raycast.rays import NO_HIT

Float32Array = npt.NDArray[np.float32]

OUTER, INNER = "outer rays", "inner rays"  # what `MapKind.needs` says


class FanCaster(Protocol):
    """Casts fans of rays at the occluders; every caster of the bake can."""

    def cast_fans(self, fans: Fans, sets: Float32Array, reach: OcclusionRange) -> Float32Array:
        """Cast all rays; (n, N_COLUMNS), as `texbake.baking.secondary` says."""


@dataclass(frozen=True, eq=False)
class SecondaryRays:
    """What the maps of a bake want to know of the surroundings of its hits.

    Attributes
    ----------
    inputs : BakeInputs
    needs : frozenset of str
        `OUTER`, `INNER` or both.
    """

    inputs: BakeInputs
    needs: frozenset[str]

    @classmethod
    def for_maps(cls, needs: Iterable[str], inputs: BakeInputs) -> SecondaryRays | None:
        """Rays for maps that need so much of the trace; None where none needs any."""
        wanted = frozenset(needs) & {OUTER, INNER}
        return cls(inputs, wanted) if wanted else None

    @property
    def n_rays(self) -> int:
        """Rays that each hit gets."""
        return self.inputs.options.secondary_rays * len(self.needs)

    def reach(self, frame: LocalFrame, occluders: Mesh | None = None) -> OcclusionRange:
        """How far they go, and from where; the occluders are the dense mesh if not given."""
        options = self.inputs.options
        outer = math.inf if options.occluder_distance is None else options.occluder_distance
        inner = options.thickness_distance or self.inputs.high.diagonal
        return OcclusionRange(
            start_offset(occluders or self.inputs.high, frame),
            outer * frame.scale if OUTER in self.needs else 0.0,
            inner * frame.scale if INNER in self.needs else 0.0,
        )

    def look_around(
        self, hits: Hits, frame: LocalFrame, caster: FanCaster, reach: OcclusionRange
    ) -> tuple[Hits, int]:
        """Hits with what their secondary rays met, and the number of rays that were cast."""
        options = self.inputs.options
        met = np.zeros((len(hits), N_COLUMNS), dtype=np.float32)
        is_hit = hits.high_faces != NO_HIT
        found = hits if is_hit.all() else hits.where(is_hit)
        fans = fans_of(
            found, self.inputs.high, self.inputs.high_normals, frame, threads=options.threads
        )
        has_axis = np.asarray(fans.axes.any(axis=1))
        if not has_axis.all():
            fans = fans.where(has_axis)
            # What faces nowhere is open and without depth; it has no direction.
            met[is_hit, OPEN] = 1.0
            is_hit[is_hit] = has_axis
        if len(fans):
            met[is_hit] = caster.cast_fans(fans, direction_sets(options.secondary_rays), reach)
        met[:, DEPTH] /= np.float32(frame.scale)
        return replace(hits, secondary=met), len(fans) * self.n_rays


def met_by(hits: Hits, columns: int | slice, name: str) -> Float32Array:
    """Columns of what secondary rays met, for a map of that name.

    Raises
    ------
    OptionError
        The trace that was kept has no such rays.
    """
    met = None if hits.secondary is None else hits.secondary[:, columns]
    if met is None or (len(met) and np.isnan(met).any()):
        raise OptionError(
            f"{name}: the trace that was kept has no rays for it; bake with it among the maps"
        )
    return met
