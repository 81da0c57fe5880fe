"""Every option of `unwrap`, with its default."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated

from texbake.errors import OptionError, quoted
from texbake.mapping.options.projection import ProjectionOptions, TransformOptions
from texbake.mapping.options.shared import TextureOptions
from texbake.mesh.options import ANGLE_OPTION, DEFAULT_ANGLE, NORMALS_OPTION, check_angle
from texbake.records import dataclass
from texbake.schema import option

QUALITIES = ("fast", "good", "best")
SYMMETRIES = ("auto", "off", "overlap")
CHART_CUTTERS = ("texbake", "xatlas")
MAX_TILES = 100  # UDIM 1001 to 1100


DEFAULT_PADDING = 4
# The padding that survives three mip levels, and its greatest share of the side of a chart.
MOST_PADDING, _SHARE = 8, 1 / 16
PADDING_DEFAULT = f"{MOST_PADDING}, or less if there are many charts"


def fitting_padding(size: tuple[int, int], n_charts: int) -> int:
    """Return the padding that takes at most a sixteenth of the side of an average chart, 1 to 8.

    >>> fitting_padding((1024, 1024), 40), fitting_padding((1024, 1024), 863)
    (8, 2)
    """
    side = math.sqrt(size[0] * size[1] / max(n_charts, 1))
    return max(1, min(MOST_PADDING, int(_SHARE * side)))


@dataclass(frozen=True, kw_only=True)
class AtlasOptions(TextureOptions):
    """How charts are made and packed.

    `fast` divides the mesh into parts that are flattened and packed as they are. `good` splits
    parts until they have little stretch, and joins them again where that costs none. `best` allows
    charts more stretch, so that there are fewer, and tries more packings.

    With `padding`, no texel lies within that distance of two charts, and none that a chart touches
    lies within it of the border: a bake may pad each chart by as much. None uses
    `fitting_padding`. With several `tiles`, tile 1001 is the unit square, 1002 the one to its
    right, 1011 the one above.
    """

    padding: int | None = option(
        DEFAULT_PADDING,
        "Room left around each chart for the padding of a bake.",
        metavar="PX",
        low=0,
        unit="texels",
    )
    quality: str = option(
        "good",
        "Trade time for quality: fast for large scans, good for charts with little stretch, "
        "best for fewer charts and tighter packing.",
        choices=QUALITIES,
    )
    max_stretch: float | None = option(
        None,
        "Cut charts until none has more L2 stretch than this, such as 1.1.",
        metavar="L2",
        above=1,
        default="no limit",
    )
    keep_seams: bool = option(
        False,
        "Cut charts along the existing seams of the texture coordinates and nowhere else, then "
        "flatten and pack them again.",
    )
    seams_at_hard_edges: bool = option(
        False, "Cut charts at hard edges, where the normals of the mesh jump."
    )
    seam_angle: float | None = option(
        None,
        "Cut charts at edges where faces meet at more than this angle.",
        metavar="DEG",
        above=0,
        below=180,
        unit="degrees",
        default="where charts would stretch too much",
    )
    symmetry: str = option(
        "auto",
        "For a mesh with a mirror plane: auto makes cuts and charts mirror each other (with fast, "
        "except on mechanical parts), overlap lays one half on the other, so that both share their "
        "texels, and off ignores the plane.",
        choices=SYMMETRIES,
    )
    hide_seams: float | None = option(
        None,
        "How much hidden seams count: from 0 for the shortest seams to 1 for seams that go a long "
        "way to avoid the front and details, and to run where little light comes, such as creases.",
        low=0,
        high=1,
        default="0.5; with good, 0 where little can be hidden and seams would be over 5 % longer",
    )
    straighten: bool = option(
        False, "Lay strips and tubes out as rectangles where their L2 stretch stays below 1.1."
    )
    charts: str = option(
        "texbake",
        "What cuts charts: texbake, or the library xatlas in separate processes.",
        choices=CHART_CUTTERS,
    )
    timeout: float | None = option(
        None,
        "Seconds after which xatlas is stopped on a part, which is then cut by its normals.",
        metavar="SECONDS",
        above=0,
        unit="seconds",
        default="60 s and 10 ms per face",
    )
    tiles: int = option(
        1,
        "Number of UDIM tiles that the charts are spread over.",
        metavar="N",
        low=1,
        high=MAX_TILES,
    )
    by_group: bool = option(
        False, "Give each group of faces its own tiles, all with the same texel density."
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if 2 * (self.padding or 0) >= min(self.width_px, self.height_px):
            raise OptionError(
                f"padding: {self.padding} texels at both borders leave no room in "
                f"{self.width_px} x {self.height_px}; use less padding or a larger size"
            )
        if self.timeout is not None and self.charts != "xatlas":
            raise OptionError("timeout: it is for xatlas; leave it out, or use charts xatlas")


@dataclass(frozen=True)
class Method:
    """A way to make texture coordinates."""

    options: tuple[str, ...]  # those that it reads beside the ones that all methods share
    function: str = ""  # a classical mapping: its module in `texbake.mapping.classical`, its name


METHODS = {
    "atlas": Method((
        "padding", "quality", "max_stretch", "keep_seams", "seams_at_hard_edges", "seam_angle",
        "hide_seams", "symmetry", "straighten", "charts", "timeout", "tiles", "by_group", "keep",
    )),
    "planar": Method(("axis", "normal", "fit", "sides"), "planar.planar"),
    "cylindrical": Method(("axis", "center", "theta", "height", "caps"), "cylindrical.cylindrical"),
    "spherical": Method(("axis", "center", "theta"), "cylindrical.spherical"),
    "box": Method(("center", "overlap", "padding"), "box.box"),
    "two-part": Method(
        ("axis", "center", "theta", "height", "surface", "via", "eye", "padding"),
        "two_part.two_part",
    ),
    "parametric": Method(("linear",), "planar.parametric"),
    "projector": Method(("camera", "fov", "matrix", "unseen"), "projector.projector"),
}  # fmt: skip
# Options of a two-part mapping, and the surfaces that read them.
_OF_SURFACES = {"theta": ("cylinder", "sphere"), "height": ("cylinder",), "padding": ("box",)}


@dataclass(frozen=True, kw_only=True)
class UnwrapOptions(ProjectionOptions, TransformOptions, AtlasOptions):
    """How `unwrap` gives a mesh texture coordinates.

    An option that the method does not read must keep its default.
    """

    method: str = option(
        "atlas",
        "How the coordinates are made: an atlas of charts with little stretch, or a "
        "classical mapping.",
        choices=tuple(METHODS),
    )
    keep: bool = option(False, "Keep the charts that the mesh has, and only pack them again.")
    only: str | None = option(
        None,
        "Map the faces of this group and leave all others as they are.",
        metavar="GROUP",
        default="all faces",
    )
    normals: Annotated[
        str,
        replace(
            NORMALS_OPTION,
            help=f"{NORMALS_OPTION.help} Edges that are hard by the angle also cut charts.",
        ),
    ] = "keep"
    angle: Annotated[float, ANGLE_OPTION] = DEFAULT_ANGLE
    uv_set: str | None = option(
        None,
        "Write the coordinates as a further set of this name, such as lightmap, and leave the "
        "first as it is.",
        metavar="NAME",
        default="the first set",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        check_angle(self.normals, self.angle)
        if self.uv_set == "TEXCOORD_0":  # the first
            object.__setattr__(self, "uv_set", None)
        if self.uv_set is not None and (not self.uv_set.strip() or not self.uv_set.isprintable()):
            raise OptionError(f"uv_set: {quoted(self.uv_set)} is not a name")
        of_methods = {name for method in METHODS.values() for name in method.options}
        for name in sorted(of_methods.difference(METHODS[self.method].options)):
            self._require_default(name, f"the method {self.method} does not use it")
        if self.via == "reflection" and self.eye is None:
            raise OptionError("eye: a reflection needs it; give the point that it is seen from")
        if self.eye is not None and self.via != "reflection":
            raise OptionError(f"eye: via {self.via} does not use it")
        if self.method == "two-part":
            for name, surfaces in _OF_SURFACES.items():
                if self.surface not in surfaces:
                    self._require_default(name, f"the surface {self.surface} does not use it")
        if (
            self.method == "atlas"
            and self.texel_density is not None
            and (self.warp is not None or self.scales != (1.0, 1.0))
        ):
            raise OptionError(
                "texel_density: an atlas is packed at this density; a warp or scale would change it"
            )
        cuts = "keep_seams", "seams_at_hard_edges", "seam_angle", "hide_seams", "symmetry"
        for name in ("max_stretch", *cuts, "straighten", "charts", "timeout") if self.keep else ():
            self._require_default(name, "charts that are kept are not cut; leave it out, or `keep`")
        if self.keep_seams and self.charts == "xatlas":
            raise OptionError("keep_seams: xatlas does not follow given seams; use charts texbake")
        if self.symmetry == "overlap" and (self.keep_seams or self.charts == "xatlas"):
            raise OptionError(
                "symmetry: overlap is for seams that texbake chooses; use auto or off"
            )

    def _require_default(self, name: str, why: str) -> None:
        if getattr(self, name) != getattr(UnwrapOptions, name):
            raise OptionError(f"{name}: {why}")
