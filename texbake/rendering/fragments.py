"""Fragments of one object while they are shaded.

Effects add to this record one after another, in the order of the plan: the position on the surface,
the values of the material's slots, the normal, and the outgoing light.

An array has one row per fragment, or a single row if all fragments share the value, so that
constants cost nothing. Kernels read both with `row_of` of `core/fragment_values.h`.

Kernel: `core/interpolation.c`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.core import core
from texbake.mesh.mesh import FloatArray, IntArray, Mesh
from texbake.rendering.scene.material import Material

Floats = npt.NDArray[np.float32]

# Sums over a pixel's samples stay far below the greatest float32, 3.4e38.
BRIGHTEST = 1e30


@dataclass(frozen=True, kw_only=True, eq=False)
class DrawnObject:
    """An object in world space, as it is drawn.

    Attributes
    ----------
    mesh : Mesh
        The object's own mesh in world space, which texture coordinates, normals and tangents belong
        to.
    positions, faces
        Drawn triangles: those of the mesh, or a subdivision of them.
    object_from_world : (4, 4) float64, optional
        Inverse of the object's transform; None if it has none.
    base_faces : (F,) int32, optional
        Face of `mesh` that each drawn triangle is a piece of; None without subdivision.
    base_weights : (F, 3, 2) float32, optional
        Barycentric position of each corner on that face, as weights of its second and third corner.
        They are multiples of a power of 1/2, hence exact.
    normals, normal_faces : optional
        Shading normals of the drawn triangles, if subdivided.
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
        """Memory in bytes of the subdivision; the mesh itself is not counted."""
        arrays = [self.base_faces, self.base_weights, self.normals]
        if self.base_faces is not None:
            arrays += [self.positions, self.faces]
        return sum(array.nbytes for array in arrays if array is not None)

    def on_base(
        self, faces: IntArray, weights: FloatArray, changes: npt.NDArray[np.float32]
    ) -> tuple[IntArray, FloatArray, npt.NDArray[np.float32]]:
        """Convert weights on drawn triangles, and their derivatives, to faces of `mesh`."""
        assert self.base_faces is not None and self.base_weights is not None
        base_weights, base_changes = np.empty_like(weights), np.empty_like(changes)
        core.move_to_base(faces, weights, changes, self.base_weights, base_weights, base_changes)
        return self.base_faces[faces], base_weights, base_changes


@dataclass(kw_only=True, eq=False)
class Incident:
    """Light of one lamp that arrives at fragments: one row per fragment, or one for all.

    Attributes
    ----------
    directions : (n or 1, 3) float32
        Unit vectors to the light.
    radiance : (n or 1, 3) float32
        Light that a white surface facing the lamp reflects.
    on_slide : optional
        Positions of the fragments on the lamp's slide, which `dim` computes and `tint` uses.
    """

    directions: Floats
    radiance: Floats
    on_slide: Any = None


@dataclass(frozen=True, kw_only=True, eq=False)
class SlotValues:
    """Values of a material's slots at fragments; None for empty slots.

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
        Drawn triangle of the object.
    drawn_weights : (n, 2) float64
        Weights of that triangle's second and third corner.
    faces, weights
        The same position on `drawn.mesh`, for looking up coordinates, normals and tangents.
    changes : (n, 4) float32
        Growth of `weights` for one pixel to the right, then for one pixel down; empty if the plan
        has no derivatives.
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
        du, dv for one pixel to the right, then for one pixel down; set by "derivatives".
    further_uvs : mapping of str to (uvs, uv_changes)
        The same on further sets; set by "further texture coordinates", moved by "parallax".
    normals : (n, 3) float32
        Unit shading normals in world space, on the visible side; set by "normals" or by the normal
        map, and changed by the bump map.
    slots : SlotValues
        Set by "slots".
    light : (n, 3) float32
        Outgoing light toward the camera.
    ambient_share : (n or 1,) float32
        Unoccluded share of ambient and environment light.
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
    further_uvs: Mapping[str, tuple[FloatArray, Floats | None]] = field(default_factory=dict)
    normals: Floats | None = None
    slots: SlotValues | None = None
    light: Floats = field(default_factory=lambda: np.empty((0, 3), np.float32))
    ambient_share: Floats = field(default_factory=lambda: np.ones(1, np.float32))

    def __len__(self) -> int:
        return len(self.faces)

    def coordinates(self, uv_set: str | None) -> tuple[FloatArray, Floats | None]:
        """Texture coordinates in a set, and their derivatives."""
        if uv_set is not None:
            return self.further_uvs[uv_set]
        assert self.uvs is not None
        return self.uvs, self.uv_changes

    @property
    def values(self) -> SlotValues:
        """Values of the material's slots."""
        assert self.slots is not None
        return self.slots


def one_row(value: float | tuple[float, ...], channels: int) -> Floats:
    """(1, channels) float32: a constant as a row for all fragments, at most `BRIGHTEST`."""
    row = np.empty((1, channels), np.float32)
    row[0] = np.clip(value, -BRIGHTEST, BRIGHTEST)
    return row
