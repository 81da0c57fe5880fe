"""Textures of glTF materials: their image, how it is looked up, and where it lies on the surface.

glTF has the origin of texture coordinates at the upper left with v down; here it is at the lower
left with v up, and what moves coordinates is turned accordingly.
"""

from __future__ import annotations

import base64
import binascii
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from texbake.errors import FileError
from texbake.mesh.files.gltf_document import Document
from texbake.mesh.files.source import require_file
from texbake.rendering.scene.textures import Constant, ImageTexture
from texbake.texture.image import Image, decode_image

_NEAREST = 9728
_FILTERS_WITHOUT_MIPS = (9728, 9729)
_WRAPS = {33071: "clamp", 33648: "mirror", 10497: "repeat"}
_REPEAT = 10497


@dataclass(eq=False)
class TextureReader:
    """Reads the textures of a document, each image once.

    Attributes
    ----------
    document
        The file.
    notes
        What it asks for and is not shown; added to.
    """

    document: Document
    notes: list[str] = field(default_factory=list)
    _images: dict[tuple[int, bool], Path | Image] = field(default_factory=dict)

    def texture(
        self,
        info: dict[str, Any],
        *,
        color: bool,
        channel: int | None = None,
        factor: Constant = 1.0,
    ) -> ImageTexture:
        """Texture of a textureInfo object.

        Parameters
        ----------
        info
            Of a material: `index`, and maybe KHR_texture_transform.
        color
            Whether the codes of its image are sRGB.
        channel, factor
            As of `ImageTexture`.
        """
        texture = self.document.item("textures", info.get("index"))
        sampler = {}
        if "sampler" in texture:
            sampler = self.document.item("samplers", texture["sampler"])
        return ImageTexture(
            image=self._image(texture, color),
            filter=_filter(sampler),
            wrap=self._wrap(sampler),
            channel=channel,
            factor=factor,
            color=color,
            **self._transform(info),
        )

    def uv_set(self, info: dict[str, Any]) -> int:
        """Number of the texture coordinates that a textureInfo object uses."""
        transform = self._extension(info, "KHR_texture_transform")
        owner = transform if "texCoord" in transform else info
        return self.document.integer(owner, "texCoord", 0)

    def _wrap(self, sampler: dict[str, Any]) -> str:
        codes = [sampler.get(key, _REPEAT) for key in ("wrapS", "wrapT")]
        for code in codes:
            if code not in _WRAPS:
                self.document.fail(f"the wrap mode {code!r} is not known")
        if codes[0] != codes[1]:
            self.notes.append(
                f"a sampler wraps {_WRAPS[codes[0]]} along s and {_WRAPS[codes[1]]} along t; "
                "shown as the first in both directions"
            )
        return _WRAPS[codes[0]]

    def _transform(self, info: dict[str, Any]) -> dict[str, Any]:
        transform = self._extension(info, "KHR_texture_transform")
        if not transform:
            return {}
        scale = self.document.numbers(transform, "scale", 2)
        offset = self.document.numbers(transform, "offset", 2)
        scale = np.ones(2) if scale is None else scale
        offset = np.zeros(2) if offset is None else offset
        angle = transform.get("rotation", 0.0)
        if not isinstance(angle, int | float) or not math.isfinite(angle):
            self.document.fail("the rotation of a texture is not a number")
        # (u, v) -> (u, 1 - v) before and after: the turn keeps its sense as seen, and the
        # origin, now the lower left corner, is moved to where (0, 1) was.
        return {
            "scale": (float(scale[0]), float(scale[1])),
            "rotate": math.degrees(angle),
            "offset": (
                float(offset[0] + math.sin(angle) * scale[1]),
                float(1.0 - offset[1] - math.cos(angle) * scale[1]),
            ),
        }

    def _extension(self, owner: dict[str, Any], name: str) -> dict[str, Any]:
        return self.document.mapping(self.document.mapping(owner, "extensions"), name)

    def _image(self, texture: dict[str, Any], color: bool) -> Path | Image:
        index: Any = self._extension(texture, "EXT_texture_webp").get(
            "source", texture.get("source")
        )
        image = self.document.item("images", index)
        if (index, color) not in self._images:
            self._images[index, color] = self._opened(index, image, color)
        return self._images[index, color]

    def _opened(self, index: int, image: dict[str, Any], color: bool) -> Path | Image:
        """Path of an image that lies beside the file, or the pixels of one inside it."""
        uri = image.get("uri")
        where = f"{self.document.path}: images[{index}]"
        if isinstance(uri, str) and not uri.startswith("data:"):
            if "://" in uri:
                self.document.fail(f"images[{index}] is at {uri[:60]!r}; only local files are read")
            path = self.document.path.parent / unquote(uri)
            try:
                require_file(path)
            except FileError as error:
                raise FileError(f"{where}: {error}") from error
            return path
        if isinstance(uri, str):
            try:
                data = base64.b64decode(uri.partition(",")[2])
            except binascii.Error:
                self.document.fail(f"the data of images[{index}] is not base64")
        else:
            data = self.document.view_bytes(image.get("bufferView")).tobytes()
        return decode_image(data, where, color=color)


def _filter(sampler: dict[str, Any]) -> str:
    """Name of the filter; where magnified texels are to stay sharp, they do at any size."""
    if sampler.get("magFilter") == _NEAREST:
        return "nearest"
    return "bilinear" if sampler.get("minFilter") in _FILTERS_WITHOUT_MIPS else "trilinear"
