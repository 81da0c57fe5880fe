"""Materials that a high-poly mesh is baked with: those of its file, or one image in their place."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from texbake.baking.maps import MATERIAL_MAPS
from texbake.baking.options import BakeOptions
from texbake.errors import OptionError
from texbake.files import PathLike
from texbake.mesh.materials import CHANNELS, Materials
from texbake.mesh.mesh import Mesh
from texbake.texture.image import read_image
from texbake.texture.material_images import check_gray
from texbake.texture.model_materials import read_materials


def check_high_texture(image: PathLike | None, maps: Iterable[str]) -> None:
    """Raise if an image is given for the materials, and none of the maps is read from one."""
    if image is not None and not _channels(maps):
        raise OptionError(
            f"high_texture, maps: {Path(image).name} is for a map of the materials, such as "
            "base-color or roughness, and none is asked for; name it in `maps`"
        )


def _channels(maps: Iterable[str]) -> list[str]:
    return [name for name in maps if name in CHANNELS and name != "normal"]


def needs_materials(maps: Iterable[str], options: BakeOptions) -> bool:
    """Return whether maps are made from the materials of the high-poly mesh."""
    of_materials = {*MATERIAL_MAPS, *(("normal",) if options.high_normal_maps else ())}
    return not of_materials.isdisjoint(maps)


def materials_of(
    path: PathLike, mesh: Mesh, image: PathLike | None, maps: Iterable[str] = ()
) -> Materials | None:
    """Return the materials of a mesh file if it has any, or one with an image for one of `maps`."""
    if image is None:
        return read_materials(path, mesh)
    channels = _channels(maps)
    if len(channels) > 1:
        raise OptionError(
            f"high_texture, maps: {Path(image).name} is the image of one map, and "
            f"{', '.join(channels)} are asked for; bake them one after the other"
        )
    if channels and len(CHANNELS[channels[0]].default) == 1:
        check_gray(read_image(image, color=False), channels[0])
    return Materials.of_image(mesh, image, *channels)
