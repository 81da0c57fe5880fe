"""The low-poly meshes of an asset: their parts, and the faces of each texture set and UDIM tile.

UDIM tile 1001 is the unit square; the numbers go on to the right, ten in a row, then up. A tile is
baked if the middle of a face with an area lies in it. A face that crosses a border is baked in each
tile that it overlaps, and counted.

Based on: the UDIM convention of The Foundry's Mari, 1001 + column + 10 row.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np

from texbake.baking.maps import FIRST_TILE
from texbake.baking.parts.high_parts import NamedPart
from texbake.baking.parts.matching import PartsOptions
from texbake.errors import MeshError, UvError
from texbake.mapping.overlap import StackedIslands
from texbake.mesh.compose import excerpt
from texbake.mesh.materials import Materials
from texbake.mesh.mesh import BoolArray, Float32Array, FloatArray, IntArray, Mesh
from texbake.mesh.normals import shading_normals
from texbake.mesh.tangents import shading_tangents
from texbake.records import dataclass

_COLUMNS = 10
_LAST_TILE = 9999  # numbers have four digits
# Rounding of coordinates on a border in float32 files, in tiles.
_ON_BORDER = 1e-6


@dataclass(frozen=True, eq=False)
class Tiles:
    """The UDIM tiles of a mesh."""

    numbers: list[int]  # in order
    n_crossing: int  # faces that overlap more than one tile
    # Faces whose middle lies in no tile: left of the first column, right of the tenth, below the
    # first row, or above tile 9999.
    n_outside: int
    _least: FloatArray
    _greatest: FloatArray

    @classmethod
    def of(cls, corner_uvs: FloatArray) -> Tiles:
        """Find the tiles of faces from the (F, 3, 2) texture coordinates of their corners."""
        least = np.asarray(corner_uvs.min(axis=1)) + _ON_BORDER
        greatest = np.asarray(corner_uvs.max(axis=1)) - _ON_BORDER
        columns, rows = np.floor(corner_uvs.mean(axis=1)).T
        edges = corner_uvs[:, 1:] - corner_uvs[:, :1]
        has_area = edges[:, 0, 0] * edges[:, 1, 1] != edges[:, 0, 1] * edges[:, 1, 0]
        numbers = FIRST_TILE + columns + _COLUMNS * rows
        inside = (columns >= 0) & (columns < _COLUMNS) & (rows >= 0) & (numbers <= _LAST_TILE)
        homes = np.unique(numbers[inside & has_area])
        crossing = (np.floor(least) < np.floor(greatest)).any(axis=1)
        return cls(
            homes.astype(int).tolist(),
            int(np.count_nonzero(crossing)),
            int(np.count_nonzero(~inside)),
            least,
            greatest,
        )

    def faces_in(self, number: int) -> BoolArray:
        """(F,) bool: faces that overlap a tile."""
        corner = corner_of_tile(number)
        return np.asarray(((self._least < corner + 1.0) & (self._greatest > corner)).all(axis=1))


def corner_of_tile(number: int) -> FloatArray:
    """(2,) float64: the lower left corner of a tile.

    >>> corner_of_tile(1012).tolist()
    [1.0, 1.0]
    """
    row, column = divmod(number - FIRST_TILE, _COLUMNS)
    return np.array([column, row], dtype=np.float64)


class BakeTarget(NamedTuple):
    """One set of maps: a texture set, empty if there is only one, and a UDIM tile."""

    texture_set: str
    udim: int


@dataclass(frozen=True, eq=False)
class LowPart:
    """A part of a low-poly mesh and what it is baked from."""

    name: str
    mesh: Mesh  # with the normals and tangents that it has as a part of the whole mesh
    sources: tuple[NamedPart, ...]  # high-poly parts that its rays are cast into
    set_ids: IntArray  # (F,) int32; index into `set_names`, per face
    set_names: tuple[str, ...]
    face_ids: IntArray  # (F,) int32; its faces in the whole mesh
    cage: Mesh | None = None
    # (F,) bool; faces whose islands are stacked on purpose on others of the whole mesh.
    is_stacked: BoolArray | None = None

    @cached_property
    def tangents(self) -> Float32Array:
        """(F, 3, 4) float32: corner tangents of the mesh."""
        return shading_tangents(self.mesh)

    def on(self, chosen: BoolArray, udim: int) -> Mesh:
        """Return the mesh with a tile in the unit square; faces not chosen have no area in it."""
        mesh = self.mesh
        if chosen.all() and udim == FIRST_TILE:
            return mesh
        assert mesh.uvs is not None and mesh.uv_faces is not None
        return mesh.replace(
            uvs=mesh.uvs - corner_of_tile(udim),
            uv_faces=np.where(chosen[:, np.newaxis], mesh.uv_faces, 0),
            tangents=self.tangents,
        )


@dataclass(frozen=True, eq=False)
class LowMesh:
    """A low-poly mesh as a whole, from which parts are cut."""

    mesh: Mesh
    cage: Mesh | None = None
    materials: Materials | None = None

    def __post_init__(self) -> None:
        self.mesh.corner_uvs()

    def part(
        self, part: NamedPart, sources: Sequence[NamedPart], options: PartsOptions, name: str
    ) -> LowPart:
        """Cut out a part, unless it is the whole mesh."""
        mesh, cage, is_stacked = self.mesh, self.cage, None
        set_ids, set_names = _sets(mesh, options, name, self.materials)
        face_ids = np.arange(mesh.n_faces, dtype=np.int32)
        if part.groups is not None:
            chosen = part.faces_of(mesh)
            whole = self._shaded if options.udim else self._in_one_tile
            mesh, set_ids = excerpt(whole, chosen), set_ids[chosen]
            face_ids = face_ids[chosen]
            cage = None if cage is None else excerpt(cage, chosen)
            is_stacked = self._stacked.stacked[chosen]
        mesh = mesh.replace(name=name)
        return LowPart(name, mesh, tuple(sources), set_ids, set_names, face_ids, cage, is_stacked)

    @cached_property
    def _stacked(self) -> StackedIslands:
        """Islands that coincide with another."""
        return StackedIslands.of(self.mesh)

    @cached_property
    def _shaded(self) -> Mesh:
        """The mesh with the normals and tangents that a renderer uses."""
        mesh = self.mesh
        normals, corners = shading_normals(mesh)
        return mesh.replace(normals=normals, normal_faces=corners, tangents=shading_tangents(mesh))

    @cached_property
    def _in_one_tile(self) -> Mesh:
        """The mesh with stacked islands in the unit square, so that any of them can be baked."""
        tiles = self._stacked.tiles[:, np.newaxis]
        if not tiles.any():
            return self._shaded
        uvs = (self._shaded.corner_uvs() - tiles).reshape(-1, 2)
        return self._shaded.replace(uvs=uvs, uv_faces=np.arange(len(uvs)).reshape(-1, 3))


def _sets(
    mesh: Mesh, options: PartsOptions, name: str, materials: Materials | None
) -> tuple[IntArray, tuple[str, ...]]:
    """Texture set of each face of a mesh, and the names of the sets."""
    if options.texture_sets == "materials":
        if materials is None:
            raise MeshError(f"{mesh.name}: it has no materials; use `texture_sets=groups`")
        return materials.face_materials, materials.names
    if options.texture_sets == "none":
        name = ""
    elif not options.match_by_name:
        if mesh.face_groups is not None:
            return mesh.face_groups, mesh.group_names
        name = Path(mesh.name).stem
    return np.zeros(mesh.n_faces, np.int32), (name,)


@dataclass(frozen=True, eq=False)
class TargetLayout:
    """The faces of the parts on each set of maps."""

    # For each set of maps, the index of each part on it and its (F,) bool mask of faces.
    faces: dict[BakeTarget, dict[int, BoolArray]]
    n_crossing: int  # faces that cross the border of a tile
    n_outside: int  # faces in no tile

    @classmethod
    def of(cls, parts: Sequence[LowPart], options: PartsOptions) -> TargetLayout:
        """Assign faces to targets; sets are in the order of the parts, tiles in numerical order."""
        n_crossing = n_outside = 0
        names = dict.fromkeys(name for part in parts for name in part.set_names)
        found: dict[BakeTarget, dict[int, BoolArray]] = {}
        for i, part in enumerate(parts):
            tiles = Tiles.of(part.mesh.corner_uvs()) if options.udim else None
            if tiles is not None:
                n_crossing += tiles.n_crossing
                n_outside += tiles.n_outside
            for k, name in enumerate(part.set_names):
                of_set = part.set_ids == k
                if not of_set.any():
                    continue
                numbers = [FIRST_TILE] if tiles is None else tiles.numbers
                for number in numbers:
                    chosen = of_set if tiles is None else of_set & tiles.faces_in(number)
                    if chosen.any():
                        faces = found.setdefault(BakeTarget(name, number), {})
                        # Groups or materials of the same name are one set.
                        faces[i] = faces[i] | chosen if i in faces else chosen
        faces_of = {
            target: found[target]
            for name in names
            for target in sorted(target for target in found if target.texture_set == name)
        }
        if not faces_of:
            raise UvError(
                f"{parts[0].mesh.name}: its texture coordinates cover nothing: none of them lies "
                "in a tile; make new ones with: texbake unwrap"
            )
        return cls(faces_of, n_crossing, n_outside)
