"""The visibility buffer: which triangle each sample sees, and how near it is.

Based on: Burns and Hunt, "The visibility buffer: a cache-friendly approach to deferred shading",
JCGT 2(2), 2013.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from texbake.mesh.mesh import IntArray


@dataclass(frozen=True, eq=False)
class Visibility:
    """What each sample of a screen sees; row 0 at the top.

    Attributes
    ----------
    face_ids : (h, w) int32
        Index of the nearest triangle in the world; -1 where there is none.
    depths : (h, w) float32
        Reversed depth z / w, greater is nearer; 0 where there is no triangle.
    """

    face_ids: IntArray
    depths: npt.NDArray[np.float32]

    @property
    def n_bytes(self) -> int:
        """Memory that it takes."""
        return self.face_ids.nbytes + self.depths.nbytes
