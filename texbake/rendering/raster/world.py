"""All triangles of a picture in one list, and the visibility buffer that refers to them.

Based on: Burns and Hunt, "The visibility buffer: a cache-friendly approach to deferred shading",
JCGT 2(2), 2013.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.mesh.mesh import FloatArray, IntArray

# Which faces of an object are drawn.
SKIP, CULL_BACK, SHOW_BACK = 0, 1, 2


@dataclass(frozen=True, eq=False)
class World:
    """Triangles in world space."""

    positions: FloatArray  # (V, 3)
    faces: IntArray  # (F, 3): front faces are counter-clockwise
    starts: npt.NDArray[np.int64]  # (O + 1,): faces of object k are at starts[k] to starts[k + 1]

    @property
    def n_faces(self) -> int:
        """Number of triangles."""
        return len(self.faces)

    @property
    def n_objects(self) -> int:
        """Number of objects."""
        return len(self.starts) - 1


@dataclass(frozen=True, eq=False)
class VisibilityBuffer:
    """The nearest triangle at each sample of a screen; row 0 is at the top."""

    face_ids: IntArray  # (h, w): index of the nearest triangle in the world; -1 where there is none
    # (h, w): reversed depth z / w (greater is nearer); 0 where there is no triangle
    depths: npt.NDArray[np.float32]

    @property
    def n_bytes(self) -> int:
        """Memory of the buffer in bytes."""
        return self.face_ids.nbytes + self.depths.nbytes


def joined(parts: Sequence[tuple[FloatArray, IntArray]]) -> World:
    """Join the positions and faces of objects; a single object's arrays are shared, not copied."""
    counts = [len(faces) for _, faces in parts]
    starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    if len(parts) == 1:
        positions, faces = parts[0]
    else:
        positions = np.concatenate([positions for positions, _ in parts])
        firsts = np.cumsum([0, *(len(positions) for positions, _ in parts[:-1])], dtype=np.int32)
        faces = np.concatenate(
            [faces + first for (_, faces), first in zip(parts, firsts, strict=True)]
        )
    return World(read_only(positions, np.float64), read_only(faces, np.int32), starts)


def read_only(array: npt.NDArray[Any], dtype: type) -> npt.NDArray[Any]:
    """Return a contiguous, read-only array of a type, as the kernels expect their inputs."""
    view = np.require(array, dtype, "C").view()
    view.flags.writeable = False
    return view
