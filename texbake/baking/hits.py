"""What the rays found: one row a sample, enough to make any map from without a second trace."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.raycast.rays import Rows


@dataclass(frozen=True, eq=False)
class Hits(Rows):
    """The trace of a bake: a row for each sample that a face of the light mesh owns.

    Samples that missed at the first look come last, whether the second look found anything or not.

    Attributes
    ----------
    texel_ids : (n,) int32
        Row times width plus column of the sample's texel, row 0 at the top.
    low_faces : (n,) int32
        Face of the light mesh.
    low_barycentrics : (n, 2) float32
        Weights of that face's second and third corner.
    high_faces : (n,) int32
        Face of the dense mesh, `NO_HIT` for a miss.
    high_barycentrics : (n, 2) float32
        Weights of that face's second and third corner.
    offsets : (n, 3) float32
        From the sample on the light mesh to the point hit, in model units; 0 for a miss.
    secondary : (n, S) float32, optional
        What rays from the points hit have met, where a map needs it; 0 for a miss. Its columns are
        those of `texbake.baking.secondary`.
    """

    texel_ids: npt.NDArray[np.int32]
    low_faces: npt.NDArray[np.int32]
    low_barycentrics: npt.NDArray[np.float32]
    high_faces: npt.NDArray[np.int32]
    high_barycentrics: npt.NDArray[np.float32]
    offsets: npt.NDArray[np.float32]
    secondary: npt.NDArray[np.float32] | None = None
