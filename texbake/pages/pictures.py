"""Pictures and maps as data URIs in a page, with the coding of the maps' colors."""

from __future__ import annotations

import base64
import io
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.baking.result import BakedMap
from texbake.errors import require_library
from texbake.files import PathLike, scratch_folder
from texbake.mesh.mesh import BoolArray, Float32Array
from texbake.metadata import CONVENTION, DISPLACEMENT_MID, DISPLACEMENT_SCALE, SPACE, Value
from texbake.records import dataclass
from texbake.texture.encoding import quantize_srgb, quantize_unsigned
from texbake.texture.image import Image, read_image

# Limit on the bytes of all maps of a page, before base64 makes them a third larger.
MOST_BYTES = 7_500_000
_SMALLEST = 256  # texels along a side; smaller maps are not scaled down


def picture_codes(picture: Float32Array) -> npt.NDArray[np.uint8]:
    """Return the sRGB codes (H, W, 3) uint8 of a linear picture, without alpha."""
    return np.asarray(quantize_srgb(picture[..., :3], 8), np.uint8)


def png_of(picture: Float32Array) -> bytes:
    """Return a linear picture as the bytes of a PNG file."""
    return png_of_codes(picture_codes(picture), optimize=True)


def png_of_codes(codes: npt.NDArray[np.uint8], *, optimize: bool = False) -> bytes:
    """Return (H, W) or (H, W, C) codes as the bytes of a PNG file; `optimize` takes longer."""
    Image = require_library("PIL.Image", "pictures of pages")

    file = io.BytesIO()
    Image.fromarray(codes).save(file, "PNG", optimize=optimize)
    return file.getvalue()


def data_uri(content: bytes, kind: str = "image/png") -> str:
    """Return a data URI with the content of a file."""
    return f"data:{kind};base64,{base64.b64encode(content).decode('ascii')}"


@dataclass(frozen=True, kw_only=True, eq=False)
class MapPicture:
    """A map on a page."""

    name: str
    uri: str  # the picture, as a data URI
    # width, height: size of the picture in texels
    width: int
    height: int
    # full_width, full_height: size of the map in texels
    full_width: int
    full_height: int
    coding: str  # `MapKind.coding` of the map; "" if unknown
    # Metadata of the 8-bit picture: space, convention, mid level and scale
    metadata: Mapping[str, Value]
    note: str = ""  # A sentence below the picture

    def settings(self) -> dict[str, Any]:
        """Return the settings for the scripts of the page."""
        return {
            "name": self.name,
            "width": self.full_width,
            "height": self.full_height,
            "coding": self.coding,
            "space": str(self.metadata.get(SPACE, "tangent")),
            "green": -1 if self.metadata.get(CONVENTION) == "directx" else 1,
            "mid": self.metadata.get(DISPLACEMENT_MID, 0.0),
            "scale": self.metadata.get(DISPLACEMENT_SCALE, 0.0),
        }


def baked_pictures(
    maps: Mapping[str, BakedMap], notes: Mapping[str, str] | None = None
) -> list[MapPicture]:
    """Return pictures of all maps of a bake, halved until they fit a page."""
    notes, room, pictures = notes or {}, MOST_BYTES // max(len(maps), 1), []
    with scratch_folder() as folder:
        for name, baked in maps.items():
            path = folder / f"{name}.png"
            written = baked.write(path, bits=8)
            pictures.append(
                _picture(
                    name,
                    path.read_bytes(),
                    room,
                    baked.kind.coding,
                    written.metadata,
                    notes.get(name, ""),
                )
            )
    return pictures


def file_pictures(files: Mapping[str, PathLike], *, codings: Mapping[str, str]) -> list[MapPicture]:
    """Return pictures of map files; the values of float files are scaled to [0, 1]."""
    room = MOST_BYTES // max(len(files), 1)
    pictures = []
    for name, path in files.items():
        image = read_image(path, color=False)
        codes, metadata = _codes(image, codings.get(name, ""))
        pictures.append(
            _picture(name, png_of_codes(codes), room, codings.get(name, ""), metadata, "")
        )
    return pictures


def miss_picture(missed: BoolArray) -> str:
    """Return a data URI of a picture that is red where rays missed and transparent elsewhere."""
    PilImage = require_library("PIL.Image", "pictures of pages")

    picture = PilImage.fromarray(missed.astype(np.uint8))
    picture.putpalette([0, 0, 0, 255, 30, 60])
    file = io.BytesIO()
    picture.save(file, "PNG", optimize=True, transparency=0)
    return data_uri(file.getvalue())


def _codes(image: Image, coding: str) -> tuple[npt.NDArray[np.uint8], dict[str, Value]]:
    """Return 8-bit codes of an image, and its metadata adapted to these codes."""
    pixels, metadata = image.pixels, dict(image.metadata)
    if pixels.ndim == 3 and pixels.shape[2] == 1:
        pixels = pixels[..., 0]
    if pixels.ndim == 3:
        pixels = pixels[..., : 3 if pixels.shape[2] >= 3 else 1]
    if image.is_float and coding not in ("normal", "color"):
        finite = pixels[np.isfinite(pixels)]
        low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 0.0)
        side = (high - low) or 1.0
        scale = float(metadata.get(DISPLACEMENT_SCALE, 1.0))
        mid = float(metadata.get(DISPLACEMENT_MID, 0.0))
        # h = low + code * side, and d = (h - mid) * scale
        metadata |= {DISPLACEMENT_MID: (mid - low) / side, DISPLACEMENT_SCALE: side * scale}
        pixels = np.nan_to_num((pixels - low) / side)
    return np.asarray(quantize_unsigned(np.clip(pixels, 0.0, 1.0), 8), np.uint8), metadata


def _picture(
    name: str, png: bytes, room: int, coding: str, metadata: Mapping[str, Value], note: str
) -> MapPicture:
    PilImage = require_library("PIL.Image", "pictures of pages")

    with PilImage.open(io.BytesIO(png)) as picture:
        full_width, full_height = picture.size
        width, height = picture.size
        while len(png) > room and min(width, height) >= 2 * _SMALLEST:
            # Identifiers must not be averaged.
            picture = picture.resize(
                (width // 2, height // 2),
                PilImage.Resampling.NEAREST if coding == "id" else PilImage.Resampling.BOX,
            )
            width, height = picture.size
            png = png_of_codes(np.asarray(picture))
    return MapPicture(
        name=name,
        uri=data_uri(png),
        width=width,
        height=height,
        full_width=full_width,
        full_height=full_height,
        coding=coding,
        metadata=metadata,
        note=note,
    )
