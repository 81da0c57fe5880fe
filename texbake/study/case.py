"""What a study is made on: a pair of meshes and a scene, the user's or made by code.

What is made is made when the first knob asks for it, and kept for the others.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np

from texbake.errors import MeshError
from texbake.mapping.unwrap import unwrap
from texbake.mesh.mesh import Mesh
from texbake.mesh.shapes import icosphere, orange
from texbake.mesh.simplify import simplify
from texbake.mesh.topology import degenerate_faces
from texbake.rendering.scene.scene import Scene
from texbake.study.truth.radial import RadialSurface, orange_surface, rippled_surface

_ORANGE_TRIANGLES = 500_000
_QUICK_LEVEL = 5  # of an icosphere, 20,480 triangles
_LIGHT_TRIANGLES = 500
_QUICK_LIGHT_TRIANGLES = 100
_ATLAS_SIZE = 1024

Value = TypeVar("Value")


@dataclass(frozen=True, eq=False)
class Pair:
    """A dense mesh and a light one with texture coordinates.

    `surface` is the closed form that the dense mesh was made from, None for a user's.
    """

    high: Mesh
    low: Mesh
    subject: str
    surface: RadialSurface | None = None


@dataclass(frozen=True, eq=False)
class Case:
    """What knobs are studied on.

    Attributes
    ----------
    high, low : Mesh, optional
        The user's pair.
    scene : Scene, optional
        The user's scene.
    quick : bool
        Whether all is to be small.
    threads : int, optional
    """

    high: Mesh | None = None
    low: Mesh | None = None
    scene: Scene | None = None
    quick: bool = False
    threads: int | None = None

    @cached_property
    def pair(self) -> Pair:
        """The user's pair, the light mesh with an atlas if it has none; else a made one."""
        if self.high is None or self.low is None:
            return self.made_pair
        for mesh in self.high, self.low:
            if degenerate_faces(mesh).all():
                raise MeshError(
                    f"{mesh.name}: none of its {mesh.n_faces} faces has an area, so that there is "
                    "nothing to bake and compare; give a mesh with a surface"
                )
        low, words = self.low, f"{self.high.name} ({self.high.n_faces:,} triangles) and "
        if low.uvs is None:
            low = unwrap(low, size=_ATLAS_SIZE, threads=self.threads)
        return Pair(self.high, low, f"{words}{low.name} ({low.n_faces:,})")

    @cached_property
    def made_pair(self) -> Pair:
        """An orange, or a rippled sphere where all is to be small, and a light mesh of it.

        The dense mesh has the normals of the closed form at its vertices, so that what it is off by
        itself is little.
        """
        surface = self.choose(orange_surface, rippled_surface)()
        sphere = orange(_ORANGE_TRIANGLES) if not self.quick else icosphere(_QUICK_LEVEL)
        lengths = np.linalg.norm(sphere.positions, axis=1)
        name = self.choose("orange", "rippled sphere")
        high = surface.mesh(sphere.positions / lengths[:, None], sphere.faces, name)
        bare = high.replace(normals=None, normal_faces=None)
        low = simplify(
            bare, self.choose(_LIGHT_TRIANGLES, _QUICK_LIGHT_TRIANGLES), threads=self.threads
        )
        low = unwrap(low, quality=self.choose("good", "fast"), threads=self.threads)
        subject = f"{name}, {high.n_faces:,} triangles of known form, and {low.n_faces:,}"
        return Pair(high, low, subject, surface)

    def choose(self, full: Value, quick: Value) -> Value:
        """Return one of two, by whether all is to be small."""
        return quick if self.quick else full
