"""Materials: a shading model and the slots it reads.

Every slot holds a constant, an image or a procedure (`texbake.rendering.scene.textures`). Nothing
is computed for a slot that is None.

Based on: Segal, Korobkin, van Widenfelt, Foran, Haeberli, "Fast shadows and lighting effects using
texture mapping", SIGGRAPH 1992, for projectors.
"""

from __future__ import annotations

import math
from typing import Annotated

from texbake.errors import OptionError
from texbake.records import dataclass
from texbake.rendering.scene.projected import ProjectedTexture
from texbake.rendering.scene.textures import (
    ImageTexture,
    ProcedureTexture,
    Rgb,
    Slot,
    Texture,
    check_finite,
)
from texbake.schema import Option, check_fields, option

SHADINGS = ("unlit", "lambert", "blinn-phong", "metallic-roughness")
SHADING_RATES = ("pixel", "vertex")
EMBOSS_FORMS = ("emboss", "emboss-normalized")
BUMP_FORMS = ("blinn", "exact", *EMBOSS_FORMS)
DIFFERENCES = ("central", "forward", "backward")
LIGHT_SPACES = ("world", "object")
NORMAL_SPACES = ("tangent", "object", "world")
CONVENTIONS = ("opengl", "directx")
DISPLACEMENT_SPACES = ("tangent", "object")
ALPHA_MODES = ("opaque", "mask", "blend")
ENVIRONMENTS = ("scene", "rendered")
MAX_ENVIRONMENT_SIZE = 4096


_CONSTANT_SLOTS = ("base_color", "specular", "exponent", "gloss", "roughness", "metalness",
                   "emission", "occlusion", "opacity", "light_map")  # fmt: skip


def check_constant(name: str, slot: Slot | None) -> None:
    """Raise `OptionError` if a slot holds a number that is not finite."""
    if slot is not None and not isinstance(slot, ImageTexture | ProcedureTexture):
        check_finite(name, slot)


@dataclass(frozen=True, kw_only=True, eq=False)
class NormalMap:
    """Normals in place of those of the mesh.

    Where `space` and `convention` are None, the file's metadata sets them, or else they are
    tangent space, +Y up. `strength` scales x and y of tangent-space normals, as glTF does;
    a strength of 0 disables the map in any space, and its file is not read.
    """

    texture: Annotated[ImageTexture, Option("Image of normals.")]
    space: str | None = option(
        None,
        "Space of the normals; without it what the file says, else tangent.",
        choices=NORMAL_SPACES,
    )
    convention: str | None = option(
        None,
        "+Y up (opengl) or down (directx); without it what the file says, else opengl.",
        choices=CONVENTIONS,
    )
    strength: float = option(
        1.0, "Factor of x and y of tangent-space normals; 0 disables the map in any space."
    )

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True, kw_only=True, eq=False)
class BumpMap:
    """A height d over the surface that only tilts its normal.

    `form` is `blinn` (first order: N + d_u (N x P_v) ... normalized), `exact` (with the terms
    d N_u and d N_v of the displaced surface), `emboss` (d a step away from the light minus d a
    step toward it) or `emboss-normalized` (divided by the length of the bent normal). `height`
    is what value 1 stands for, in model units of the object.
    """

    texture: Annotated[Texture, Option("Image or procedure of heights.")]
    # Slopes beyond these are beyond float64.
    height: float = option(
        0.05, "Height of value 1 in units of the object.", low=-1e100, high=1e100
    )
    form: str = option(
        "exact",
        "Formula of the tilted normal: exact, blinn (first order), emboss, emboss-normalized.",
        choices=BUMP_FORMS,
    )
    light_space: str = option(
        "world",
        "Space in which embossing compares the light with the normal.",
        choices=LIGHT_SPACES,
    )
    difference: str = option(
        "central",
        "Finite difference that gives the slope, for exact, blinn and emboss-normalized.",
        choices=DIFFERENCES,
    )

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True, kw_only=True, eq=False)
class Displacement:
    """Heights that move the surface and with it the silhouette.

    The surface is cut into triangles whose edges are at most `edge_px` pixels long in the picture,
    or as fine as the map. A scalar d moves by (d - mid) height along the smooth normal; a `vector`
    map moves in tangent (or object) `space`, by the same rule for each component. Where `mid`,
    `height` or `space` is None it comes from the file's metadata, or else is 0, 1 and tangent.
    """

    texture: Annotated[Texture, Option("Image or procedure of heights or vectors.")]
    height: float | None = option(
        None, "Height of a change of value by 1; without it what the file says, else 1."
    )
    mid: float | None = option(
        None, "Value that does not move the surface; without it what the file says, else 0."
    )
    vector: bool = option(False, "Whether the three channels are x, y and z of a vector.")
    space: str | None = option(
        None,
        "Space of vectors; without it what the file says, else tangent.",
        choices=DISPLACEMENT_SPACES,
    )
    edge_px: float | None = option(
        2.0, "Longest edge in pixels of the triangles that the surface is divided into.", above=0
    )

    def __post_init__(self) -> None:
        check_fields(self)
        if self.edge_px is None and not isinstance(self.texture, ImageTexture):
            raise OptionError("edge_px: a procedure has no texels to go by; give a length")
        if self.vector and not isinstance(self.texture, ImageTexture):
            raise OptionError("vector: a procedure has one height and no vector; give an image")


@dataclass(frozen=True, kw_only=True, eq=False)
class Parallax:
    """Parallax occlusion: the eye's ray is followed below the surface to where it meets heights.

    White is the surface itself, black lies `depth` below it, in units of texture coordinates.
    `layers` is the most steps of the search.
    """

    texture: Annotated[
        ImageTexture, Option("Image of heights: white is the surface, black the deepest.")
    ]
    depth: float = option(0.05, "Depth of black in units of texture coordinates.", low=0)
    layers: int = option(32, "Most steps of the search along the line of sight.", low=1)

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True, kw_only=True, eq=False)
class Reflection:
    """A mirror's share of light: `strength` times what is seen in the reflected direction.

    `environment` is the `scene`'s, or `rendered`: six pictures of the other objects, taken from the
    middle of this one.
    """

    strength: Slot = option(
        1.0, "Share of light that is mirrored: a number, color, image or procedure."
    )
    environment: str = option(
        "scene",
        "What is mirrored: the scene's environment, or its objects (rendered).",
        choices=ENVIRONMENTS,
    )
    size: int = option(
        256,
        "Width in texels of each face of a rendered environment.",
        low=1,
        high=MAX_ENVIRONMENT_SIZE,
    )
    fresnel: bool = option(False, "Whether the reflection grows toward grazing angles.")

    def __post_init__(self) -> None:
        check_fields(self)
        check_constant("strength", self.strength)


@dataclass(frozen=True, kw_only=True, eq=False)
class Refraction:
    """Light seen through the surface, bent once by Snell's law; total reflection mirrors it."""

    strength: Slot = option(
        1.0, "Share of light that comes through: a number, color, image or procedure."
    )
    ior: float = option(1.5, "Index of refraction.", above=0)
    environment: str = option(
        "scene",
        "What is seen: the scene's environment, or its objects (rendered).",
        choices=ENVIRONMENTS,
    )
    size: int = option(
        256,
        "Width in texels of each face of a rendered environment.",
        low=1,
        high=MAX_ENVIRONMENT_SIZE,
    )

    def __post_init__(self) -> None:
        check_fields(self)
        check_constant("strength", self.strength)


@dataclass(frozen=True, kw_only=True, eq=False)
class Transmission:
    """Light seen through the surface as through glass: tinted, bent by `ior` and blurred.

    It takes the place of the light that metallic-roughness scatters. A surface without `thickness`
    is a thin sheet, which does not bend light.
    """

    strength: Slot = option(1.0, "Share of light that comes through instead of being scattered.")
    thickness: Slot = option(
        0.0, "Thickness of the volume behind the surface, in units of the object."
    )
    attenuation_color: Rgb = option(
        (1.0, 1.0, 1.0), "Color that white light has after the attenuation distance.", low=0, high=1
    )
    attenuation_distance: float | None = option(
        None, "Distance in the volume after which light has the attenuation color.", above=0
    )

    def __post_init__(self) -> None:
        check_fields(self)
        check_constant("strength", self.strength)
        check_constant("thickness", self.thickness)


@dataclass(frozen=True, kw_only=True, eq=False)
class Material:
    """Slots of a surface."""

    name: str = option("material", "Name of the material.")
    shading: str = option(
        "metallic-roughness",
        "Model of shading: metallic-roughness as in glTF 2.0, unlit, lambert or blinn-phong.",
        choices=SHADINGS,
    )
    shading_rate: str = option(
        "pixel",
        "Where light is computed: at pixels, or at vertices and interpolated between them.",
        choices=SHADING_RATES,
    )
    base_color: Slot = option(
        (0.8, 0.8, 0.8), "Base color; the fourth channel of an image is its opacity."
    )
    vertex_colors: bool = option(False, "Whether the mesh's vertex colors multiply the base color.")
    specular: Slot = option((0.2, 0.2, 0.2), "Color of the highlight of blinn-phong.")
    exponent: Slot = option(32.0, "Exponent of the highlight of blinn-phong.")
    gloss: Slot | None = option(None, "Factor of the specular color.")
    roughness: Slot = option(0.5, "Roughness of metallic-roughness, from 0 to 1.")
    metalness: Slot = option(0.0, "Metalness of metallic-roughness, from 0 to 1.")
    ior: float = option(1.5, "Index of refraction of what is not metal, for metallic-roughness.")
    emission: Slot | None = option(None, "Color of light that the surface emits.")
    occlusion: Slot | None = option(None, "Factor of ambient and environment light, from 0 to 1.")
    occlusion_strength: float = option(
        1.0, "Share of the occlusion that is applied, from 0 to 1.", low=0, high=1
    )
    opacity: Slot | None = option(
        None, "Opacity from 0 to 1, which multiplies that of the base color."
    )
    alpha_mode: str = option(
        "blend",
        "What opacity does: blend, mask (leave out what is below the cutoff) or opaque.",
        choices=ALPHA_MODES,
    )
    alpha_cutoff: float = option(
        0.5, "Opacity below which a masked surface is left out.", low=0, high=1
    )
    light_map: Slot | None = option(None, "Baked light on the surface, as bake-lightmap makes it.")
    normal_map: NormalMap | None = option(None, "Normal map.")
    bump_map: BumpMap | None = option(None, "Heights that only tilt the normals.")
    displacement: Displacement | None = option(None, "Heights that move the surface.")
    parallax: Parallax | None = option(
        None, "Heights below the surface, into which the line of sight is followed."
    )
    reflection: Reflection | None = option(
        None, "How much of its surroundings the surface mirrors."
    )
    refraction: Refraction | None = option(None, "How much is seen through the surface, bent.")
    transmission: Transmission | None = option(
        None, "How much of what lies behind is seen through the surface, for metallic-roughness."
    )
    projected: tuple[ProjectedTexture, ...] = option(
        (), "Images that are projected onto the surface."
    )
    double_sided: bool | None = option(
        None, "Whether back faces are drawn; without it, as the options of the picture say."
    )

    def __post_init__(self) -> None:
        check_fields(self, prefix=f"{self.name}.")
        for name in _CONSTANT_SLOTS:
            check_constant(f"{self.name}.{name}", getattr(self, name))
        if isinstance(self.exponent, float | int) and self.exponent < 0.0:
            raise OptionError(f"{self.name}.exponent: {self.exponent} is below 0")
        if self.ior != 0.0 and not 1.0 <= self.ior < math.inf:
            raise OptionError(f"{self.name}.ior: {self.ior} is not 1 or more")


DEFAULT_MATERIAL = Material()
