"""Every option of `unwrap`, with its default."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Annotated

from texbake.errors import OptionError, quoted
from texbake.mapping.options.atlas import AtlasOptions
from texbake.mapping.options.projection import ProjectionOptions
from texbake.mapping.options.transform import TransformOptions
from texbake.mesh.options import ANGLE_OPTION, DEFAULT_ANGLE, NORMALS_OPTION, check_angle
from texbake.schema import Option

# The methods, and which options each of them reads beside those that all share.
METHOD_OPTIONS: dict[str, tuple[str, ...]] = {
    "atlas": (
        "padding",
        "quality",
        "max_stretch",
        "seams_at_hard_edges",
        "seam_angle",
        "charts",
        "timeout",
        "tiles",
        "by_group",
        "keep",
    ),
    "planar": ("axis", "normal", "fit", "sides"),
    "cylindrical": ("axis", "center", "theta", "height", "caps"),
    "spherical": ("axis", "center", "theta"),
    "box": ("center", "overlap", "padding"),
    "two-part": ("axis", "center", "theta", "height", "surface", "via", "eye", "padding"),
    "parametric": ("linear",),
    "projector": ("camera", "fov", "matrix", "unseen"),
}
METHODS = tuple(METHOD_OPTIONS)
# Of those, the ones that only some surfaces of a two-part mapping read.
_SURFACE_OPTIONS = {
    "plane": frozenset[str](),
    "cylinder": frozenset({"theta", "height"}),
    "sphere": frozenset({"theta"}),
    "box": frozenset({"padding"}),
}
_OF_SOME_SURFACES = frozenset[str]().union(*_SURFACE_OPTIONS.values())
_OF_SOME_METHODS = {name for names in METHOD_OPTIONS.values() for name in names}


@dataclass(frozen=True, kw_only=True)
class UnwrapOptions(ProjectionOptions, TransformOptions, AtlasOptions):
    """How `unwrap` gives a mesh texture coordinates.

    An option that the method does not read must keep its default.
    """

    method: Annotated[
        str,
        Option(
            "How the coordinates are made: an atlas of charts with little stretch, or a "
            "classical mapping.",
            choices=METHODS,
        ),
    ] = "atlas"
    keep: Annotated[
        bool,
        Option("Keep the coordinates that the mesh has as charts, and only pack them."),
    ] = False
    only: Annotated[
        str | None,
        Option(
            "Map the faces of this group and leave all others as they are.",
            metavar="GROUP",
            default="all faces",
        ),
    ] = None
    normals: Annotated[
        str,
        replace(
            NORMALS_OPTION,
            help=f"{NORMALS_OPTION.help} Edges that are hard by the angle also cut charts.",
        ),
    ] = "keep"
    angle: Annotated[float, ANGLE_OPTION] = DEFAULT_ANGLE
    uv_set: Annotated[
        str | None,
        Option(
            "Write the coordinates as a further set of this name, such as lightmap, and leave the "
            "first as it is.",
            metavar="NAME",
            flag="--set",
            default="the first set",
        ),
    ] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        check_angle(self.normals, self.angle)
        if self.uv_set == "TEXCOORD_0":  # the first
            object.__setattr__(self, "uv_set", None)
        if self.uv_set is not None and (not self.uv_set.strip() or not self.uv_set.isprintable()):
            raise OptionError(f"uv_set: {quoted(self.uv_set)} is not a name")
        read = METHOD_OPTIONS[self.method]
        for field in fields(self):
            unread = field.name in _OF_SOME_METHODS and field.name not in read
            if unread and getattr(self, field.name) != field.default:
                raise OptionError(f"{field.name}: the method {self.method} does not use it")
        if self.via == "reflection" and self.eye is None:
            raise OptionError("eye: a reflection needs it; give the point that it is seen from")
        if self.eye is not None and self.via != "reflection":
            raise OptionError(f"eye: via {self.via} does not use it")
        if self.method == "two-part":
            for name in sorted(_OF_SOME_SURFACES - _SURFACE_OPTIONS[self.surface]):
                if getattr(self, name) != getattr(UnwrapOptions, name):
                    raise OptionError(f"{name}: the surface {self.surface} does not use it")
        if (
            self.method == "atlas"
            and self.texel_density is not None
            and (self.warp is not None or self.scales != (1.0, 1.0))
        ):
            raise OptionError(
                "texel_density: an atlas is packed at this density; a warp or scale would change it"
            )
        for name in "max_stretch", "seams_at_hard_edges", "seam_angle", "charts", "timeout":
            if self.keep and getattr(self, name) != getattr(UnwrapOptions, name):
                raise OptionError(
                    f"{name}: charts that are kept are not cut; leave it out, or `keep`"
                )
