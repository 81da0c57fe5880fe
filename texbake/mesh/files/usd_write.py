"""Writing USD: a mesh per object, with groups as subsets, and a UsdPreviewSurface with textures.

docs/reference/formats.md says what is written. The format's points are float32, so a mesh that is
far from the origin for its size is moved there by its transform. Names that are no identifiers of
USD are kept as display names.

Based on: Pixar, "Universal Scene Description", UsdGeom and "UsdPreviewSurface Specification",
version 2.6; "Usdz File Format Specification", version 1.3.
"""

from __future__ import annotations

import os
import struct
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain, count
from pathlib import Path
from typing import Any

import numpy as np

from texbake.files import PathLike, replacing, scratch_folder
from texbake.mesh.compose import excerpt
from texbake.mesh.files.channels import FILE_CHANNELS
from texbake.mesh.files.conversion import (
    as_text,
    check_normal_map,
    color_factors,
    far_origin,
    float32_positions,
    image_file,
    require_uvs,
)
from texbake.mesh.files.openpbr import openpbr_nodes
from texbake.mesh.files.usd_stage import require_usd
from texbake.mesh.mesh import FloatArray, Int64Array, Mesh
from texbake.mesh.normals import shading_normals, with_shading_normals
from texbake.mesh.objects import object_names, separate_objects
from texbake.mesh.polygons import Outlines, outlines

# Bytes of an entry's head before its name, and the field that usdz files pad with.
_ZIP_HEAD, _PADDING_FIELD = 30, 0x1986
_EXTENSIONS = {"image/png": ".png", "image/jpeg": ".jpg"}


def write_usd(
    mesh: Mesh,
    path: PathLike,
    *,
    normal_map: PathLike | None = None,
    base_color: PathLike | Sequence[float] | None = None,
    orm: PathLike | None = None,
    emissive: PathLike | None = None,
    name: str | None = None,
    materialx: bool = False,
) -> None:
    """Write .usd, .usda, .usdc or .usdz; with `materialx`, also OpenPBR as MaterialX."""
    require_usd(path)
    sources = {"normal": normal_map, "base_color": base_color, "orm": orm, "emissive": emissive}
    textures = {
        slot: Path(source)
        for slot, source in sources.items()
        if isinstance(source, str | os.PathLike)
    }
    if textures:
        require_uvs(mesh)
    if normal_map is not None:
        check_normal_map(normal_map)
    name = Path(path).stem if name is None else name
    factors = None
    if base_color is not None and "base_color" not in textures:
        factors = color_factors(base_color)  # type: ignore[arg-type]
    is_package = Path(path).suffix.lower() == ".usdz"
    folder = Path(os.path.realpath(path)).parent
    places = {}
    for slot, file in textures.items():
        suffix = _EXTENSIONS[image_file(file)[1]]
        places[slot] = f"textures/{slot}{suffix}"
        if not is_package:
            places[slot] = Path(os.path.relpath(os.path.realpath(file), folder)).as_posix()
    stage = _stage(path, mesh, name, places, factors)
    if materialx and places:
        _add_openpbr(stage, places)
    with replacing(path) as temporary:
        if is_package:
            _package(stage, temporary, {places[slot]: textures[slot] for slot in textures})
        else:
            stage.GetRootLayer().Export(str(temporary))


def _package(stage: Any, path: Path, textures: Mapping[str, Path]) -> None:
    """Write a .usdz file, stage first, without the time that USD's own writer puts in."""
    with scratch_folder() as folder:
        root = folder / "asset.usdc"
        stage.GetRootLayer().Export(str(root))
        files = {root.name: root, **textures}
        with path.open("wb") as file, zipfile.ZipFile(file, "w") as package:
            for place, source in files.items():
                entry = zipfile.ZipInfo(place)
                # Data begins at a multiple of 64 bytes, by an extra field that says nothing; the
                # field has a head of 4 bytes.
                padding = -(file.tell() + _ZIP_HEAD + len(place.encode()) + 4) % 64
                entry.extra = struct.pack("<HH", _PADDING_FIELD, padding) + bytes(padding)
                package.writestr(entry, source.read_bytes())


def _stage(
    path: PathLike,
    mesh: Mesh,
    name: str,
    textures: Mapping[str, str],
    factors: Sequence[float] | None,
) -> Any:
    """Build the stage; `textures` are paths as the file is to have them, `path` is for warnings."""
    from pxr import Sdf, Usd, UsdGeom

    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, Sdf.Path("/asset")).GetPrim())
    origin = far_origin(mesh)
    taken, usd_meshes, n_split = {"material"}, [], 0
    for title, part in _objects(mesh, name):
        usd_mesh = UsdGeom.Mesh.Define(stage, Sdf.Path(f"/asset/{_identifier(title, taken)}"))
        if usd_mesh.GetPrim().GetName() != title:
            usd_mesh.GetPrim().SetDisplayName(as_text(title))
        if origin.any():
            usd_mesh.AddTranslateOp().Set(tuple(origin.tolist()))
        polygons = outlines(part)
        n_split += polygons.n_split
        _set_geometry(usd_mesh, part, origin, polygons)
        _set_primvars(usd_mesh, part, polygons.slots)
        _set_groups(usd_mesh, part, polygons.firsts)
        usd_meshes.append(usd_mesh)
    replace(polygons, n_split=n_split).warn(path)
    _add_material(stage, usd_meshes, name, textures, factors)
    return stage


def _objects(mesh: Mesh, name: str) -> Iterator[tuple[str, Mesh]]:
    """Yield each object of a mesh with its name; the whole mesh with `name` if there are none."""
    objects = separate_objects(mesh)
    if objects is None:
        yield mesh.group_names[0] if len(mesh.group_names) == 1 else name, mesh
        return
    whole, names = with_shading_normals(mesh), object_names(mesh)
    for number in np.unique(objects):
        part = excerpt(whole, objects == number)
        assert part.face_groups is not None
        used, groups = np.unique(part.face_groups, return_inverse=True)
        yield (
            names[used[0]],
            part.replace(
                face_groups=groups.astype(np.int32),
                group_names=tuple(
                    mesh.group_names[group].removeprefix(f"{names[used[0]]}/") for group in used
                ),
                group_objects=(),
            ),
        )


def _identifier(name: str, taken: set[str]) -> str:
    """Return a USD identifier that is not in `taken`, and add it there."""
    from pxr import Tf

    first = Tf.MakeValidIdentifier(as_text(name))
    names = chain([first], (f"{first}_{number}" for number in count(1)))
    identifier = next(name for name in names if name not in taken)
    taken.add(identifier)
    return str(identifier)


def _set_geometry(usd_mesh: Any, mesh: Mesh, origin: FloatArray, polygons: Outlines) -> None:
    from pxr import UsdGeom, Vt

    points = float32_positions(mesh, origin)
    usd_mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
    usd_mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(polygons.sizes.astype(np.int32)))
    usd_mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(mesh.faces.ravel()[polygons.slots]))
    usd_mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    usd_mesh.CreateExtentAttr(
        Vt.Vec3fArray.FromNumpy(np.array([points.min(axis=0), points.max(axis=0)]))
    )


def _set_primvars(usd_mesh: Any, mesh: Mesh, slots: Int64Array) -> None:
    """Set normals, texture coordinates, tangents and colors, by corners of polygons."""
    from pxr import Sdf, UsdGeom, Vt

    normals, normal_faces = shading_normals(mesh)
    varies = not np.array_equal(normal_faces, mesh.faces)
    values = normals[normal_faces.ravel()[slots]] if varies else normals
    usd_mesh.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(values.astype(np.float32)))
    usd_mesh.SetNormalsInterpolation(
        UsdGeom.Tokens.faceVarying if varies else UsdGeom.Tokens.vertex
    )
    primvars = UsdGeom.PrimvarsAPI(usd_mesh)
    if mesh.uvs is not None and mesh.uv_faces is not None:
        uvs = primvars.CreatePrimvar(
            "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.faceVarying
        )
        uvs.Set(Vt.Vec2fArray.FromNumpy(mesh.uvs.astype(np.float32)))
        uvs.SetIndices(Vt.IntArray.FromNumpy(mesh.uv_faces.ravel()[slots]))
    if mesh.tangents is not None:
        tangents = primvars.CreatePrimvar(
            "tangents", Sdf.ValueTypeNames.Float4Array, UsdGeom.Tokens.faceVarying
        )
        tangents.Set(Vt.Vec4fArray.FromNumpy(mesh.tangents.reshape(-1, 4)[slots]))
    if mesh.colors is not None and mesh.colors.shape[1] in (3, 4):
        colors = usd_mesh.CreateDisplayColorPrimvar(UsdGeom.Tokens.vertex)
        colors.Set(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(mesh.colors[:, :3])))
        if mesh.colors.shape[1] == 4:
            opacity = usd_mesh.CreateDisplayOpacityPrimvar(UsdGeom.Tokens.vertex)
            opacity.Set(Vt.FloatArray.FromNumpy(np.ascontiguousarray(mesh.colors[:, 3])))


def _set_groups(usd_mesh: Any, mesh: Mesh, firsts: Int64Array) -> None:
    """Make each group with polygons a subset of them; `firsts` are their first faces."""
    from pxr import UsdGeom, Vt

    if mesh.face_groups is None or len(mesh.group_names) < 2:
        return
    family = "materialBind"
    taken: set[str] = set()
    for number, group in enumerate(mesh.group_names):
        faces = np.flatnonzero(mesh.face_groups[firsts] == number).astype(np.int32)
        if len(faces) == 0:
            continue
        identifier = _identifier(group, taken)
        subset = UsdGeom.Subset.CreateGeomSubset(
            UsdGeom.Imageable(usd_mesh),
            identifier,
            UsdGeom.Tokens.face,
            Vt.IntArray.FromNumpy(faces),
            family,
        )
        if identifier != group:
            subset.GetPrim().SetDisplayName(as_text(group))
    UsdGeom.Subset.SetFamilyType(UsdGeom.Imageable(usd_mesh), family, UsdGeom.Tokens.partition)


def _add_material(
    stage: Any,
    usd_meshes: Sequence[Any],
    name: str,
    textures: Mapping[str, str],
    factors: Sequence[float] | None,
) -> None:
    """Add the material that all faces share, and bind it."""
    from pxr import Gf, Sdf, UsdShade

    material = UsdShade.Material.Define(stage, Sdf.Path("/asset/material"))
    material.GetPrim().SetDisplayName(as_text(name))
    surface = UsdShade.Shader.Define(stage, Sdf.Path("/asset/material/surface"))
    surface.CreateIdAttr("UsdPreviewSurface")
    types = Sdf.ValueTypeNames
    surface.CreateInput("roughness", types.Float).Set(0.5)
    surface.CreateInput("metallic", types.Float).Set(0.0)
    if factors is not None:
        surface.CreateInput("diffuseColor", types.Color3f).Set(Gf.Vec3f(*factors[:3]))
        surface.CreateInput("opacity", types.Float).Set(float(factors[3]))
    if textures:
        coordinates = UsdShade.Shader.Define(stage, Sdf.Path("/asset/material/coordinates"))
        coordinates.CreateIdAttr("UsdPrimvarReader_float2")
        coordinates.CreateInput("varname", types.String).Set("st")
        places = coordinates.CreateOutput("result", types.Float2)
        for slot, file in textures.items():
            texture = _texture(stage, slot, file, places)
            for where in map(FILE_CHANNELS.__getitem__, _SLOTS[slot]):
                is_vector = len(where.components) == 3
                kind = "Float" if not is_vector else "Normal3f" if slot == "normal" else "Color3f"
                output = "rgb" if is_vector else "rgba"[where.components[0]]
                value = texture.CreateOutput(output, types.Float3 if is_vector else types.Float)
                surface.CreateInput(where.usd, getattr(types, kind)).ConnectToSource(value)
    material.CreateSurfaceOutput().ConnectToSource(surface.ConnectableAPI(), "surface")
    for usd_mesh in usd_meshes:
        UsdShade.MaterialBindingAPI.Apply(usd_mesh.GetPrim()).Bind(material)


# Channels that are read of each texture.
_SLOTS = {
    "normal": ("normal",),
    "base_color": ("base-color",),
    "orm": ("occlusion", "roughness", "metallic"),
    "emissive": ("emissive",),
}


# Types of MaterialX as USD has them, and definitions of its nodes whose names do not follow from
# their category and type.
_TYPES = {
    "color3": "Color3f", "vector3": "Float3", "float": "Float", "integer": "Int",
    "filename": "Asset", "surfaceshader": "Token",
}  # fmt: skip
_DEFINITIONS = {"extract": "ND_extract_vector3", "normalmap": "ND_normalmap_float"}


def _add_openpbr(stage: Any, textures: Mapping[str, str]) -> None:
    """Add the material as nodes of MaterialX, in the render context that reads them."""
    from pxr import Sdf, UsdShade

    types, above = Sdf.ValueTypeNames, "/asset/material/openpbr"
    place = UsdShade.Shader.Define(stage, Sdf.Path(f"{above}_coordinates"))
    place.CreateIdAttr("ND_geompropvalue_vector2")
    place.CreateInput("geomprop", types.String).Set("st")
    coordinates = place.CreateOutput("out", types.Float2)
    outputs: dict[str, Any] = {}
    *nodes, _ = openpbr_nodes({slot.replace("_", "-"): file for slot, file in textures.items()})
    for node in nodes:
        shader = UsdShade.Shader.Define(stage, Sdf.Path(f"{above}_{node.name}"))
        shader.CreateIdAttr(_DEFINITIONS.get(node.category, f"ND_{node.category}_{node.type}"))
        if node.category == "image":
            shader.CreateInput("texcoord", types.Float2).ConnectToSource(coordinates)
        for key, (type_, meaning, value) in node.inputs.items():
            item = shader.CreateInput(key, getattr(types, _TYPES[type_]))
            if meaning == "node":
                item.ConnectToSource(outputs[value])
            elif meaning == "file":
                item.Set(Sdf.AssetPath(as_text(value)))
                if node.type == "color3":
                    item.GetAttr().SetColorSpace("srgb_texture")
            else:
                item.Set(int(value) if type_ == "integer" else float(value))
        outputs[node.name] = shader.CreateOutput("out", getattr(types, _TYPES[node.type]))
    material = UsdShade.Material.Get(stage, Sdf.Path("/asset/material"))
    material.CreateSurfaceOutput("mtlx").ConnectToSource(outputs["surface"])


def _texture(stage: Any, slot: str, file: str, places: Any) -> Any:
    """Return a shader that reads an image."""
    from pxr import Gf, Sdf, UsdShade

    texture = UsdShade.Shader.Define(stage, Sdf.Path(f"/asset/material/{slot}"))
    types = Sdf.ValueTypeNames
    texture.CreateIdAttr("UsdUVTexture")
    texture.CreateInput("file", types.Asset).Set(Sdf.AssetPath(as_text(file)))
    texture.CreateInput("st", types.Float2).ConnectToSource(places)
    for axis in "wrapS", "wrapT":
        texture.CreateInput(axis, types.Token).Set("repeat")
    is_color = slot in ("base_color", "emissive")
    texture.CreateInput("sourceColorSpace", types.Token).Set("sRGB" if is_color else "raw")
    if slot == "normal":
        texture.CreateInput("scale", types.Float4).Set(Gf.Vec4f(2.0, 2.0, 2.0, 1.0))
        texture.CreateInput("bias", types.Float4).Set(Gf.Vec4f(-1.0, -1.0, -1.0, 0.0))
    return texture
