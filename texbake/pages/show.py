"""A page of one mesh for a notebook: the 3D view with its lights, its maps and its UV layout."""

from __future__ import annotations

import html
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy.typing as npt

from texbake.baking.result import BakedMap, BakeResult
from texbake.errors import OptionError
from texbake.files import PathLike, scratch_folder
from texbake.mesh.frame import LocalFrame
from texbake.mesh.interchange import MeshLike, as_mesh, plain_array
from texbake.mesh.mesh import Mesh
from texbake.pages.page import as_json, asset, page_html, render, write_page
from texbake.pages.pictures import (
    MapPicture,
    baked_pictures,
    data_uri,
    file_pictures,
    picture_codes,
    png_of,
)
from texbake.pages.viewer import CODINGS, packed_mesh, shown_mesh, view_settings
from texbake.records import dataclass
from texbake.rendering.options import RenderOptions
from texbake.rendering.render import render as render_mesh
from texbake.texture.checker import checker_image
from texbake.texture.image import write_image
from texbake.texture.image_files import encode_image

_STILL_PX = 480
_CHECKER_TEXELS = 512

Maps = BakeResult | Mapping[str, Any]


@dataclass(frozen=True, repr=False)
class MeshPage:
    """The page of a mesh: a notebook shows it, and `write` makes a file of it."""

    title: str
    html: str  # the whole page, which works offline
    height: int  # pixels in a notebook

    def __repr__(self) -> str:
        return f"<MeshPage {self.title}: {len(self.html) / 1e6:.1f} MB>"

    def _repr_html_(self) -> str:
        style = f"width: 100%; height: {int(self.height)}px; border: 0"
        title, page = html.escape(self.title), html.escape(self.html)
        words = f'title="{title}" style="{style}" sandbox="allow-scripts" srcdoc="{page}"'
        return f"<iframe {words}></iframe>"

    def write(self, path: PathLike) -> None:
        """Write the page as an HTML file."""
        write_page(path, self.html)


def show(
    mesh: MeshLike, maps: Maps | None = None, *, up: str = RenderOptions.up, height: int = 640
) -> MeshPage:
    """Show a mesh in a notebook: in 3D with lights and wireframe, and with its maps and UV layout.

    A mesh of more than 300,000 triangles is simplified for the view.

    Parameters
    ----------
    mesh
        A `Mesh`, a `trimesh.Trimesh` or the path of a file.
    maps
        What `bake` returned, or maps by name: its maps, files, or arrays as for `write_image`, such
        as ``{"normal": "normal.png", "color": np.zeros((64, 64, 3))}``. The map `normal` is shown
        as relief, and the others as colors of the surface. None shows a checker if the mesh has
        texture coordinates.
    up
        World axis that points up: `y` or `z`.
    height
        Height of the view in a notebook, in pixels.

    Raises
    ------
    UvError
        There are maps, but the mesh has no texture coordinates.
    FileError
        A map file does not exist or cannot be read.
    OptionError
        An array is not an image.

    Examples
    --------
    >>> from texbake.mesh.shapes import uv_sphere
    >>> page = show(uv_sphere(9, 16))
    >>> page.html[:15]
    '<!DOCTYPE html>'
    """
    mesh = as_mesh(mesh)
    if maps:
        mesh.uv_set(None)
    pictures = _pictures(mesh, maps)
    shown = shown_mesh(mesh, keeps_uvs=True)
    options = RenderOptions(width=_STILL_PX, height=_STILL_PX, exposure="auto", up=up)
    still = encode_image(picture_codes(render_mesh(shown, options=options).color), "jpeg")
    has_normals = bool(maps) and any(picture.name == "normal" for picture in pictures)
    settings = view_settings((mesh,), pictures, options) | {"labels": {"low": "", "baked": ""}}
    data = {"mesh-low": packed_mesh(shown, LocalFrame.around(mesh))}
    data["view-settings"] = as_json(settings)
    if pictures:
        data["map-settings"] = as_json([picture.settings() for picture in pictures])
    body = render(
        "mesh.html",
        mesh=mesh,
        about=_about(mesh, shown),
        still=data_uri(still, "image/jpeg"),
        pictures=pictures,
        has_normals=has_normals,
    )
    page = page_html(
        mesh.name,
        body,
        styles=[asset("controls.css"), asset("asset.css")],
        scripts=[asset("three.min.js"), asset("page.js"), asset("view.js"), asset("maps.js")],
        data=data,
    )
    return MeshPage(mesh.name, page, height)


def _written(image: npt.NDArray[Any], name: str, path: Path) -> Path:
    """Write an image (H, W) or (H, W, C) as a file; its path, with the end of its name added."""
    if image.ndim not in (2, 3) or image.size == 0:
        raise OptionError(f"maps: {name}: the shape {image.shape} is no image; pass (H, W, C)")
    coding = CODINGS.get(name, "color")
    # A file of floats is shown from its least value to its greatest.
    is_scaled = image.dtype.kind == "f" and coding not in ("color", "normal")
    path = path.with_suffix(".exr" if is_scaled else ".png")
    try:
        write_image(image, path, color=coding == "color")
    except OptionError as error:
        reason = str(error).removeprefix(f"{path}: ")
        raise OptionError(f"maps: {name}: {reason}") from None
    return path


def _pictures(mesh: Mesh, maps: Maps | None) -> list[MapPicture]:
    if isinstance(maps, BakeResult):
        maps = maps.maps
    if maps is not None and not isinstance(maps, Mapping):
        raise OptionError("maps: pass what `bake` returned, or maps, files or arrays by name")
    if maps:
        baked = {name: item for name, item in maps.items() if isinstance(item, BakedMap)}
        files = {name: item for name, item in maps.items() if not isinstance(item, BakedMap)}
        with scratch_folder() as folder:
            for number, (name, item) in enumerate(files.items()):
                if not isinstance(item, (str, os.PathLike)):
                    files[name] = folder / str(number)
                    files[name] = _written(plain_array(item, f"maps: {name}"), name, files[name])
            return [*baked_pictures(baked), *file_pictures(files, codings=CODINGS)]
    if mesh.uvs is None:
        return []
    checker = png_of(checker_image(_CHECKER_TEXELS))
    side = _CHECKER_TEXELS
    return [
        MapPicture(
            name="checker",
            uri=data_uri(checker),
            width=side,
            height=side,
            full_width=side,
            full_height=side,
            coding="",
            metadata={},
        )
    ]


def _about(mesh: Mesh, shown: Mesh) -> str:
    about = f"{mesh.n_faces:,} triangles, {mesh.n_vertices:,} vertices."
    if shown.n_faces < mesh.n_faces:
        about += f" The view shows {shown.n_faces:,} triangles."
    return about
