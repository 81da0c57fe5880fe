"""Every option of `unwrap`, with its default."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

from texbake.errors import OptionError, quoted
from texbake.mapping.options.atlas import AtlasOptions
from texbake.mapping.options.projection import ProjectionOptions, TransformOptions
from texbake.mesh.options import ANGLE_OPTION, DEFAULT_ANGLE, NORMALS_OPTION, check_angle
from texbake.schema import option


@dataclass(frozen=True)
class Method:
    """A way to make texture coordinates."""

    options: tuple[str, ...]  # those that it reads beside the ones that all methods share
    function: str = ""  # a classical mapping: its module in `texbake.mapping.classical`, its name


METHODS = {
    "atlas": Method((
        "padding", "quality", "max_stretch", "seams_at_hard_edges", "seam_angle", "charts",
        "timeout", "tiles", "by_group", "keep",
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
    keep: bool = option(
        False, "Keep the coordinates that the mesh has as charts, and only pack them."
    )
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
        flag="--set",
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
        for name in "max_stretch", "seams_at_hard_edges", "seam_angle", "charts", "timeout":
            if self.keep:
                why = "charts that are kept are not cut; leave it out, or `keep`"
                self._require_default(name, why)

    def _require_default(self, name: str, why: str) -> None:
        if getattr(self, name) != getattr(UnwrapOptions, name):
            raise OptionError(f"{name}: {why}")
