"""A material: slots, and how what is in them becomes light.

Every slot is a constant, an image or a procedure (`texbake.rendering.scene.textures`). A slot that
is None is not there, and nothing is computed for it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from texbake.errors import OptionError
from texbake.mesh.mesh import FloatArray
from texbake.rendering.scene.textures import (
    ImageTexture,
    ProcedureTexture,
    Slot,
    Texture,
)

SHADINGS = ("unlit", "lambert", "blinn-phong", "metallic-roughness")
BUMP_FORMS = ("blinn", "exact", "emboss")
NORMAL_SPACES = ("tangent", "object", "world")
CONVENTIONS = ("opengl", "directx")
DISPLACEMENT_SPACES = ("tangent", "object")
ALPHA_MODES = ("opaque", "mask", "blend")
ENVIRONMENTS = ("scene", "rendered")
MAX_ENVIRONMENT_SIZE = 4096


_CONSTANT_SLOTS = ("base_color", "specular", "exponent", "gloss", "roughness", "metalness",
                   "emission", "occlusion", "opacity", "light_map")  # fmt: skip


def check_constant(name: str, slot: Slot | None) -> None:
    """Raise `OptionError` where a slot holds a number that is not finite."""
    if slot is None or isinstance(slot, ImageTexture | ProcedureTexture):
        return
    numbers = slot if isinstance(slot, Iterable) else (slot,)
    if not all(map(math.isfinite, numbers)):
        raise OptionError(f"{name}: {slot} is not finite")


@dataclass(frozen=True, kw_only=True, eq=False)
class NormalMap:
    """Normals instead of the mesh's own.

    `space` and `convention` are those that the file's metadata names where they are None, else
    tangent space, +Y up. `strength` scales x and y of tangent-space normals, as glTF does.
    """

    texture: ImageTexture
    space: str | None = None
    convention: str | None = None
    strength: float = 1.0

    def __post_init__(self) -> None:
        for name, choices in ("space", NORMAL_SPACES), ("convention", CONVENTIONS):
            value = getattr(self, name)
            if value not in (None, *choices):
                raise OptionError(f"{name}: {value!r} is not one of {', '.join(choices)}")
        if not math.isfinite(self.strength):
            raise OptionError(f"strength: {self.strength} is not a finite number")


@dataclass(frozen=True, kw_only=True, eq=False)
class BumpMap:
    """A height d over the surface that only tilts its normal.

    `form` is `blinn` (first order: N + d_u (N x P_v) ... normalized), `exact` (with the terms
    d N_u and d N_v of the displaced surface) or `emboss` (d at the point and a step toward the
    light, subtracted). `height` is what value 1 stands for, in model units of the object.
    """

    texture: Texture
    height: float = 0.05
    form: str = "exact"

    def __post_init__(self) -> None:
        if self.form not in BUMP_FORMS:
            raise OptionError(f"form: {self.form!r} is not one of {', '.join(BUMP_FORMS)}")
        if not math.isfinite(self.height):
            raise OptionError(f"height: {self.height} is not a finite number")


@dataclass(frozen=True, kw_only=True, eq=False)
class Displacement:
    """Heights that move the surface and with it the silhouette.

    The surface is cut into triangles whose edges are at most `edge_px` pixels long in the picture,
    or as fine as the map. A scalar d moves by (d - mid) height along the smooth normal; a `vector`
    map moves in tangent (or object) `space`, by the same rule for each component. Where `mid`,
    `height` or `space` is None it is as the file's metadata tells, else 0, 1 and tangent.
    """

    texture: Texture
    height: float | None = None
    mid: float | None = None
    vector: bool = False
    space: str | None = None
    edge_px: float | None = 2.0

    def __post_init__(self) -> None:
        if self.edge_px is None:
            if not isinstance(self.texture, ImageTexture):
                raise OptionError("edge_px: a procedure has no texels to go by; give a length")
        elif not 0.0 < self.edge_px < math.inf:
            raise OptionError(f"edge_px: {self.edge_px} is not above 0")
        for name in "height", "mid":
            value = getattr(self, name)
            if value is not None and not math.isfinite(value):
                raise OptionError(f"{name}: {value} is not a finite number")
        if self.space not in (None, *DISPLACEMENT_SPACES):
            raise OptionError(
                f"space: {self.space!r} is not one of {', '.join(DISPLACEMENT_SPACES)}"
            )
        if self.vector and not isinstance(self.texture, ImageTexture):
            raise OptionError("vector: a procedure has one height and no vector; give an image")


@dataclass(frozen=True, kw_only=True, eq=False)
class Parallax:
    """Parallax occlusion: the eye's ray is followed below the surface to where it meets heights.

    White is the surface itself, black lies `depth` below it, in units of texture coordinates.
    `layers` is the most steps of the search.
    """

    texture: ImageTexture
    depth: float = 0.05
    layers: int = 32

    def __post_init__(self) -> None:
        if not 0.0 <= self.depth < math.inf:
            raise OptionError(f"depth: {self.depth} is not 0 or more")
        if self.layers < 1:
            raise OptionError(f"layers: {self.layers} is not 1 or more")


@dataclass(frozen=True, kw_only=True, eq=False)
class Reflection:
    """A mirror's share of light: `strength` times what is seen in the reflected direction.

    `environment` is the `scene`'s, or `rendered`: six pictures of the other objects, taken from the
    middle of this one.
    """

    strength: Slot = 1.0
    environment: str = "scene"
    size: int = 256
    fresnel: bool = False

    def __post_init__(self) -> None:
        check_constant("strength", self.strength)
        _check_environment(self.environment, self.size)


@dataclass(frozen=True, kw_only=True, eq=False)
class Refraction:
    """Light seen through the surface, bent once after Snell; total reflection mirrors it."""

    strength: Slot = 1.0
    index: float = 1.5
    environment: str = "scene"
    size: int = 256

    def __post_init__(self) -> None:
        check_constant("strength", self.strength)
        _check_environment(self.environment, self.size)
        if not 0.0 < self.index < math.inf:
            raise OptionError(f"index: {self.index} is not above 0; that of glass is 1.5")


def _check_environment(environment: str, size: int) -> None:
    if environment not in ENVIRONMENTS:
        raise OptionError(f"environment: {environment!r} is not one of {', '.join(ENVIRONMENTS)}")
    if not 1 <= size <= MAX_ENVIRONMENT_SIZE:
        raise OptionError(
            f"size: {size} texels of an environment are not from 1 to {MAX_ENVIRONMENT_SIZE}"
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class ProjectedTexture:
    """A picture thrown onto the surface by a slide projector.

    `matrix` (4, 4) takes world points to homogeneous (s, t, r, q); the picture is looked up at
    (s/q, t/q) inside the unit square, and nothing behind the projector (q <= 0) gets any. It
    replaces the base color by its own opacity times `strength`.
    """

    texture: ImageTexture
    matrix: FloatArray
    strength: float = 1.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Material:
    """Slots of a surface.

    Attributes
    ----------
    shading : str
        `unlit` (base color as it is), `lambert`, `blinn-phong` or `metallic-roughness` (glTF 2.0).
    base_color : slot
        C_b, linear; of glTF the base color, whose fourth channel is the opacity of an image.
    specular, exponent : slot
        C_s and e of Blinn-Phong.
    gloss : slot, optional
        Multiplies `specular`.
    roughness, metalness : slot
        Of metallic-roughness.
    emission : slot, optional
        Light that the surface gives off.
    vertex_colors : bool
        Whether the mesh's colors, taken as linear, multiply `base_color`.
    ior : float
        Index of refraction of what is no metal, of metallic-roughness: it reflects
        ((ior - 1) / (ior + 1))^2 of light head on, 4 % at 1.5.
    occlusion : slot, optional
        Multiplies ambient and environment light.
    occlusion_strength : float
        How much of `occlusion` o is applied: 1 + strength (o - 1).
    opacity : slot, optional
        1 hides what lies behind. It multiplies the fourth channel of an image of `base_color`, and
        that of vertex colors where those are used.
    alpha_mode, alpha_cutoff : str, float
        `blend`, `mask` (what is below the cutoff is not there) or `opaque`.
    light_map : slot, optional
        Light that falls on the surface beside the scene's; multiplied by the diffuse color.
    double_sided : bool, optional
        Whether back sides are drawn, with their normals turned; None: as the options say.
    """

    name: str = "material"
    shading: str = "metallic-roughness"
    base_color: Slot = (0.8, 0.8, 0.8)
    vertex_colors: bool = False
    specular: Slot = (0.2, 0.2, 0.2)
    exponent: Slot = 32.0
    gloss: Slot | None = None
    roughness: Slot = 0.5
    metalness: Slot = 0.0
    ior: float = 1.5
    emission: Slot | None = None
    occlusion: Slot | None = None
    occlusion_strength: float = 1.0
    opacity: Slot | None = None
    alpha_mode: str = "blend"
    alpha_cutoff: float = 0.5
    light_map: Slot | None = None
    normal_map: NormalMap | None = None
    bump_map: BumpMap | None = None
    displacement: Displacement | None = None
    parallax: Parallax | None = None
    reflection: Reflection | None = None
    refraction: Refraction | None = None
    projected: tuple[ProjectedTexture, ...] = ()
    double_sided: bool | None = None

    def __post_init__(self) -> None:
        for name, choices in ("shading", SHADINGS), ("alpha_mode", ALPHA_MODES):
            if getattr(self, name) not in choices:
                raise OptionError(
                    f"{self.name}.{name}: {getattr(self, name)!r} is not one of "
                    f"{', '.join(choices)}"
                )
        for name in _CONSTANT_SLOTS:
            check_constant(f"{self.name}.{name}", getattr(self, name))
        if isinstance(self.exponent, float | int) and self.exponent < 0.0:
            raise OptionError(f"{self.name}.exponent: {self.exponent} is below 0")
        if not (math.isfinite(self.alpha_cutoff) and 0.0 <= self.alpha_cutoff <= 1.0):
            raise OptionError(f"{self.name}.alpha_cutoff: {self.alpha_cutoff} is not from 0 to 1")
        if not 0.0 <= self.occlusion_strength <= 1.0:
            raise OptionError(
                f"{self.name}.occlusion_strength: {self.occlusion_strength} is not from 0 to 1"
            )
        if self.ior != 0.0 and not 1.0 <= self.ior < math.inf:
            raise OptionError(f"{self.name}.ior: {self.ior} is not 1 or more")
