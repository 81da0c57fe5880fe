"""Every option of mip levels, packed textures, cube maps, heights and normals, with its default."""

from __future__ import annotations

from typing import Annotated

from texbake.mapping.options.shared import MAX_SIZE
from texbake.records import dataclass
from texbake.schema import CheckedOptions, Option, Size, option

MIP_KINDS = ("color", "data", "normal")
MIP_WRAPS = ("repeat", "mirror", "clamp")
MIP_FILTERS = ("box", "kaiser")
EDGES = ("clamp", "repeat")


@dataclass(frozen=True, kw_only=True)
class MipOptions(CheckedOptions):
    """How the mip levels of an image are made."""

    kind: str = option(
        "color",
        "Average sRGB colors in linear light (color), values as they are (data), or unit "
        "vectors (normal).",
        choices=MIP_KINDS,
    )
    wrap: str = option(
        "repeat", "Repeat, mirror or clamp the image beyond its borders.", choices=MIP_WRAPS
    )
    filter: str = option(
        "box",
        "Average the area of a texel (box), or keep distant detail sharper with a windowed "
        "sinc (kaiser).",
        choices=MIP_FILTERS,
    )


@dataclass(frozen=True, kw_only=True)
class PackOptions(CheckedOptions):
    """How `pack_textures` puts several images into one."""

    size: Size | None = option(
        None,
        "If the images do not fit, all are scaled down by one factor. Width and height of the "
        "packed image.",
        metavar="PX|WxH",
        low=1,
        high=MAX_SIZE,
        unit="texels",
        default="the least powers of two that hold all images at full size",
    )
    padding: int = option(
        4,
        "Width of the padding around each image.",
        metavar="PX",
        low=0,
        high=MAX_SIZE // 2 - 1,
        unit="texels",
    )
    edges: str = option(
        "clamp",
        "Fill the padding with the nearest texels (clamp), or with the opposite side of an "
        "image that tiles (repeat).",
        choices=EDGES,
    )

    @property
    def sides(self) -> tuple[int, int] | None:
        """Width and height, or None."""
        return (self.size, self.size) if isinstance(self.size, int) else self.size


# opengl: faces as OpenGL, Vulkan, Direct3D, KTX and glTF look them up, and so mirrored left to
# right to an eye inside. inside: as such an eye sees them, or a camera takes them.
CONVENTIONS = ("opengl", "inside")
# One latitude-longitude image; the six faces unfolded in an image of 4 x 3 faces; six files.
LAYOUTS = ("latlong", "cross", "faces")
FACE_FORMATS = ("exr", "hdr", "jpg", "png", "ppm", "tga", "tif")
# Of the six files, without suffix, and what else they may be called where they are read.
FACE_NAMES = (
    ("px", "posx"),
    ("nx", "negx"),
    ("py", "posy"),
    ("ny", "negy"),
    ("pz", "posz"),
    ("nz", "negz"),
)


@dataclass(frozen=True, kw_only=True)
class CubeOptions(CheckedOptions):
    """How a latitude-longitude image and a cube map are converted into one another."""

    layout: str | None = option(
        None,
        "Write a latitude-longitude image, a cross of six faces, or six files.",
        choices=LAYOUTS,
        default="faces into a folder; else a cross of a latlong, a latlong of faces",
    )
    size: int | None = option(
        None,
        "Width of a face, or height of a latitude-longitude image.",
        metavar="PX",
        low=1,
        unit="texels",
        default="as fine as the source",
    )
    convention: str = option(
        "opengl",
        "Faces as graphics APIs look them up, mirrored (opengl), or as the eye sees them from "
        "inside (inside).",
        choices=CONVENTIONS,
    )
    color: bool = option(
        True, "Treat integer values as sRGB colors, or as data.", flag="--color/--data"
    )
    format: str | None = option(
        None, "File format of the six faces.", choices=FACE_FORMATS, default="the source's, or png"
    )


DERIVATIVES = ("central", "sobel", "scharr")
INTEGRATIONS = ("frankot-chellappa", "poisson")
HEIGHT_WRAPS = ("repeat", "clamp")
NORMAL_CONVENTIONS = ("opengl", "directx")
DEFAULT_SCALE = 0.05  # of heights whose file has none, in widths of the image


_WIDTH = Option(
    "Width of the image in the unit of its heights; texels are square.", metavar="W", above=0
)
_WRAP = Option(
    "Treat the image as tiling (repeat), or as ending at its border.", choices=HEIGHT_WRAPS
)


@dataclass(frozen=True, kw_only=True)
class HeightToNormalOptions(CheckedOptions):
    """How `height_to_normal` measures the slopes of heights.

    With `wrap="clamp"` derivatives at the border are one-sided. Of the 3 x 3 differences, scharr's
    depend least on the direction of a slope.
    """

    scale: float | None = option(
        None,
        "Difference in height between values 0 and 1, in the unit of the width.",
        metavar="S",
        default=f"what the file says, else {DEFAULT_SCALE:g}",
    )
    width: Annotated[float, _WIDTH] = 1.0
    wrap: Annotated[str, _WRAP] = "repeat"
    derivative: str = option(
        "central",
        "Take differences of two texels (central), or average them over three rows against "
        "noise (sobel, scharr).",
        choices=DERIVATIVES,
    )


@dataclass(frozen=True, kw_only=True)
class NormalToHeightOptions(CheckedOptions):
    """How `normal_to_height` integrates slopes.

    `frankot-chellappa` is exact for smooth maps that tile, and `poisson` for surfaces of even
    curvature. Slopes that are left over reveal a wrong convention.
    """

    method: str = option(
        "poisson",
        "Fit the steps from texel to texel (poisson), or a sum of waves that tile "
        "(frankot-chellappa).",
        choices=INTEGRATIONS,
    )
    wrap: Annotated[str, _WRAP] = "repeat"
    width: Annotated[float, _WIDTH] = 1.0
    convention: str | None = option(
        None,
        "Green channel of the normal map: +Y up (opengl) or +Y down (directx).",
        choices=NORMAL_CONVENTIONS,
        default="what the file says, else opengl",
    )
