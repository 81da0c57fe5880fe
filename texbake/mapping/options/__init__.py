"""Every choice of an unwrap, with its default, written once for the API and the command line."""

from __future__ import annotations

from dataclasses import dataclass, fields

from texbake.errors import OptionError
from texbake.mapping.options.atlas import AtlasOptions
from texbake.mapping.options.checks import check_choice
from texbake.mapping.options.projection import ProjectionOptions
from texbake.mapping.options.transform import TransformOptions

# The methods, and which options each of them reads beside those that all share.
METHOD_OPTIONS: dict[str, tuple[str, ...]] = {
    "atlas": ("padding", "quality", "max_stretch", "timeout", "tiles", "by_group", "keep"),
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
    """What `unwrap` does where the caller does not say otherwise.

    Further attributes are those of `ProjectionOptions`, `TransformOptions` and `AtlasOptions`. One
    that the method does not read must keep its default.

    Attributes
    ----------
    method : str
        `atlas` for charts of little stretch, or a classical mapping.
    keep : bool
        Atlas: leave the mesh's own coordinates as charts and only pack them.
    only : str, optional
        Name of the one group of faces to map; the others keep what they have.
    """

    method: str = "atlas"
    keep: bool = False
    only: str | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        check_choice("method", self.method, METHODS)
        read = METHOD_OPTIONS[self.method]
        for field in fields(self):
            unread = field.name in _OF_SOME_METHODS and field.name not in read
            if unread and getattr(self, field.name) != field.default:
                raise OptionError(f"{field.name}: the method {self.method} does not use it")
        if self.via == "reflection" and self.eye is None:
            raise OptionError("eye: a reflection needs it; give the point that looks, X,Y,Z")
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
                "texel_density: an atlas is packed at it, and a warp or scale would change it again"
            )
        for name in "max_stretch", "timeout":
            if self.keep and getattr(self, name) is not None:
                raise OptionError(f"{name}: charts that are kept are not cut; give one of them")
