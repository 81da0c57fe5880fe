"""How a cube map is laid out in files, and the options of converting one."""

from __future__ import annotations

from dataclasses import dataclass

from texbake.errors import OptionError

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
class CubeOptions:
    """Options of converting between a latitude-longitude image and a cube map.

    Attributes
    ----------
    layout : str, optional
        `latlong`, `cross` or `faces`, what to write. None: faces where the output is a folder; as
        one image a cross of a latlong, and a latlong of the rest.
    size : int, optional
        Texels along one side of a face, or rows of a latlong; None: as fine as the source.
    convention : str
        Of the faces that are read or written: `opengl`, as graphics APIs look them up and mirrored
        to an eye inside, or `inside`, as that eye sees them.
    color : bool
        Whether integer codes are sRGB colors, or data.
    format : str, optional
        Of six faces, such as `exr`; None: the source's, or png.
    """

    layout: str | None = None
    size: int | None = None
    convention: str = "opengl"
    color: bool = True
    format: str | None = None

    def __post_init__(self) -> None:
        for name, value, known in (
            ("layout", self.layout, (None, *LAYOUTS)),
            ("convention", self.convention, CONVENTIONS),
            ("format", self.format, (None, *FACE_FORMATS)),
        ):
            if value not in known:
                words = ", ".join(filter(None, known))
                raise OptionError(f"{name}: {value!r} is not known; it is one of {words}")
        if self.size is not None and self.size < 1:
            raise OptionError(f"size: {self.size} is too small; it must be at least 1")
