"""What a study runs on: a pair of meshes and a scene, from the user or generated.

Generated meshes are made when the first knob needs them, and kept for the others.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

from texbake.core import portable_math as pm
from texbake.errors import MeshError
from texbake.mapping.unwrap import unwrap
from texbake.mesh.mesh import Mesh
from texbake.mesh.normals import degenerate_faces
from texbake.mesh.shapes import icosphere, orange
from texbake.mesh.simplify import simplify
from texbake.rendering.scene.scene import Scene
from texbake.study.truth.surfaces import Surface, orange_surface, rippled_surface

_ORANGE_TRIANGLES = 500_000
_QUICK_LEVEL = 5  # of an icosphere, 20,480 triangles
_LOW_POLY_TRIANGLES = 500
_QUICK_LOW_POLY_TRIANGLES = 100
_ATLAS_SIZE = 1024

Value = TypeVar("Value")


@dataclass(frozen=True, eq=False)
class StudyPair:
    """A high-poly mesh, and a low-poly mesh with texture coordinates.

    `surface` is the closed form that the high-poly mesh was made from; None for a user's mesh.
    """

    high: Mesh
    low: Mesh
    subject: str
    surface: Surface | None = None


@dataclass(frozen=True, eq=False)
class Case:
    """What knobs are studied on."""

    # high, low: the user's pair.
    high: Mesh | None = None
    low: Mesh | None = None
    scene: Scene | None = None  # the user's scene
    quick: bool = False  # whether to keep everything small
    threads: int | None = None

    @cached_property
    def pair(self) -> StudyPair:
        """The user's pair, the low-poly mesh unwrapped if needed; else a generated one."""
        if self.high is None or self.low is None:
            return self.made_pair
        for mesh in self.high, self.low:
            if degenerate_faces(mesh).all():
                raise MeshError(
                    f"{mesh.name}: none of its {mesh.n_faces} faces has an area, so there is "
                    "nothing to bake and compare; give a mesh with a surface"
                )
        low, words = self.low, f"{self.high.name} ({self.high.n_faces:,} triangles) and "
        if low.uvs is None:
            low = unwrap(low, size=_ATLAS_SIZE, threads=self.threads)
        return StudyPair(self.high, low, f"{words}{low.name} ({low.n_faces:,})")

    @cached_property
    def made_pair(self) -> StudyPair:
        """An orange, or a rippled sphere if everything is kept small, and a low-poly mesh of it.

        The high-poly mesh has the normals of the closed form at its vertices, so its own error is
        small.
        """
        surface = self.choose(orange_surface, rippled_surface)()
        sphere = orange(_ORANGE_TRIANGLES) if not self.quick else icosphere(_QUICK_LEVEL)
        lengths = pm.norm(sphere.positions, axis=1)
        name = self.choose("orange", "rippled sphere")
        high = surface.mesh(sphere.positions / lengths[:, None], sphere.faces, name)
        bare = high.replace(normals=None, normal_faces=None)
        low = simplify(
            bare, self.choose(_LOW_POLY_TRIANGLES, _QUICK_LOW_POLY_TRIANGLES), threads=self.threads
        )
        low = unwrap(low, quality=self.choose("good", "fast"), threads=self.threads)
        subject = f"{name}, {high.n_faces:,} triangles of known form, and {low.n_faces:,}"
        return StudyPair(high, low, subject, surface)

    def choose(self, full: Value, quick: Value) -> Value:
        """Return the second value if everything is kept small, else the first."""
        return quick if self.quick else full
