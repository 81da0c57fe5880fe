"""Reading FBX, binary and text, versions 6 and 7. Files of earlier versions are an error.

All geometry of the file is joined into one mesh, in the world, a geometry that two models show
twice. Differences between files are removed, as the reader of USD does:

- The axes of the file are turned to Y up, with Z to the front.
- Lengths become meters; a unit is a centimeter where the file does not say.

Each model is a group with its name; if it has several materials, each of them is a group named
``model/material``. For polygons see `texbake.mesh.polygons`. A subdivision surface is read as its
control mesh, and a mesh with bones or shapes in the pose it is stored in, without animation. Hidden
models are left out, unless all meshes are hidden, and so are NURBS, curves, lights and cameras. A
warning names omissions that change the surface. Of several sets of texture coordinates or colors,
the first is that of the mesh. Corners without one get zeros.

Based on: Autodesk, "FBX SDK Programmer's Guide", 2020; A. Gessler and C. Kerl, "FBX binary file
format specification", Blender developers' blog, 2013.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from texbake.errors import FileFormatError, MeshError, warn_of
from texbake.files import PathLike
from texbake.limits import most_triangles
from texbake.mesh.compose import join_parts, transformed
from texbake.mesh.files.conversion import finite_vertices
from texbake.mesh.files.fbx_geometry import FbxGeometry, read_geometry
from texbake.mesh.files.fbx_scene import (
    FbxObject,
    FbxScene,
    Id,
    PlacedModel,
    model_geometry,
    placed_models,
    read_scene,
)
from texbake.mesh.files.passed_over import passed_over_in_fbx, warn_of_fbx
from texbake.mesh.files.source import decode_name
from texbake.mesh.mesh import FloatArray, Mesh

_FIRST_VERSION = 6000
# A file may place this many triangles, or corners per byte: instances can repeat a few very often.
_LEAST_TRIANGLES, _CORNERS_PER_BYTE = 6_000_000, 4


def read_fbx(path: PathLike) -> Mesh:
    """Read an FBX file; see the module for how a scene is converted.

    Positions, normals, or those that smoothing makes, the first set of texture coordinates, vertex
    colors (of several at one vertex the first), and materials as groups.
    """
    scene = read_scene(path)
    placed, are_hidden = _models_to_read(scene)
    parts = [part.mesh(path) for part in read_parts(scene, placed)]
    if not parts:
        raise MeshError(f"{path}: {_why_empty(scene)}")
    if are_hidden:
        warn_of(path, "all its meshes are hidden; texbake reads them anyway")
    warn_of_fbx(scene, placed)
    return join_parts(parts, Path(path).name)


def _models_to_read(scene: FbxScene) -> tuple[list[PlacedModel], bool]:
    """Models that are shown, or all if none of those has a mesh; and whether that adds any."""
    shown = list(placed_models(scene))
    if any(model_geometry(scene, item.model) for item in shown):
        return shown, False
    all_models = list(placed_models(scene, hidden=True))
    return all_models, len(all_models) > len(shown)


def _why_empty(scene: FbxScene) -> str:
    """Return why a file has no triangles, and what to do."""
    if 0 < scene.version < _FIRST_VERSION:
        major, minor = divmod(scene.version // 100, 10)
        return (
            f"it is FBX {major}.{minor}, but only 6.0 and later are read; export it again as FBX "
            "7.4, or convert it with Autodesk's FBX Converter"
        )
    if any(model_geometry(scene, item) for item in scene.objects.values()):
        return "all its meshes are empty; a mesh needs at least one triangle"
    others = passed_over_in_fbx(scene)
    has = f", but {', '.join(others)}" if others else ""
    return f"it has no faces{has}; a mesh needs at least one triangle"


@dataclass(frozen=True, eq=False)
class FbxPart:
    """Geometry that a model shows: where, and with which materials."""

    model: FbxObject
    matrix: FloatArray
    geometry: FbxGeometry
    materials: list[FbxObject]

    def mesh(self, path: PathLike) -> Mesh:
        """Return it in the world, with its groups."""
        used, groups = np.unique(self.geometry.face_materials, return_inverse=True)
        names = [self._group_name(int(index)) for index in used]
        fields = dict(self.geometry.fields)
        fields["positions"], fields["faces"], fields["colors"] = finite_vertices(
            path, fields["positions"], fields["faces"], fields.get("colors")
        )
        mesh = Mesh(
            **fields,
            face_groups=groups.astype(np.int32),
            group_names=(self.model.name,) if len(used) == 1 else tuple(names),
            name=Path(path).name,
        )
        with np.errstate(over="ignore", invalid="ignore"):  # `Mesh` refuses what is not finite
            return transformed(mesh, self.matrix)

    def _group_name(self, index: int) -> str:
        is_known = 0 <= index < len(self.materials)
        material = self.materials[index].name if is_known else f"{index}"
        return f"{self.model.name}/{material}"


def read_parts(scene: FbxScene, models: Iterable[PlacedModel] | None = None) -> Iterator[FbxPart]:
    """Yield the geometry that the models of a scene show, in the order of the tree.

    `models` are the result of `_models_to_read`, if it is known.
    """
    read: dict[Id, FbxGeometry | None] = {}
    triangles = most_triangles(_LEAST_TRIANGLES)
    most = max(3 * triangles, _CORNERS_PER_BYTE * scene.n_bytes)
    uv_names = {uv_set_name(item) for item in scene.objects.values() if item.node.name == "Texture"}
    for placed in _models_to_read(scene)[0] if models is None else models:
        materials = scene.members_of(placed.model.key, "Material")
        for item in model_geometry(scene, placed.model):
            if item.key not in read:
                name = item.name or placed.model.name
                read[item.key] = read_geometry(scene.path, name, item.node, most, uv_names)
            geometry = read[item.key]
            if geometry is None:
                continue
            fields = geometry.fields
            most -= max(fields["faces"].size, fields["positions"].size)
            if most < 0:
                raise FileFormatError(
                    f"{scene.path}: it repeats far more triangles than it holds; if you trust the "
                    f"file, read it with texbake --max-triangles {10 * triangles}"
                )
            yield FbxPart(placed.model, placed.matrix, geometry, materials)


def uv_set_name(texture: FbxObject) -> str:
    """Name of the set of texture coordinates that a texture lies on; empty where it names none."""
    value = next(iter(texture.properties.get("UVSet", ())), b"")
    return decode_name(value) if isinstance(value, bytes) else ""
