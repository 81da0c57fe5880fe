"""How a cube map is laid out in files, and the options of converting one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from texbake.schema import CheckedOptions, Option

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

    layout: Annotated[
        str | None,
        Option(
            "Write a latitude-longitude image, a cross of six faces, or six files.",
            choices=LAYOUTS,
            default="faces into a folder; else a cross of a latlong, a latlong of faces",
        ),
    ] = None
    size: Annotated[
        int | None,
        Option(
            "Width of a face, or height of a latitude-longitude image.",
            metavar="PX",
            low=1,
            unit="texels",
            default="as fine as the source",
        ),
    ] = None
    convention: Annotated[
        str,
        Option(
            "Faces as graphics APIs look them up, mirrored (opengl), or as the eye sees them from "
            "inside (inside).",
            choices=CONVENTIONS,
        ),
    ] = "opengl"
    color: Annotated[
        bool,
        Option("Treat integer values as sRGB colors, or as data.", flag="--color/--data"),
    ] = True
    format: Annotated[
        str | None,
        Option(
            "File format of the six faces.", choices=FACE_FORMATS, default="the source's, or png"
        ),
    ] = None
