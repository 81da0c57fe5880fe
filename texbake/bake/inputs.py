"""What maps are made from beside the hits; each part is computed when a map first asks for it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from texbake.bake.options import BakeOptions
from texbake.bake.rays import ray_normals
from texbake.mapping.seams import chart_ids
from texbake.mesh.mesh import FloatArray, IntArray, Mesh, frozen
from texbake.mesh.normals import flat_normals, shading_normals
from texbake.mesh.tangents import corner_tangents


@dataclass(frozen=True, eq=False)
class BakeInputs:
    """The two meshes of a bake with their normals and tangents, in model space."""

    high: Mesh
    low: Mesh
    options: BakeOptions

    def with_options(self, options: BakeOptions) -> BakeInputs:
        """Return the same with other options; parts that these leave as they are stay computed."""
        inputs = BakeInputs(self.high, self.low, options)
        if options.high_shading == self.options.high_shading:
            inputs.__dict__.update({**self.__dict__, "options": options})
        return inputs

    @cached_property
    def high_normals(self) -> tuple[npt.NDArray[np.float32], IntArray]:
        """(N, 3) float32 shading normals of the dense mesh and (F, 3) indices."""
        make = flat_normals if self.options.high_shading == "flat" else shading_normals
        normals, corners = make(self.high, threads=self.options.threads)
        return frozen(normals.astype(np.float32)), frozen(corners)

    @cached_property
    def low_normals(self) -> tuple[FloatArray, IntArray]:
        """(N, 3) float64 shading normals of the light mesh and (F, 3) indices."""
        normals, corners = shading_normals(self.low, threads=self.options.threads)
        return frozen(normals), frozen(corners)

    @cached_property
    def low_tangents(self) -> npt.NDArray[np.float32]:
        """(F, 3, 4) float32 corner tangents of the light mesh: the file's, else MikkTSpace's."""
        tangents = self.low.tangents
        return frozen(corner_tangents(self.low) if tangents is None else tangents)

    @cached_property
    def low_charts(self) -> IntArray:
        """(F,) int32 chart of each face of the light mesh."""
        return chart_ids(self.low)

    @cached_property
    def displacement_normals(self) -> tuple[FloatArray, IntArray]:
        """(N, 3) float64 directions that a displaced light mesh moves along and (F, 3) indices."""
        normals, corners = ray_normals(self.low, "smooth")
        return frozen(normals), frozen(corners)
