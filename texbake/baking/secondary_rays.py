"""Hemispheres of rays from hits, for ambient occlusion, bent normals and thickness.

The rays start at the points hit, on the high-poly surface. They are cast once, however many maps
need them, and what they meet is kept in the columns of `Hits.secondary`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from texbake.baking.hits import Hits
from texbake.baking.inputs import BakeInputs
from texbake.baking.maps.kind import INNER, OUTER, MapKind
from texbake.baking.scenes import BakeScenes
from texbake.core import core
from texbake.mesh.mesh import IntArray
from texbake.parallel import run_bands
from texbake.raycast.rays import (
    DEPTH,
    N_COLUMNS,
    OPEN,
    Hemispheres,
    OcclusionRange,
    direction_sets,
    mixed,
)
from texbake.records import dataclass

_BAND = 1 << 15
_BLOCK = 4  # texels along the side of a square that shares a net of directions
# How far above the surface rays start, in local units. The normal of a face is rounded to float32,
# so a ray along its plane may sink by 2^-24 of its length along each axis, and its length in the
# unit cube is at most the square root of 3.
_START_OFFSET = 3.0 * 2.0**-24


@dataclass(frozen=True, eq=False)
class SecondaryRays:
    """The rays that the maps of a bake need from its hits."""

    inputs: BakeInputs
    scenes: BakeScenes
    needs: frozenset[str]  # `OUTER`, `INNER` or both

    @classmethod
    def for_maps(
        cls, kinds: Iterable[MapKind], inputs: BakeInputs, scenes: BakeScenes
    ) -> SecondaryRays | None:
        """Return the rays for some maps; None if none of them needs any."""
        used = frozenset(kind.needs for kind in kinds) & {OUTER, INNER}
        return cls(inputs, scenes, used) if used else None

    @property
    def occlusion_range(self) -> OcclusionRange:
        """How far above the surface the rays start, and how far they go."""
        options, scale = self.inputs.options, self.scenes.frame.scale
        outer = math.inf if options.occluder_distance is None else options.occluder_distance
        inner = options.thickness_distance or self.inputs.high.diagonal
        return OcclusionRange(
            _START_OFFSET,
            outer * scale if OUTER in self.needs else 0.0,
            inner * scale if INNER in self.needs else 0.0,
        )

    def cast(self, hits: Hits, n_samples: int) -> tuple[Hits, int]:
        """Return the hits with what their secondary rays met, and the number of rays cast."""
        options, scenes, frame = self.inputs.options, self.scenes, self.scenes.frame
        met = np.zeros((len(hits), N_COLUMNS), dtype=np.float32)
        is_hit = hits.is_hit
        found = hits if is_hit.all() else hits.where(is_hit)
        hemispheres = self.hemispheres(found, n_samples)
        n_rays = max(1, options.secondary_rays // n_samples)
        has_axis = np.asarray(hemispheres.axes.any(axis=1))
        if not has_axis.all():
            hemispheres = hemispheres.where(has_axis)
            # A point without a normal counts as open, without depth, and has no direction.
            met[is_hit, OPEN] = 1.0
            is_hit[is_hit] = has_axis
        if len(hemispheres):
            scene = scenes.occluders or scenes.high
            sets = direction_sets(n_rays, n_samples * _BLOCK**2)
            met[is_hit] = scene.cast_hemispheres(hemispheres, sets, self.occlusion_range)
        met[:, DEPTH] /= np.float32(frame.scale)
        return replace(hits, secondary=met), len(hemispheres) * n_rays * len(self.needs)

    def hemispheres(self, hits: Hits, n_samples: int) -> Hemispheres:
        """Hemispheres from hits without misses, for samples per texel; `core/single_rays.c`."""
        options, high, frame = self.inputs.options, self.inputs.high, self.scenes.frame
        normals = self.inputs.high_surface.normals
        n = len(hits)
        hemispheres = Hemispheres(
            np.empty((n, 3)),
            np.empty((n, 3), dtype=np.float32),
            np.empty((n, 3), dtype=np.float32),
            np.empty(n, dtype=np.uint32),
        )

        def fill(start: int, stop: int) -> None:
            band = slice(start, stop)
            core.place_hemispheres(
                hits.high_faces[band],
                hits.high_barycentrics[band],
                high.positions,
                high.faces,
                frame.center,
                frame.scale,
                *normals,
                hemispheres.points[band],
                hemispheres.axes[band],
                hemispheres.planes[band],
            )

        hemispheres.set_ids[:] = _shared_set_ids(hits.texel_ids, options.width_px, n_samples)
        run_bands(fill, n, band=_BAND, threads=options.threads)
        return hemispheres


def _shared_set_ids(texel_ids: IntArray, width: int, n_samples: int) -> npt.NDArray[np.uint32]:
    """Parts of the net for the samples of each texel, chosen by a hash of the texel's square."""
    rows, columns = np.divmod(texel_ids.view(np.uint32), np.uint32(width))
    part = np.zeros_like(rows)
    for bit in (np.uint32(1), np.uint32(0)):  # the squares of 2 x 2 follow each other
        part = part << 2 | (rows >> bit & 1) << 1 | (columns >> bit & 1)
    ids = mixed(mixed(rows // _BLOCK) ^ columns // _BLOCK) * np.uint32(_BLOCK**2) + part
    if n_samples == 1:
        return np.asarray(ids)
    order = np.argsort(texel_ids, kind="stable")
    ordered = texel_ids[order]
    first = np.flatnonzero(np.diff(ordered, prepend=-1))
    ranks = np.empty(len(order), dtype=np.uint32)
    ranks[order] = np.arange(len(order)) - np.repeat(first, np.diff(first, append=len(order)))
    n_parts = np.uint32(n_samples)
    return np.asarray(ids * n_parts + ranks % n_parts)
