"""What a USD file says besides its surface, as `read_contents` returns it."""

from __future__ import annotations

import math
from pathlib import Path

from texbake.files import PathLike
from texbake.mesh.files.contents import FileContents, MaterialContent
from texbake.mesh.files.usd_materials import usd_channels
from texbake.mesh.files.usd_stage import open_stage, reporting_damage


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
                for channel, image in usd_channels(UsdShade.Material(prim)).items():
                    channels[channel] = None if image is None else Path(image[0]).name
                    if image is not None:
                        images[Path(image[0]).name] = image[1]
                name = str(prim.GetDisplayName() or prim.GetName())
                materials.append(MaterialContent(name=name, channels=channels))
            elif prim.IsA(UsdGeom.Mesh):
                primvars = UsdGeom.PrimvarsAPI(prim).FindPrimvarsWithInheritance()
                uv_sets |= {
                    str(primvar.GetPrimvarName()): None
                    for primvar in primvars
                    if str(primvar.GetTypeName()).startswith("texCoord2")
                }
        has_unit = UsdGeom.StageHasAuthoredMetersPerUnit(stage)
        meters = float(UsdGeom.GetStageMetersPerUnit(stage)) if has_unit else 0.0
        up = str(UsdGeom.GetStageUpAxis(stage))
    return FileContents(
        materials=tuple(materials),
        images=images,
        uv_sets=tuple(uv_sets),
        meters_per_unit=meters if 0.0 < meters < math.inf else None,
        up=f"+{up}",
    )
