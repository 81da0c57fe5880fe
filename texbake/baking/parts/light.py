"""The light meshes of an asset: their parts, and the faces that each set of maps and tile has."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from texbake.baking.file_names import FIRST_TILE
from texbake.baking.parts.options import PartsOptions
from texbake.baking.parts.pieces import Piece
from texbake.baking.parts.tiles import Tiles, corner_of_tile
from texbake.errors import MeshError, UvError
from texbake.mesh.compose import excerpt
from texbake.mesh.materials import Materials
from texbake.mesh.mesh import IntArray, Mesh
from texbake.mesh.normals import shading_normals
from texbake.mesh.tangents import corner_tangents

BoolArray = npt.NDArray[np.bool_]


class Canvas(NamedTuple):
    """One set of maps: a texture set, and its tile.

    Attributes
    ----------
    texture_set : str
        Empty where there is but one.
    udim : int
    """

    texture_set: str
    udim: int


@dataclass(frozen=True, eq=False)
class LightPart:
    """A part of a light mesh and what it is baked from.

    Attributes
    ----------
    name : str
    mesh : Mesh
        Its normals and tangents are those that it has as a part of the whole.
    sources : tuple of Piece
        Dense parts that its rays see.
    set_ids : (F,) int32
        Index into `set_names` of each face.
    set_names : tuple of str
    cage : Mesh, optional
    """

    name: str
    mesh: Mesh
    sources: tuple[Piece, ...]
    set_ids: IntArray
    set_names: tuple[str, ...]
    cage: Mesh | None = None

    @cached_property
    def tangents(self) -> npt.NDArray[np.float32]:
        """(F, 3, 4) float32: corner tangents of the mesh."""
        return corner_tangents(self.mesh) if self.mesh.tangents is None else self.mesh.tangents

    def on(self, chosen: BoolArray, udim: int) -> Mesh:
        """Return the mesh with a tile in the unit square, and no area for faces not chosen."""
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
class LightMesh:
    """A light mesh as a whole, from which parts are cut.

    Attributes
    ----------
    mesh : Mesh
    cage : Mesh, optional
    materials : Materials, optional

    Raises
    ------
    UvError
        The mesh has no texture coordinates.
    """

    mesh: Mesh
    cage: Mesh | None = None
    materials: Materials | None = None

    def __post_init__(self) -> None:
        self.mesh.corner_uvs()

    def part(
        self, piece: Piece, sources: Sequence[Piece], options: PartsOptions, name: str
    ) -> LightPart:
        """Cut a part out, if it is not all of the mesh.

        Raises
        ------
        MeshError
            It is to be divided by materials that are not known.
        """
        mesh, cage = self.mesh, self.cage
        set_ids, set_names = _sets(mesh, options, name, self.materials)
        if piece.groups is not None:
            chosen = piece.faces_of(mesh)
            mesh, set_ids = excerpt(self._shaded, chosen), set_ids[chosen]
            cage = None if cage is None else excerpt(cage, chosen)
        return LightPart(name, mesh.replace(name=name), tuple(sources), set_ids, set_names, cage)

    @cached_property
    def _shaded(self) -> Mesh:
        """The mesh with the normals and tangents that a renderer draws it with."""
        mesh = self.mesh
        normals, corners = shading_normals(mesh)
        tangents = corner_tangents(mesh) if mesh.tangents is None else mesh.tangents
        return mesh.replace(normals=normals, normal_faces=corners, tangents=tangents)


def _sets(
    mesh: Mesh, options: PartsOptions, name: str, materials: Materials | None
) -> tuple[IntArray, tuple[str, ...]]:
    """Texture set of each face of a mesh, and the names of the sets."""
    if options.texture_sets == "materials":
        if materials is None:
            raise MeshError(
                f"{mesh.name}: it has no materials; divide it with --texture-sets groups"
            )
        return materials.face_materials, materials.names
    if options.texture_sets == "none":
        name = ""
    elif not options.match_by_name:
        if mesh.face_groups is not None:
            return mesh.face_groups, mesh.group_names
        name = Path(mesh.name).stem
    return np.zeros(mesh.n_faces, np.int32), (name,)


@dataclass(eq=False)
class Layout:
    """Which faces of which parts each set of maps has.

    Attributes
    ----------
    faces : dict
        For each set of maps the parts in it, by their place, with their (F,) bool of faces.
    n_crossing : int
        Faces that cross the border of a tile.
    n_outside : int
        Faces in no tile.
    """

    faces: dict[Canvas, dict[int, BoolArray]] = field(default_factory=dict)
    n_crossing: int = 0
    n_outside: int = 0

    @classmethod
    def of(cls, parts: Sequence[LightPart], options: PartsOptions) -> Layout:
        """Lay parts out; sets in the order of the parts, tiles in that of their numbers.

        Raises
        ------
        UvError
            No face lies in a tile.
        """
        layout = cls()
        names = dict.fromkeys(name for part in parts for name in part.set_names)
        found: dict[Canvas, dict[int, BoolArray]] = {}
        for i, part in enumerate(parts):
            tiles = Tiles.of(part.mesh.corner_uvs()) if options.udim else None
            if tiles is not None:
                layout.n_crossing += tiles.n_crossing
                layout.n_outside += tiles.n_outside
            for k, name in enumerate(part.set_names):
                of_set = part.set_ids == k
                if not of_set.any():
                    continue
                numbers = [FIRST_TILE] if tiles is None else tiles.numbers
                for number in numbers:
                    chosen = of_set if tiles is None else of_set & tiles.faces_in(number)
                    if chosen.any():
                        faces = found.setdefault(Canvas(name, number), {})
                        # Groups, and materials, of one name are one set.
                        faces[i] = faces[i] | chosen if i in faces else chosen
        for name in names:
            for canvas in sorted(canvas for canvas in found if canvas.texture_set == name):
                layout.faces[canvas] = found[canvas]
        if not layout.faces:
            raise UvError(
                f"{parts[0].mesh.name}: its texture coordinates cover nothing: none of them lies "
                "in a tile; make new ones with: texbake unwrap"
            )
        return layout
