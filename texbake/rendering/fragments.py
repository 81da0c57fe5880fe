"""Fragments of one object while they are shaded.

Effects add to this record one after another, in the order of the plan: where a fragment lies on the
surface, what the slots of its material hold there, its normal, and the light that leaves it.

An array of values has a row for each fragment, or one row where all have the same, so that a
constant costs nothing; `row_of` is how kernels read both.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.rendering.kernels.interpolation import move_to_base
from texbake.rendering.kernels.lighting import BRIGHTEST
from texbake.rendering.scene.material import Material

Floats = npt.NDArray[np.float32]


@dataclass(frozen=True, kw_only=True, eq=False)
class DrawnObject:
    """An object in world space, as it is drawn.

    Attributes
    ----------
    mesh : Mesh
        What coordinates, normals and tangents are those of: the object's own mesh, placed.
    positions, faces
        Triangles that are drawn: the mesh's, or finer ones made from them.
    object_from_world : (4, 4) float64, optional
        Inverse of its transform; None where it has none.
    base_faces : (F,) int32, optional
        Face of `mesh` that each drawn one is a piece of; None where they are the same.
    base_weights : (F, 3, 2) float32, optional
        Place on that face of each corner of the piece, as weights of its second and third corner;
        exact, since they are halves of halves.
    normals, normal_faces : optional
        Shading normals of the drawn triangles where those are finer.
    """

    mesh: Mesh
    material: Material
    positions: FloatArray
    faces: IntArray
    object_from_world: FloatArray | None = None
    base_faces: IntArray | None = None
    base_weights: npt.NDArray[np.float32] | None = None
    normals: FloatArray | None = None
    normal_faces: IntArray | None = None

    @property
    def n_bytes(self) -> int:
        """Memory of finer triangles than the mesh's; those are counted by nobody else."""
        arrays = [self.base_faces, self.base_weights, self.normals]
        if self.base_faces is not None:
            arrays += [self.positions, self.faces]
        return sum(array.nbytes for array in arrays if array is not None)

    def on_base(
        self, faces: IntArray, weights: FloatArray, changes: npt.NDArray[np.float32]
    ) -> tuple[IntArray, FloatArray, npt.NDArray[np.float32]]:
        """Return places on drawn triangles, and their changes, as faces and weights of `mesh`."""
        assert self.base_faces is not None and self.base_weights is not None
        base_weights, base_changes = np.empty_like(weights), np.empty_like(changes)
        move_to_base(faces, weights, changes, self.base_weights, base_weights, base_changes)
        return self.base_faces[faces], base_weights, base_changes


@dataclass(kw_only=True, eq=False)
class Incident:
    """Light of one lamp where it reaches fragments: rows for each of them, or one for all.

    Attributes
    ----------
    directions : (n or 1, 3) float32
        Unit vectors to the light.
    radiance : (n or 1, 3) float32
        What a white surface that faces it reflects.
    """

    directions: Floats
    radiance: Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class SlotValues:
    """What the slots of a material hold at fragments; None where they hold nothing.

    A color is (n or 1, 3) float32, a number (n or 1, 1).
    """

    base_color: Floats
    specular: Floats | None = None
    exponent: Floats | None = None
    gloss: Floats | None = None
    roughness: Floats | None = None
    metalness: Floats | None = None
    emission: Floats | None = None
    opacity: Floats | None = None
    occlusion: Floats | None = None
    light_map: Floats | None = None


@dataclass(kw_only=True, eq=False)
class Fragments:
    """Some fragments of one object.

    Attributes
    ----------
    target : int
        Index of the object.
    drawn : DrawnObject
        The object itself.
    drawn_faces : (n,) int32
        Triangle of the object as it is drawn.
    drawn_weights : (n, 2) float64
        Weights of that triangle's second and third corner.
    faces, weights
        The same place on `drawn.mesh`, whose coordinates, normals and tangents these index.
    changes : (n, 4) float32
        By how much `weights` grow for one pixel to the right and for one down; empty where the plan
        does not ask for derivatives.
    places, pixels, counts
        As in `texbake.rendering.raster.fragments.FragmentRows`.
    back_facing : (n,) bool
        Whether the triangle is seen from behind.
    positions : (n, 3) float64
        World space; set by "positions".
    to_eye : (n, 3) float32
        Unit vectors; set by "view directions".
    uvs : (n, 2) float64
        Set by "texture coordinates"; moved by "parallax".
    uv_changes : (n, 4) float32
        du, dv for one pixel to the right, du, dv for one down; set by "derivatives".
    normals : (n, 3) float32
        Unit shading normals in world space on the side that is seen; set by "normals", or by the
        normal map in its place; changed by the bump map.
    slots : SlotValues
        Set by "slots".
    light : (n, 3) float32
        Light that leaves toward the eye.
    ambient_share : (n or 1,) float32
        Share of ambient and environment light that arrives.
    """

    target: int
    drawn: DrawnObject
    drawn_faces: IntArray
    drawn_weights: FloatArray
    faces: IntArray
    weights: FloatArray
    changes: Floats
    places: Floats
    pixels: IntArray
    counts: Floats
    back_facing: npt.NDArray[np.bool_]
    positions: FloatArray | None = None
    to_eye: Floats | None = None
    uvs: FloatArray | None = None
    uv_changes: Floats | None = None
    normals: Floats | None = None
    slots: SlotValues | None = None
    light: Floats = field(default_factory=lambda: np.empty((0, 3), np.float32))
    ambient_share: Floats = field(default_factory=lambda: np.ones(1, np.float32))

    def __len__(self) -> int:
        return len(self.faces)

    @property
    def values(self) -> SlotValues:
        """What the slots of the material hold."""
        assert self.slots is not None
        return self.slots


def one_row(value: float | tuple[float, ...], channels: int) -> Floats:
    """(1, channels) float32: a constant as a row for all fragments, at most `BRIGHTEST`."""
    row = np.empty((1, channels), np.float32)
    row[0] = np.clip(value, -BRIGHTEST, BRIGHTEST)
    return row
