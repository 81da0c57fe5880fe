"""Rays to hits, through Embree as fast as it can be reached.

A ray that Embree lets through is retried against every triangle near it by `watertight`, so that a
miss is a hole in the dense mesh and never a rounding error.
"""

from __future__ import annotations

from typing import Protocol

from texbake.bake.embree import load_library
from texbake.bake.embreex_caster import EmbreexCaster
from texbake.bake.found import Found
from texbake.bake.native_caster import NativeCaster
from texbake.bake.rays import Rays
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

    def close(self) -> None:
        """Free what the caster holds outside Python."""


def open_caster(high: Mesh, frame: LocalFrame, *, threads: int | None = None) -> Caster:
    """Build a ray tree over the dense mesh; through embreex's own interface where need be."""
    try:
        load_library()
    except DependencyError:
        return EmbreexCaster(high, frame)
    return NativeCaster(high, frame, threads=threads)
