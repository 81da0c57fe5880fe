"""Fragments: what gets shaded, one per visible triangle in a pixel (multisampling).

A pixel inside one triangle yields a single fragment at the pixel's center that stands for all its
samples. A pixel at an edge yields one fragment per triangle, at the mean position of the samples
that see it. Edges are antialiased this way, and pixels without an edge are shaded once.

Effects add to the fragments of an object one after another, in the order of the plan. An array has
one row per fragment, or a single row if all share the value; kernels read both with `row_of` of
`core/fragment_values.h`.

Kernels: `core/multisampling.c`, `core/interpolation.c`.
"""

from __future__ import annotations

from dataclasses import field
from typing import Any

import numpy as np

from texbake.core import core
from texbake.mesh.mesh import BoolArray, Float32Array, FloatArray, Int64Array, IntArray, Mesh
from texbake.records import dataclass
from texbake.rendering.rasterize import World
from texbake.rendering.scene.material import Material


@dataclass(frozen=True, eq=False)
class FragmentRows:
    """Fragments of some rows of pixels, sorted by object and then by pixel."""

    faces: IntArray  # (n,): triangle of the world
    # (n, 2): column and row in pixels, (0, 0) at the upper left corner of the picture
    places: Float32Array
    pixels: IntArray  # (n,): row and column of the pixel as one number, row * width + column
    counts: Float32Array  # (n,): number of the pixel's samples that the fragment covers
    # (O + 1,): fragments of object k are at starts[k] to starts[k + 1]
    starts: Int64Array
    # (rows * side, width * side): fragment of each sample, -1 where there is none
    of_samples: IntArray


def fragment_rows(
    face_ids: IntArray,
    world: World,
    rows: tuple[int, int],
    *,
    side: int,
    merges: bool = True,
    wants_samples: bool = False,
    corner: tuple[int, int] = (0, 0),
    fine: int = 1,
) -> FragmentRows:
    """Compute fragments of some rows (first, stop) of pixels from triangles (h, w) at samples.

    `merges`: samples of one pixel and triangle are one fragment; `wants_samples`: fill
    `of_samples`; `corner`: column and row of the first pixel; `fine`: these pixels per side of one
    of the picture.
    """
    counts = np.zeros(world.n_objects, np.int64)
    core.count_fragments(face_ids, world.starts, side, merges, *rows, counts)
    starts = np.concatenate([[0], np.cumsum(counts)])
    n = int(starts[-1])
    shape = ((rows[1] - rows[0]) * side, face_ids.shape[1]) if wants_samples else (0, 0)
    result = FragmentRows(
        np.empty(n, np.int32),
        np.empty((n, 2), np.float32),
        np.empty(n, np.int32),
        np.empty(n, np.float32),
        starts,
        np.full(shape, -1, np.int32),
    )
    core.list_fragments(
        face_ids, world.starts, side, merges, *rows, *corner, fine, starts[:-1].copy(),
        result.faces, result.places, result.pixels, result.counts,
        result.of_samples if wants_samples else None,
    )  # fmt: skip
    return result


def weights_at(
    world: World,
    clip_from_world: FloatArray,
    width: int,
    height: int,
    face_ids: IntArray,
    places: Float32Array,
    *,
    affine: bool = False,
    wants_changes: bool = False,
) -> tuple[FloatArray, BoolArray, Float32Array]:
    """Compute the weights (n, 2) of fragments, `back_facing` (n,) and `changes` (n, 4) if wanted.

    `places` (n, 2) float32; `affine`: linear on the screen. Changes are those of the two weights
    one pixel to the right, then down; weights are never below 0, and 0 for triangles without area.
    """
    n = len(face_ids)
    weights = np.empty((n, 2))
    back_facing = np.empty(n, np.bool_)
    changes = np.empty((n if wants_changes else 0, 4), np.float32)
    core.weigh_fragments(
        world.positions, world.faces, clip_from_world, width, height, affine, face_ids, places,
        weights, back_facing, changes if wants_changes else None,
    )  # fmt: skip
    return weights, back_facing, changes


# Sums over a pixel's samples stay far below the greatest float32, 3.4e38.
BRIGHTEST = 1e30


@dataclass(frozen=True, kw_only=True, eq=False)
class DrawnObject:
    """An object in world space, as it is drawn."""

    # The object's own mesh in world space, which texture coordinates, normals and tangents belong
    # to
    mesh: Mesh
    material: Material
    # positions, faces: drawn triangles: those of the mesh, or a subdivision of them
    positions: FloatArray
    faces: IntArray
    # (4, 4): inverse of the object's transform; None if it has none
    object_from_world: FloatArray | None = None
    # (F,): face of `mesh` that each drawn triangle is a piece of; None without subdivision
    base_faces: IntArray | None = None
    # (F, 3, 2): barycentric position of each corner on that face, as weights of its second and
    # third corner. They are multiples of a power of 1/2, hence exact.
    base_weights: Float32Array | None = None
    # normals, normal_faces: shading normals of the drawn triangles, if subdivided
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
        self, faces: IntArray, weights: FloatArray, changes: Float32Array
    ) -> tuple[IntArray, FloatArray, Float32Array]:
        """Convert weights on drawn triangles, and their derivatives, to faces of `mesh`."""
        if self.base_faces is None or self.base_weights is None:
            return faces, weights, changes
        base_weights, base_changes = np.empty_like(weights), np.empty_like(changes)
        core.move_to_base(faces, weights, changes, self.base_weights, base_weights, base_changes)
        return self.base_faces[faces], base_weights, base_changes


@dataclass(eq=False)
class IncidentLight:
    """Light of one lamp that arrives at fragments: one row per fragment, or one for all."""

    directions: Float32Array  # (n or 1, 3): unit vectors to the light
    radiance: Float32Array  # (n or 1, 3): light that a white surface facing the lamp reflects
    # Positions of the fragments on the lamp's cookie, which `dim` computes and `tint` uses
    on_cookie: Any = None


@dataclass(frozen=True, kw_only=True, eq=False)
class SlotValues:
    """Slots of a material at fragments: colors (n or 1, 3), numbers (n or 1, 1); None if empty."""

    base_color: Float32Array
    specular: Float32Array | None = None
    exponent: Float32Array | None = None
    gloss: Float32Array | None = None
    roughness: Float32Array | None = None
    metalness: Float32Array | None = None
    emission: Float32Array | None = None
    opacity: Float32Array | None = None
    occlusion: Float32Array | None = None
    light_map: Float32Array | None = None


def _none_yet() -> Float32Array:
    return np.empty((0, 3), np.float32)


@dataclass(kw_only=True, eq=False)
class Fragments:
    """Some fragments of one object."""

    target: int  # index of the object
    drawn: DrawnObject  # the object itself
    drawn_faces: IntArray  # (n,): drawn triangle of the object
    drawn_weights: FloatArray  # (n, 2): weights of that triangle's second and third corner
    # faces, weights: the same position on `drawn.mesh`, for looking up coordinates, normals and
    # tangents
    faces: IntArray
    weights: FloatArray
    # (n, 4): growth of `weights` for one pixel to the right, then for one pixel down; empty if the
    # plan has no derivatives
    changes: Float32Array
    # places, pixels, counts: as in `FragmentRows`
    places: Float32Array
    pixels: IntArray
    counts: Float32Array
    back_facing: BoolArray  # (n,): whether the triangle is seen from behind
    # (n, 3): in world space; empty until "positions" sets them
    positions: FloatArray = field(default_factory=lambda: np.empty((0, 3)))
    # (n, 3): unit vectors; empty until "view directions" sets them
    to_eye: Float32Array = field(default_factory=_none_yet)
    # By the name of the set, None for the first: texture coordinates (n, 2), and du, dv for one
    # pixel to the right, then for one pixel down (n, 4), empty if the plan has no derivatives. Set
    # by "texture coordinates" and "further texture coordinates", moved by "parallax"
    coordinates: dict[str | None, tuple[FloatArray, Float32Array]] = field(default_factory=dict)
    # (n, 3): unit shading normals in world space, on the visible side; empty until "normals" or the
    # normal map sets them, changed by the bump map
    normals: Float32Array = field(default_factory=_none_yet)
    slots: SlotValues | None = None  # set by "slots"
    # (n, 3): outgoing light toward the camera
    light: Float32Array = field(default_factory=_none_yet)
    # (n or 1,): unoccluded share of ambient and environment light
    ambient_share: Float32Array = field(default_factory=lambda: np.ones(1, np.float32))

    @classmethod
    def on(
        cls,
        target: int,
        drawn: DrawnObject,
        faces: IntArray,
        weights: FloatArray,
        changes: Float32Array,
        **others: Any,
    ) -> Fragments:
        """Return fragments on drawn triangles; without `others` they belong to no pixel."""
        n = len(faces)
        base_faces, base_weights, base_changes = drawn.on_base(faces, weights, changes)
        nowhere = {
            "places": np.zeros((n, 2), np.float32),
            "pixels": np.zeros(n, np.int32),
            "counts": np.ones(n, np.float32),
            "back_facing": np.zeros(n, np.bool_),
        }
        return cls(
            target=target,
            drawn=drawn,
            drawn_faces=faces,
            drawn_weights=weights,
            faces=base_faces,
            weights=base_weights,
            changes=base_changes,
            light=np.zeros((n, 3), np.float32),
            **nowhere | others,
        )

    def __len__(self) -> int:
        return len(self.faces)

    @property
    def values(self) -> SlotValues:
        """Values of the material's slots."""
        assert self.slots is not None
        return self.slots


def three_weights(weights: FloatArray) -> Float32Array:
    """(n, 3) float32: weights of all corners, from those of the second and third."""
    second, third = weights.T
    return np.stack([1.0 - second - third, second, third], axis=1).astype(np.float32)


def one_row(value: float | tuple[float, ...], channels: int) -> Float32Array:
    """(1, channels) float32: a constant as a row for all fragments, at most `BRIGHTEST`."""
    row = np.empty((1, channels), np.float32)
    row[0] = np.clip(value, -BRIGHTEST, BRIGHTEST)
    return row
