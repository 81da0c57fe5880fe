"""Materials of a mesh: their base colors, as far as baking them needs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

from texbake.errors import MeshError
from texbake.files import PathLike
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.mesh import IntArray, Mesh, frozen

# Rows of a matrix that takes (u, v, 1) to (u, v) of an image.
Placing = tuple[tuple[float, float, float], tuple[float, float, float]]
UNPLACED: Placing = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))


@dataclass(frozen=True)
class BaseColor:
    """Base color of a material: a factor, times an image where there is one.

    Attributes
    ----------
    factor : (r, g, b)
        Linear.
    image : bytes, optional
        The content of an image file; sRGB.
    image_name : str
        Its name in messages.
    wrap : str
        What lies outside the unit square: `repeat`, `mirror` or `clamp`.
    placing : ((a, b, c), (d, e, f))
        Texture coordinates of the mesh, v up, to those of the image.
    """

    factor: tuple[float, float, float] = (1.0, 1.0, 1.0)
    image: bytes | None = None
    image_name: str = "image"
    wrap: str = "repeat"
    placing: Placing = UNPLACED


@dataclass(frozen=True, kw_only=True, eq=False)
class Materials:
    """Which material each face of a mesh has.

    Attributes
    ----------
    face_materials : (F,) int32
        Index into `names`.
    names : tuple of str
    base_colors : tuple of BaseColor or None
        One for each material; None where the file gives none.

    Raises
    ------
    MeshError
        An index is out of range, or there are not as many colors as names.
    """

    face_materials: IntArray
    names: tuple[str, ...]
    base_colors: tuple[BaseColor | None, ...]

    def __post_init__(self) -> None:
        ids = self.face_materials
        if len(self.base_colors) != len(self.names):
            raise MeshError(
                f"materials: {len(self.base_colors)} base colors for {len(self.names)} names"
            )
        if len(ids) and (ids.min() < 0 or ids.max() >= len(self.names)):
            raise MeshError(
                f"materials: an index is out of range; there are {len(self.names)} names"
            )
        object.__setattr__(self, "face_materials", frozen(ids))

    @classmethod
    def of_image(cls, mesh: Mesh, path: PathLike) -> Materials:
        """One material for all faces of a mesh, colored by an image file.

        Raises
        ------
        FileError
            The file is missing or cannot be read.
        """
        import numpy as np

        from texbake.mesh.files.source import map_file

        name = Path(path).name
        color = BaseColor(image=map_file(path).tobytes(), image_name=str(path))
        return cls(
            face_materials=np.zeros(mesh.n_faces, dtype=np.int32),
            names=(name,),
            base_colors=(color,),
        )


_READERS = {
    ".obj": ("materials", "read_obj_materials"),
    ".glb": ("materials", "read_gltf_materials"),
    ".gltf": ("materials", "read_gltf_materials"),
    ".fbx": ("fbx_materials", "read_fbx_materials"),
}


def read_materials(path: PathLike, mesh: MeshLike) -> Materials | None:
    """Read the materials of a mesh file: of OBJ with its .mtl files, glTF and FBX.

    Parameters
    ----------
    path
        The file that the mesh was read from.
    mesh
        As it was read.

    Returns
    -------
    Materials or None
        None where the format or the file has none.

    Raises
    ------
    FileError
        A file that it names is missing or cannot be read.
    FileFormatError
        It is damaged, or asks for what is not read.
    """
    mesh = as_mesh(mesh)
    reader = _READERS.get(Path(path).suffix.lower())
    if reader is None:
        return None
    read: Callable[[PathLike, Mesh], Materials | None]
    module, name = reader
    read = getattr(import_module(f"texbake.mesh.files.{module}"), name)
    return read(path, mesh)
