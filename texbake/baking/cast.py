"""Rays to hits, through Embree as fast as it can be reached.

A ray that Embree lets through is retried against every triangle near it by `watertight`, so that a
miss is a hole in the dense mesh and never a rounding error.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
import numpy.typing as npt

from texbake.baking.chunked_caster import ChunkedCaster
from texbake.baking.embree import load_library
from texbake.baking.embreex_caster import EmbreexCaster
from texbake.baking.found import Found
from texbake.baking.native_caster import NativeCaster
from texbake.baking.rays import Rays
from texbake.baking.secondary.fans import Fans
from texbake.baking.secondary.reach import Reach
from texbake.errors import DependencyError
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import Mesh


class Caster(Protocol):
    """Finds the first surface along rays; `name` is what reports call it."""

    name: str

    def cast(self, rays: Rays, *, cull_back_faces: bool = True) -> Found:
        """Find the nearest hit of each ray within its length.

        With culling, surfaces that face away from the ray's start are passed through.
        """

    def cast_fans(
        self, fans: Fans, sets: npt.NDArray[np.float32], reach: Reach
    ) -> npt.NDArray[np.float32]:
        """Cast fans of rays, each fan the directions of one of the sets.

        Returns (n, N_COLUMNS) float32, the columns of `texbake.baking.secondary`, lengths local.
        """

    def close(self) -> None:
        """Free what the caster holds outside Python."""


def open_caster(
    high: Mesh,
    frame: LocalFrame,
    *,
    chunk_faces: int | None = None,
    threads: int | None = None,
) -> Caster:
    """Build a ray tree over the dense mesh; through embreex's own interface where need be.

    Parameters
    ----------
    chunk_faces
        Most faces in one tree at a time; None for all of them.

    Raises
    ------
    DependencyError
        embreex is missing, or chunks are asked for and its library is not found.
    """
    if chunk_faces is not None:
        load_library()
        return ChunkedCaster(high, frame, chunk_faces, threads=threads)
    try:
        load_library()
    except DependencyError:
        return EmbreexCaster(high, frame)
    return NativeCaster(high, frame, threads=threads)
