"""Materials of USD files: UsdPreviewSurface, with the images that its inputs read; other contents.

A material of another shader is read as one without channels, which is noted; so is an image that is
missing, or lies on other texture coordinates than those of the mesh. Diffuse colors are read as
base colors. Specular colors, and what is added to images, are left out.

Based on: Pixar, "UsdPreviewSurface Specification", version 2.6.
"""

from __future__ import annotations

import math
from dataclasses import field, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from texbake.child import LIMITS
from texbake.core import portable_math as pm
from texbake.errors import quoted
from texbake.files import PathLike, read_bytes
from texbake.limits import file_beside
from texbake.mesh.files.channels import FILE_CHANNELS
from texbake.mesh.files.contents import FileContents, MaterialContent
from texbake.mesh.files.reader_process import read_in_child
from texbake.mesh.files.usd import prim_name, read_parts, texture_coordinates
from texbake.mesh.files.usd_stage import meters_per_unit, open_stage, reporting_damage
from texbake.mesh.materials import (
    CHANNELS,
    UNPLACED,
    ChannelImage,
    ChannelSource,
    Materials,
    MeshMaterial,
    MissingParts,
    Placing,
    materials_by_face,
)
from texbake.mesh.mesh import Mesh
from texbake.records import dataclass

_INPUTS = [where for where in FILE_CHANNELS.values() if where.usd]
# Channels that another default of a mesh's material makes necessary.
_ALWAYS = ("base-color", "metallic", "roughness")
_COMPONENTS = {"r": (0,), "g": (1,), "b": (2,), "a": (3,), "rgb": (0, 1, 2)}
# Black is the edge of most images that are meant to end there.
_WRAPS = {"clamp": "clamp", "black": "clamp", "mirror": "mirror"}
_BEYOND = 1e30  # what no number of a material is
_CLASSES = {made.__name__: made for made in (Materials, MeshMaterial, ChannelSource, ChannelImage)}


def read_usd_materials(path: PathLike, mesh: Mesh) -> Materials | None:
    """Read the materials of a USD file; None where no face has one."""
    found: Materials | None = read_in_child(path, "materials", _CLASSES)
    if found is None:
        return None
    # The groups of the mesh are those of the file, in its order.
    of_faces = materials_by_face(mesh, found.face_materials.tolist())
    return None if of_faces is None else replace(found, face_materials=of_faces[1])


def materials_of_stage(path: PathLike) -> Materials | None:
    """Answer for `read_usd_materials`: with a material for each group, as if these were faces."""
    from pxr import UsdGeom

    stage = open_stage(path)
    with reporting_damage(path):
        parts = read_parts(path, stage)
        holders = [holder for part in parts for holder in part.holders]
        bound = [_bound_material(stage, holder) for holder in holders]
        paths = [str(material.GetPath()) if material else "" for material in bound]
        if not any(paths):
            return None
        primvars = (texture_coordinates(part.prim) for part in parts)
        names = {str(primvar.GetPrimvarName()) for primvar in primvars if primvar is not None}
        reader = _MaterialReader(path, names)
        found = dict(zip(paths, bound, strict=True))
        sides = [UsdGeom.Mesh(part.prim).GetDoubleSidedAttr().Get() for part in parts]
        owners = [both for part, both in zip(parts, sides, strict=True) for _ in part.holders]
        double_sided = {name for name, both in zip(paths, owners, strict=True) if both}
        materials = tuple(
            replace(reader.material(material), is_double_sided=name in double_sided)
            for name, material in found.items()
        )
    numbers = {name: i for i, name in enumerate(found)}
    of_groups = np.array([numbers[name] for name in paths], dtype=np.int32)
    return Materials(face_materials=of_groups, materials=materials, **reader.missing.fields())


def _bound_material(stage: Any, prim: Any) -> Any:
    """Material of a prim: its own, or that of the prim above it that is nearest or says it is."""
    from pxr import UsdShade

    strength_of = UsdShade.MaterialBindingAPI.GetMaterialBindingStrength
    stronger = UsdShade.Tokens.strongerThanDescendants
    found = None
    while prim and not prim.IsPseudoRoot():
        binding = prim.GetRelationship("material:binding")
        targets = binding.GetTargets() if binding else ()
        material = UsdShade.Material(stage.GetPrimAtPath(targets[0])) if targets else None
        if material and (found is None or strength_of(binding) == stronger):
            found = material
        prim = prim.GetParent()
    return found


@dataclass(frozen=True, eq=False)
class _MaterialReader:
    """Reads the materials of a stage."""

    path: PathLike
    coordinates: set[str]  # primvars of the texture coordinates of the mesh
    missing: MissingParts = field(default_factory=MissingParts)  # what could not be read

    def material(self, material: Any) -> MeshMaterial:
        """Read a material; one without channels where there is none, or no preview surface."""
        if not material:
            return MeshMaterial(name="default")
        name = prim_name(material.GetPrim())
        surface = material.ComputeSurfaceSource()[0]
        kind = surface.GetIdAttr().Get() if surface else None
        if kind != "UsdPreviewSurface":
            shader = f"its shader {kind} is not" if kind else "it has no shader that is"
            self.missing.add("", f"{name}: {shader} read")
            return MeshMaterial(name=name)
        channels = {}
        for where in _INPUTS:
            channel = where.name
            source = self._source(name, channel, surface.GetInput(where.usd), where.usd_default)
            is_set = source.image is not None or source.factor != CHANNELS[channel].default
            if channel in _ALWAYS or is_set:
                channels[channel] = source
        if "clearcoat" not in channels:
            channels.pop("clearcoat-roughness", None)
        if "normal" in channels and channels["normal"].image is None:
            del channels["normal"]
        cutoff = _numbers(_value(surface.GetInput("opacityThreshold")), (0.0,))[0]
        mode = "blend" if "alpha" in channels else "opaque"
        return MeshMaterial(
            name=name,
            channels=channels,
            alpha_mode="mask" if cutoff > 0.0 and mode == "blend" else mode,
            alpha_cutoff=min(cutoff, 1.0) if cutoff > 0.0 else 0.5,
        )

    def _source(
        self, material: str, channel: str, source: Any, default: tuple[float, ...]
    ) -> ChannelSource:
        """Return where a channel comes from: a value, or an image."""
        shader, output = _producer(source)
        if shader is None:
            values = _numbers(_value(source), default)
            bound = 1.0 if CHANNELS[channel].is_bounded else _BEYOND
            if channel == "normal":
                return ChannelSource(values)
            return ChannelSource(tuple(min(max(value, 0.0), bound) for value in values))
        image = self._image(channel, shader, output)
        fallback = _numbers(_value(shader.GetInput("fallback")), (*default, 1.0, 1.0, 1.0)[:4])
        fallback = fallback[: len(default)]
        if isinstance(image, str):
            self.missing.add(channel, f"{material}: {image}")
            return ChannelSource(fallback)
        scale = _numbers(_value(shader.GetInput("scale")), (1.0,) * 4)
        factor = tuple(scale[i] for i in image.components)
        bias = _numbers(_value(shader.GetInput("bias")), (0.0,) * 4)
        added = tuple(bias[i] for i in image.components)
        if channel == "normal":
            # texel scale + bias is (2 texel - 1) scale / 2, as the images of normals are coded.
            is_coded = added == tuple(-0.5 * value for value in factor)
            factor = tuple(0.5 * value for value in factor) if is_coded else (1.0, 1.0, 1.0)
        elif any(added):
            line = f"{material}: what is added to the image of its {channel} is left out"
            self.missing.add(channel, line)
        return ChannelSource(factor, image, fallback=fallback)

    def _image(self, channel: str, shader: Any, output: str) -> ChannelImage | str:
        """Read the image of a texture, or say why there is none."""
        kind = shader.GetIdAttr().Get()
        components = _COMPONENTS.get(output)
        if kind != "UsdUVTexture" or components is None:
            return f"its shader {kind} is not read"
        n = len(CHANNELS[channel].default)
        components = components if len(components) == n else components[:1] * n
        placing, primvar = _placed(shader.GetInput("st"))
        if primvar is not None and primvar not in self.coordinates:
            return (
                f"its image lies on {quoted(primvar)}, and the mesh has other texture coordinates"
            )
        named, resolved, data = _image_file(shader)
        if data is None:
            self.missing.images[named] = None
            return f"its image {quoted(named)} is missing"
        u, v = (
            _WRAPS.get(str(_value(shader.GetInput(axis))), "repeat") for axis in ("wrapS", "wrapT")
        )
        return ChannelImage(
            data=data, name=resolved, components=components, wraps=(u, v), placing=placing
        )


def _producer(source: Any) -> tuple[Any, str]:
    """Shader whose output an input is connected to, and the output's name; None where none."""
    from pxr import UsdShade

    attributes = source.GetValueProducingAttributes() if source else ()
    for attribute in attributes:
        name, kind = UsdShade.Utils.GetBaseNameAndType(attribute.GetName())
        if kind == UsdShade.AttributeType.Output:
            return UsdShade.Shader(attribute.GetPrim()), str(name)
    return None, ""


def _value(source: Any) -> Any:
    """Value of an input, also of one that an input of the material sets; None where none."""
    from pxr import Usd

    attributes = source.GetValueProducingAttributes() if source else ()
    return attributes[0].Get(Usd.TimeCode.EarliestTime()) if attributes else None


def _numbers(value: Any, default: tuple[float, ...]) -> tuple[float, ...]:
    """Return as many numbers as the default has; the default where they are no such numbers."""
    values = (value,) if isinstance(value, int | float) else value
    try:
        numbers = tuple(float(number) for number in values)
    except (TypeError, ValueError):
        return default
    is_sound = len(numbers) == len(default) and all(abs(number) < _BEYOND for number in numbers)
    return numbers if is_sound else default


def _placed(source: Any) -> tuple[Placing, str | None]:
    """Transform of the coordinates that a texture reads, and the primvar that they come from."""
    placing, primvar = UNPLACED, None
    shader, _ = _producer(source)
    if shader is not None and shader.GetIdAttr().Get() == "UsdTransform2d":
        scale = _numbers(_value(shader.GetInput("scale")), (1.0, 1.0))
        (angle,) = _numbers(_value(shader.GetInput("rotation")), (0.0,))
        x, y = _numbers(_value(shader.GetInput("translation")), (0.0, 0.0))
        sin, cos = pm.sin(math.radians(angle)), pm.cos(math.radians(angle))
        placing = ((cos * scale[0], -sin * scale[1], x), (sin * scale[0], cos * scale[1], y))
        shader, _ = _producer(shader.GetInput("in"))
    if shader is not None and shader.GetIdAttr().Get() == "UsdPrimvarReader_float2":
        name = _value(shader.GetInput("varname"))
        primvar = str(name) if name else None
    return placing, primvar


def _image_file(shader: Any) -> tuple[str, str, bytes | None]:
    """Path of an image as the file has it and as it was found, and its content; None without it."""
    asset = _value(shader.GetInput("file"))
    resolved = str(getattr(asset, "resolvedPath", ""))
    root = shader.GetPrim().GetStage().GetRootLayer().realPath
    data = _asset_bytes(root, resolved) if resolved else None
    return str(getattr(asset, "path", "")), resolved, data


@cache  # of a process that answers one question
def _asset_bytes(root: str, resolved: str) -> bytes | None:
    """Content of an image beside the file, or in a package; None where there is none."""
    from pxr import Ar

    try:
        file_beside(root, resolved)  # raises where it lies outside the folder of the stage
        if not Ar.IsPackageRelativePath(resolved):
            LIMITS.allow(Path(resolved).stat().st_size)
            return read_bytes(resolved)
        asset = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(resolved))
        if not asset:
            return None
        with asset:
            return bytes(asset.GetBuffer()) or None
    except OSError:
        return None


def contents_of_stage(path: PathLike) -> FileContents:
    """Answer for `read_contents`."""
    from pxr import UsdGeom, UsdShade

    stage = open_stage(path)
    materials = []
    images: dict[str, bytes | None] = {}
    uv_sets: dict[str, None] = {}
    with reporting_damage(path):
        for prim in stage.Traverse():
            if prim.IsA(UsdShade.Material):
                channels: dict[str, str | None] = {}
                surface = UsdShade.Material(prim).ComputeSurfaceSource()[0]
                for where in _INPUTS if surface else ():
                    source = surface.GetInput(where.usd)
                    shader, _ = _producer(source)
                    if shader is not None:
                        file, _, data = _image_file(shader)
                        channels[where.name] = Path(file).name
                        images[Path(file).name] = data
                    elif _value(source) is not None:
                        channels[where.name] = None
                materials.append(MaterialContent(name=prim_name(prim), channels=channels))
            elif prim.IsA(UsdGeom.Mesh):
                primvars = UsdGeom.PrimvarsAPI(prim).FindPrimvarsWithInheritance()
                uv_sets |= {
                    str(primvar.GetPrimvarName()): None
                    for primvar in primvars
                    if str(primvar.GetTypeName()).startswith("texCoord2")
                }
        meters, up = meters_per_unit(stage), str(UsdGeom.GetStageUpAxis(stage))
    return FileContents(
        materials=tuple(materials),
        images=images,
        uv_sets=tuple(uv_sets),
        meters_per_unit=meters,
        up=f"+{up}",
    )
